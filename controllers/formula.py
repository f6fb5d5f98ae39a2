"""Controllers written as a formula: `kp * (reference - position) - kv * derivative(position)`.

A formula is compiled into a short program of operations, which one function runs from Python and in
compiled loops. Every block with a memory starts at rest at its first sample.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.compiled import compilable, compiled

LONGEST = 4096
"""Largest number of ticks in the memory of a block."""

# Codes of the operations: those without a memory, which `operate` tells apart, then the blocks.
ADD, SUBTRACT, MULTIPLY, DIVIDE, NEGATE = range(5)
ABSOLUTE, SIGN, SINE, COSINE, ROOT, SMALLER, LARGER, CLIP = range(5, 13)
DERIVATIVE, INTEGRAL, LOW_PASS, MEAN, DELAY = range(13, 18)
PLAIN = {
    "abs": (ABSOLUTE, 1),
    "sign": (SIGN, 1),
    "sin": (SINE, 1),
    "cos": (COSINE, 1),
    "sqrt": (ROOT, 1),
}
PLAIN |= {"min": (SMALLER, 2), "max": (LARGER, 2), "limit": (CLIP, 3)}
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


class Program(NamedTuple):
    """Compiled formula.

    Registers hold the inputs, then the settings, the numbers, and the result of every operation.

    Attributes
    ----------
    operations : ndarray
        Code, three argument registers and start of the memory, shape (operations, 5).
    registers : ndarray
        Initial values of the registers, shape (registers,).
    inputs : int
        Number of inputs.
    memory : int
        Size of the memory of all blocks.
    """

    operations: NDArray[np.int64]
    registers: NDArray[np.float64]
    inputs: int
    memory: int


@dataclass(frozen=True)
class Formula:
    """Formula with its settings.

    Attributes
    ----------
    text : str
        Source.
    inputs : tuple of str
        Names of the inputs, in the order of their registers.
    settings : mapping
        Values of the settings by name.
    program : Program
        Compiled program.
    """

    text: str
    inputs: tuple[str, ...]
    settings: Mapping[str, float]
    program: Program

    def with_settings(self, settings: Mapping[str, float]) -> Program:
        """Return the program with other values of its settings."""
        registers = self.program.registers.copy()
        for register, name in enumerate(self.settings, start=len(self.inputs)):
            registers[register] = settings.get(name, self.settings[name])
        return self.program._replace(registers=registers)

    def replayed(
        self, settings: Mapping[str, float], inputs: Sequence[NDArray[Any]], period: float
    ) -> NDArray[np.float64]:
        """Return the value of the formula at every tick, shape (ticks,).

        inputs: signals in the order of `self.inputs`, each of shape (ticks,). For a formula
        without inputs, one signal gives the number of ticks. period: s.
        """
        program, ticks = self.with_settings(settings), len(inputs[0])
        out = np.empty(ticks)
        table = np.ascontiguousarray(np.stack(inputs, axis=1), np.float64)
        _replayed(program, program.registers.copy(), self.memory(), table, period, out)
        return out

    def memory(self) -> NDArray[np.float64]:
        """Return the memory of the blocks before the first sample: NaN marks an empty one."""
        return np.full(max(self.program.memory, 1), math.nan)


def formula(text: str, settings: Mapping[str, float]) -> Formula:
    """Compile a formula; every name that is not a setting is an input.

    Raises ValueError, saying what is wrong and where, for an invalid formula.
    """
    # Python's parser gives the precedence of the operators; nothing is evaluated as Python.
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(
            f"{text!r} is not a formula; expected an expression such as kp * x"
        ) from None
    # Order of first appearance: it defines the order of the inputs' registers.
    inputs = tuple(dict.fromkeys(_names(tree, settings)))
    builder = _Builder(inputs, settings)
    try:
        builder.result(tree)
    except RecursionError:
        raise ValueError(f"{text[:40]!r}... is nested too deeply") from None
    if not builder.operations:
        # A formula of a single name or number has no operation; adding 0 gives it one.
        builder.operation(ADD, builder.result(tree), builder.number(0.0))
    registers = np.array([*([0.0] * len(inputs)), *settings.values(), *builder.numbers], float)
    first = len(registers)
    table = np.array(
        [
            [code, *(r if r >= 0 else first - r - 1 for r in used), at]
            for code, *used, at in builder.operations
        ],
        np.int64,
    )
    program = Program(
        table, np.concatenate([registers, np.zeros(len(table))]), len(inputs), builder.memory_size
    )
    return Formula(text, inputs, dict(settings), program)


def _names(tree: ast.expr, settings: Mapping[str, float]) -> list[str]:
    """Return the names of the inputs in the order of their first appearance."""
    calls = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    nodes = [
        node for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in calls
    ]
    nodes.sort(key=lambda node: (node.lineno, node.col_offset))
    return [node.id for node in nodes if node.id not in settings]


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


class _Builder:
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


@compilable
def operate(code: int, x: float, y: float, z: float) -> float:
    """Return the result of an operation without a memory.

    code: one of those below `DERIVATIVE`; x, y, z: arguments, of which it uses the first ones.
    """
    value = x
    if code == ADD:
        value = x + y
    elif code == SUBTRACT:
        value = x - y
    elif code == MULTIPLY:
        value = x * y
    elif code == DIVIDE:
        # A formula must not stop the loop: x/0 is 0.
        value = x / y if y != 0.0 else 0.0
    elif code == NEGATE:
        value = -x
    elif code == ABSOLUTE:
        value = abs(x)
    elif code == SIGN:
        value = 0.0 if x == 0.0 else math.copysign(1.0, x)
    elif code == SINE:
        value = math.sin(x)
    elif code == COSINE:
        value = math.cos(x)
    elif code == ROOT:
        value = math.sqrt(max(x, 0.0))
    elif code == SMALLER:
        value = min(x, y)
    elif code == LARGER:
        value = max(x, y)
    elif code == CLIP:
        value = min(max(x, y), z)
    return value


@compilable
def run(operations: Any, registers: Any, memory: Any, period: float) -> float:
    """Return the value of a formula at one tick; registers and memory are changed.

    operations: of the program; registers: of the program, with the inputs in the first places;
    memory: of the blocks; a mean or a delay stores the position in its ring, then the ring.
    """
    count = len(operations)
    first = len(registers) - count
    value = 0.0
    for number in range(count):
        code = operations[number, 0]
        x = registers[operations[number, 1]]
        y = registers[operations[number, 2]]
        slot = operations[number, 4]
        if code < DERIVATIVE:
            value = operate(code, x, y, registers[operations[number, 3]])
        elif code == DERIVATIVE:
            value = 0.0 if math.isnan(memory[slot]) else (x - memory[slot]) / period
            memory[slot] = x
        elif code == INTEGRAL:
            previous = 0.0 if math.isnan(memory[slot]) else memory[slot]
            value = previous + x * period
            memory[slot] = value
        elif code == LOW_PASS:
            previous = x if math.isnan(memory[slot]) else memory[slot]
            value = previous + period / (y + period) * (x - previous)
            memory[slot] = value
        else:
            # Delay and mean: a ring of samples, one longer than the memory. It stays inline:
            # passing the arrays to a function costs as much as the rest of a tick.
            length, ring = int(y), slot + 1
            if math.isnan(memory[slot]):
                memory[slot] = 0.0
                for index in range(length + 1):
                    memory[ring + index] = x
            index = int(memory[slot])
            memory[ring + index] = x
            memory[slot] = index + 1 if index < length else 0
            if code == DELAY:
                value = memory[ring + (index + 1 if index < length else 0)]
            else:
                value = 0.0
                for back in range(length):
                    value += memory[ring + index - back + (0 if index >= back else length + 1)]
                value /= length
        registers[first + number] = value
    return value


@compiled
def _replayed(
    program: Program,
    registers: np.ndarray,
    memory: np.ndarray,
    inputs: np.ndarray,
    period: float,
    out: np.ndarray,
) -> None:
    """Run a formula over all ticks; `out` is written in place."""
    for tick in range(len(out)):
        for number in range(program.inputs):
            registers[number] = inputs[tick, number]
        out[tick] = run(program.operations, registers, memory, period)
