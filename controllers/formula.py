"""Controllers written as a formula: `kp * (reference - position) - kv * derivative(position)`.

A formula is compiled into a short program of blocks, which the same function runs from Python and
inside compiled loops. Every block that remembers something starts at rest at its first sample.
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
"""Ticks that a block remembers at most."""

ADD, SUBTRACT, MULTIPLY, DIVIDE, NEGATE = range(5)
ABSOLUTE, SIGN, SINE, COSINE, ROOT, SMALLER, LARGER = range(5, 12)
DERIVATIVE, INTEGRAL, LOW_PASS, MEAN, LATE, CLIP = range(12, 18)
PLAIN = {
    "abs": (ABSOLUTE, 1),
    "sign": (SIGN, 1),
    "sin": (SINE, 1),
    "cos": (COSINE, 1),
    "sqrt": (ROOT, 1),
}
PLAIN |= {"min": (SMALLER, 2), "max": (LARGER, 2), "limit": (CLIP, 3)}
BLOCKS = {
    "derivative": (DERIVATIVE, 1, "derivative(x): of its last two samples"),
    "integral": (INTEGRAL, 1, "integral(x): sum of its samples times the period"),
    "low_pass": (LOW_PASS, 2, "low_pass(x, time_constant): first-order lag"),
    "mean": (MEAN, 2, "mean(x, n): of its last n samples"),
    "late": (LATE, 2, "late(x, n): n samples ago"),
}
OPERATORS = {ast.Add: ADD, ast.Sub: SUBTRACT, ast.Mult: MULTIPLY, ast.Div: DIVIDE}
FUNCTIONS = (*PLAIN, *BLOCKS)


class Program(NamedTuple):
    """A compiled formula. Registers hold inputs, then settings, then numbers, then each operation's
    result; operations: code, three registers, and where its memory begins, shape (operations, 5);
    registers: as they start, shape (registers,)."""

    operations: NDArray[np.int64]
    registers: NDArray[np.float64]
    inputs: int
    memory: int


@dataclass(frozen=True)
class Formula:
    """A controller. inputs: names in the order in which `run` takes their values; settings: name →
    value."""

    text: str
    inputs: tuple[str, ...]
    settings: Mapping[str, float]
    program: Program

    def with_settings(self, settings: Mapping[str, float]) -> Program:
        """The program with other values of its settings."""
        registers = self.program.registers.copy()
        for place, name in enumerate(self.settings, start=len(self.inputs)):
            registers[place] = settings.get(name, self.settings[name])
        return self.program._replace(registers=registers)

    def replayed(
        self, settings: Mapping[str, float], inputs: Sequence[NDArray[Any]], period: float
    ) -> NDArray[np.float64]:
        """Its value at every tick. inputs: in their order, shape (ticks,) each; of a formula
        without any, one signal of which only the length counts."""
        program, ticks = self.with_settings(settings), len(inputs[0])
        out = np.empty(ticks)
        table = np.ascontiguousarray(np.stack(inputs, axis=1), np.float64)
        _replayed(program, program.registers.copy(), self.memory(), table, period, out)
        return out

    def memory(self) -> NDArray[np.float64]:
        """What its blocks remember, before the first sample."""
        return np.full(max(self.program.memory, 1), math.nan)


def formula(text: str, settings: Mapping[str, float]) -> Formula:
    """Compiles a formula. Every name that is no setting is an input. Raises ValueError saying what
    is wrong and where."""
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(f"{text!r} is no formula") from None
    inputs = tuple(dict.fromkeys(_names(tree, settings)))
    builder = _Builder(inputs, settings)
    try:
        builder.result(tree)
    except RecursionError:
        raise ValueError(f"{text[:40]!r}... is nested too deeply") from None
    if not builder.operations:
        # The formula is one name or number: pass it on.
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
        table, np.concatenate([registers, np.zeros(len(table))]), len(inputs), builder.remembered
    )
    return Formula(text, inputs, dict(settings), program)


def _names(tree: ast.expr, settings: Mapping[str, float]) -> list[str]:
    calls = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    found = [
        node for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in calls
    ]
    found.sort(key=lambda node: (node.lineno, node.col_offset))
    return [node.id for node in found if node.id not in settings]


def _finite(value: float) -> float:
    """A number of a formula. Raises ValueError if it is too large to be one."""
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("a number in the formula is too large; expected at most 1.8e308")
    return number


def _number_of(node: ast.expr) -> float | None:
    """The value of a number in a formula, with its sign; None of anything else."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = _number_of(node.operand)
        return None if inner is None else -inner
    plain = isinstance(node, ast.Constant) and isinstance(node.value, int | float)
    return float(node.value) if plain else None  # type: ignore[union-attr]


class _Builder:
    """Registers of results are counted −1, −2, …, since how many numbers there are is known only at
    the end."""

    def __init__(self, inputs: Sequence[str], settings: Mapping[str, float]) -> None:
        self._place = {name: number for number, name in enumerate([*inputs, *settings])}
        self._settings = settings
        self.numbers: list[float] = []
        self.operations: list[tuple[int, int, int, int, int]] = []
        self.remembered = 0

    def number(self, value: float) -> int:
        self.numbers.append(value)
        return len(self._place) + len(self.numbers) - 1

    def operation(self, code: int, one: int, two: int = 0, three: int = 0, memory: int = 0) -> int:
        self.operations.append((code, one, two, three, self.remembered))
        self.remembered += memory
        return -len(self.operations)

    def result(self, node: ast.expr) -> int:
        """The register that a part of the formula ends in."""
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, int | float)
            and not isinstance(node.value, bool)
        ):
            return self.number(_finite(node.value))
        if isinstance(node, ast.Name):
            return self._place[node.id]
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
        """Of a number or a setting; None of anything else."""
        if isinstance(node, ast.Name):
            return self._settings.get(node.id)
        return _number_of(node)

    def _call(self, name: str, given: list[ast.expr]) -> int:
        if name not in FUNCTIONS:
            raise ValueError(f"unknown function {name!r}; there are {', '.join(FUNCTIONS)}")
        code, count = PLAIN[name] if name in PLAIN else BLOCKS[name][:2]
        if len(given) != count:
            raise ValueError(
                f"{name} takes {count} value{'s' if count > 1 else ''}, not {len(given)}"
            )
        memory = 2 if name in BLOCKS else 0
        if name in ("mean", "late"):
            last = given[1]
            whole = last.value if isinstance(last, ast.Constant) else None
            if not isinstance(whole, int) or not 1 <= whole <= LONGEST:
                raise ValueError(
                    f"{name}: expected a whole number of samples from "
                    f"1 to {LONGEST}, not {ast.unparse(last)}"
                )
            memory = whole + 2
        numbers = [self._value_of(each) for each in given]
        if name == "low_pass" and numbers[1] is not None and not numbers[1] > 0.0:
            raise ValueError(f"low_pass: expected a time constant above 0 s, not {numbers[1]:g}")
        if name == "limit" and None not in numbers[1:] and not numbers[1] <= numbers[2]:  # type: ignore[operator]
            raise ValueError(
                f"limit: expected a lower limit below the upper one, not {numbers[1]:g} and "
                f"{numbers[2]:g}"
            )
        used = [self.result(each) for each in given]
        return self.operation(code, *used, *([0] * (3 - len(used))), memory=memory)


@compilable
def run(operations: Any, registers: Any, memory: Any, period: float) -> float:
    """The formula's value at this tick. operations: of its program; registers: the program's, with
    the inputs' values written into its first places; memory: what its blocks remember, of a mean or
    a delay where its ring of samples stands, then the ring. Both are changed."""
    count = len(operations)
    first = len(registers) - count
    value = 0.0
    for number in range(count):
        code = operations[number, 0]
        one = registers[operations[number, 1]]
        two = registers[operations[number, 2]]
        three = registers[operations[number, 3]]
        at = operations[number, 4]
        if code == ADD:
            value = one + two
        elif code == SUBTRACT:
            value = one - two
        elif code == MULTIPLY:
            value = one * two
        elif code == DIVIDE:
            value = one / two if two != 0.0 else 0.0
        elif code == NEGATE:
            value = -one
        elif code == ABSOLUTE:
            value = abs(one)
        elif code == SIGN:
            value = 0.0 if one == 0.0 else math.copysign(1.0, one)
        elif code == SINE:
            value = math.sin(one)
        elif code == COSINE:
            value = math.cos(one)
        elif code == ROOT:
            value = math.sqrt(max(one, 0.0))
        elif code == SMALLER:
            value = min(one, two)
        elif code == LARGER:
            value = max(one, two)
        elif code == CLIP:
            value = min(max(one, two), three)
        elif code == DERIVATIVE:
            value = 0.0 if math.isnan(memory[at]) else (one - memory[at]) / period
            memory[at] = one
        elif code == INTEGRAL:
            before = 0.0 if math.isnan(memory[at]) else memory[at]
            value = before + one * period
            memory[at] = value
        elif code == LOW_PASS:
            before = one if math.isnan(memory[at]) else memory[at]
            value = before + period / (two + period) * (one - before)
            memory[at] = value
        else:
            # A ring of samples, one longer than what is remembered. Not in a function of its own:
            # to hand on the arrays costs as much as the rest of a tick.
            length, ring = int(two), at + 1
            if math.isnan(memory[at]):
                memory[at] = 0.0
                for place in range(length + 1):
                    memory[ring + place] = one
            place = int(memory[at])
            memory[ring + place] = one
            memory[at] = place + 1 if place < length else 0
            if code == LATE:
                value = memory[ring + (place + 1 if place < length else 0)]
            else:
                value = 0.0
                for back in range(length):
                    value += memory[ring + place - back + (0 if place >= back else length + 1)]
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
    for tick in range(len(out)):
        for number in range(program.inputs):
            registers[number] = inputs[tick, number]
        out[tick] = run(program.operations, registers, memory, period)
