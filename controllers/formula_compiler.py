"""Translation of a formula's syntax tree into a program for a stack."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence

from controllers.formula_program import (
    ABSOLUTE,
    ADD,
    CLIP,
    COSINE,
    DELAY,
    DERIVATIVE,
    DIVIDE,
    INTEGRAL,
    LARGER,
    LOW_PASS,
    MEAN,
    MULTIPLY,
    NEGATE,
    ROOT,
    SIGN,
    SINE,
    SMALLER,
    SUBTRACT,
)

LONGEST = 4096
"""Largest number of ticks in the memory of a block."""
PLAIN = {
    "abs": (ABSOLUTE, 1),
    "sign": (SIGN, 1),
    "sin": (SINE, 1),
    "cos": (COSINE, 1),
    "sqrt": (ROOT, 1),
    "min": (SMALLER, 2),
    "max": (LARGER, 2),
    "limit": (CLIP, 3),
}
BLOCKS = {
    "derivative": (
        DERIVATIVE,
        1,
        "derivative(x): difference of the last two samples over the period",
    ),
    "integral": (INTEGRAL, 1, "integral(x): sum of the samples times the period"),
    "low_pass": (LOW_PASS, 2, "low_pass(x, time_constant): first-order lag"),
    "mean": (MEAN, 2, "mean(x, n): mean of the last n samples"),
    "delay": (DELAY, 2, "delay(x, n): value n samples ago"),
}
OPERATORS = {ast.Add: ADD, ast.Sub: SUBTRACT, ast.Mult: MULTIPLY, ast.Div: DIVIDE}
FUNCTIONS = (*PLAIN, *BLOCKS)
"""Names of all functions: those without a memory, then the blocks."""


def _finite(value: float) -> float:
    """Return a number of a formula as float. Raises ValueError if it is not finite."""
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("a number in the formula is too large; expected at most 1.8e308")
    return number


def _number_of(node: ast.expr) -> float | None:
    """Return the value of a literal number with its sign; None for another expression."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = _number_of(node.operand)
        return None if inner is None else -inner
    plain = isinstance(node, ast.Constant) and isinstance(node.value, int | float)
    return float(node.value) if plain else None  # type: ignore[union-attr]


class Builder:
    """Builder of a program.

    Results have the provisional registers −1, −2, …, because the count of literal numbers, which
    stand before them, is known only at the end.
    """

    def __init__(self, inputs: Sequence[str], settings: Mapping[str, float]) -> None:
        self._registers = {name: number for number, name in enumerate([*inputs, *settings])}
        self._settings = settings
        self.numbers: list[float] = []
        self.operations: list[tuple[int, int, int, int, int]] = []
        self.memory_size = 0

    def number(self, value: float) -> int:
        """Add a literal number and return its register."""
        self.numbers.append(value)
        return len(self._registers) + len(self.numbers) - 1

    def operation(
        self, code: int, first: int, second: int = 0, third: int = 0, memory: int = 0
    ) -> int:
        """Add an operation and return its provisional register; memory: numbers it stores."""
        self.operations.append((code, first, second, third, self.memory_size))
        self.memory_size += memory
        return -len(self.operations)

    def result(self, node: ast.expr) -> int:
        """Add the operations of a part of the formula and return the register of its result."""
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, int | float)
            and not isinstance(node.value, bool)
        ):
            return self.number(_finite(node.value))
        if isinstance(node, ast.Name):
            return self._registers[node.id]
        if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
            return self.operation(
                OPERATORS[type(node.op)], self.result(node.left), self.result(node.right)
            )
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return self.operation(NEGATE, self.result(node.operand))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            return self._call(node.func.id, node.args)
        raise ValueError(
            f"{ast.unparse(node)!r} is not allowed; there are + - "
            f"* /, numbers, names, {', '.join(FUNCTIONS)}"
        )

    def _value_of(self, node: ast.expr) -> float | None:
        """Return the value of a number or a setting; None for another expression."""
        if isinstance(node, ast.Name):
            return self._settings.get(node.id)
        return _number_of(node)

    def _call(self, name: str, arguments: list[ast.expr]) -> int:
        """Add a function call, with its arguments checked as far as they are constant."""
        if name == "late":
            raise ValueError(
                "unknown function 'late'; write delay(x, n) for the value n samples ago"
            )
        if name not in FUNCTIONS:
            raise ValueError(f"unknown function {name!r}; there are {', '.join(FUNCTIONS)}")
        code, count = PLAIN[name] if name in PLAIN else BLOCKS[name][:2]
        if len(arguments) != count:
            raise ValueError(
                f"{name} takes {count} value{'s' if count > 1 else ''}, not {len(arguments)}"
            )
        memory = 2 if name in BLOCKS else 0
        if name in ("mean", "delay"):
            last = arguments[1]
            whole = last.value if isinstance(last, ast.Constant) else None
            if not isinstance(whole, int) or not 1 <= whole <= LONGEST:
                raise ValueError(
                    f"{name}: expected a whole number of samples from "
                    f"1 to {LONGEST}, not {ast.unparse(last)}"
                )
            memory = whole + 2
        numbers = [self._value_of(argument) for argument in arguments]
        if name == "low_pass" and numbers[1] is not None and not numbers[1] > 0.0:
            raise ValueError(f"low_pass: expected a time constant above 0 s, not {numbers[1]:g}")
        if name == "limit" and None not in numbers[1:] and not numbers[1] <= numbers[2]:  # type: ignore[operator]
            raise ValueError(
                f"limit: expected a lower limit below the upper one, not {numbers[1]:g} and "
                f"{numbers[2]:g}"
            )
        used = [self.result(argument) for argument in arguments]
        return self.operation(code, *used, *([0] * (3 - len(used))), memory=memory)
