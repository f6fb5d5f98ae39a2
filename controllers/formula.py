"""Controllers written as a formula: `kp * (reference - position) - kv * derivative(position)`.

A formula is compiled into a short program of operations, which one function runs from Python and in
compiled loops. Every block with a memory starts at rest at its first sample.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controllers.compiled import compiled
from controllers.formula_compiler import Builder
from controllers.formula_program import (
    ADD,
    Program,
    run,
)


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
    builder = Builder(inputs, settings)
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
