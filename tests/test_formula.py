"""Formulas: every block against its closed form, compiled and not; every mistake in one line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controllers.formula import formula
from controllers.formula_compiler import BLOCKS, FUNCTIONS, PLAIN
from controllers.formula_program import run

PERIOD = 1e-3
TICKS = 400
TIME = np.arange(TICKS) * PERIOD
SIGNAL = np.sin(20.0 * TIME) + 0.3 * TIME


def value(text: str, settings: dict[str, float] | None = None, **inputs: np.ndarray) -> np.ndarray:
    compiled = formula(text, settings or {})
    return compiled.replayed({}, [inputs[name] for name in compiled.inputs], PERIOD)


def filtered(signal: np.ndarray, time_constant: float) -> np.ndarray:
    out, level = np.empty(TICKS), signal[0]
    for tick, sample in enumerate(signal):
        level += PERIOD / (time_constant + PERIOD) * (sample - level)
        out[tick] = level
    return out


EXPECTED = {
    "2 * x - 3": 2 * SIGNAL - 3,
    "x / 0": np.zeros(TICKS),
    "-(x + 1) / 4": -(SIGNAL + 1) / 4,
    "abs(x) + sign(x)": np.abs(SIGNAL) + np.sign(SIGNAL),
    "sin(x) + cos(x)": np.sin(SIGNAL) + np.cos(SIGNAL),
    "sqrt(abs(x))": np.sqrt(np.abs(SIGNAL)),
    "min(x, 0.2) + max(x, 0.1)": np.minimum(SIGNAL, 0.2) + np.maximum(SIGNAL, 0.1),
    "limit(x, -0.5, 0.5)": np.clip(SIGNAL, -0.5, 0.5),
    "derivative(x)": np.concatenate([[0.0], np.diff(SIGNAL) / PERIOD]),
    "integral(x)": np.cumsum(SIGNAL) * PERIOD,
    "low_pass(x, 0.02)": filtered(SIGNAL, 0.02),
    "delay(x, 3)": np.concatenate([np.full(3, SIGNAL[0]), SIGNAL[:-3]]),
    "mean(x, 2)": 0.5 * (SIGNAL + np.concatenate([[SIGNAL[0]], SIGNAL[:-1]])),
    "x": SIGNAL,
    "1.5": np.full(TICKS, 1.5),
}


@pytest.mark.parametrize("text", EXPECTED)
def test_a_formula_is_what_it_says(text):
    compiled = formula(text, {})
    inputs = [SIGNAL for _ in compiled.inputs] or [SIGNAL]
    np.testing.assert_allclose(compiled.replayed({}, inputs, PERIOD), EXPECTED[text], atol=1e-12)


def test_every_function_is_tested():
    assert all(any(f"{name}(" in text for text in EXPECTED) for name in FUNCTIONS)
    assert set(FUNCTIONS) == {*PLAIN, *BLOCKS}


@pytest.mark.parametrize("text", EXPECTED)
def test_python_and_compiled_code_agree(text):
    compiled = formula(text, {})
    program, memory = compiled.program, compiled.memory()
    registers, out = program.registers.copy(), np.empty(TICKS)
    for tick in range(TICKS):
        registers[: program.inputs] = SIGNAL[tick]
        out[tick] = run(program.operations, registers, memory, PERIOD)
    inputs = [SIGNAL for _ in compiled.inputs] or [SIGNAL]
    np.testing.assert_allclose(out, compiled.replayed({}, inputs, PERIOD), atol=1e-12)


def test_settings_are_settings_and_all_other_names_inputs():
    compiled = formula(
        "kp * (reference - position) - kv * derivative(position)", {"kp": 3.0, "kv": 0.5}
    )
    assert compiled.inputs == ("reference", "position")
    one = compiled.replayed({}, [SIGNAL, TIME], PERIOD)
    np.testing.assert_allclose(one[1:], (3.0 * (SIGNAL - TIME) - 0.5)[1:], atol=1e-9)
    other = compiled.replayed({"kp": 6.0}, [SIGNAL, TIME], PERIOD)
    np.testing.assert_allclose((other - one)[1:], 3.0 * (SIGNAL - TIME)[1:], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("kp *", "not a formula"),
        ("", "not a formula"),
        ("x ** 2", "not allowed"),
        ("x if x else 1", "not allowed"),
        ("__import__('os')", "unknown function"),
        ("x.real", "not allowed"),
        ("'text'", "not allowed"),
        ("True", "not allowed"),
        ("tan(x)", "unknown function 'tan'"),
        ("limit(x, 1)", "limit takes 3 values, not 2"),
        ("mean(x, 0)", "whole number"),
        ("low_pass(x, 0)", "a time constant above 0 s, not 0"),
        ("low_pass(x, -0.1)", "a time constant above 0 s, not -0.1"),
        ("limit(x, 1, -2)", "a lower limit below the upper one, not 1 and -2"),
        ("mean(x, 2.5)", "whole number"),
        ("delay(x, y)", "whole number"),
        ("late(x, 3)", "write delay"),
        ("low_pass(x, tau=1)", "not allowed"),
        ("(" * 300 + "x" + ")" * 300, "not a formula"),
    ],
)
def test_a_mistake_is_said(text, said):
    with pytest.raises(ValueError, match=said.replace("(", "\\(")):
        formula(text, {})


@pytest.mark.parametrize(
    ("text", "settings", "said"),
    [
        ("low_pass(x, tau)", {"tau": -0.1}, "a time constant above 0 s, not -0.1"),
        ("limit(x, low, high)", {"low": 1.0, "high": -1.0}, "not 1 and -1"),
        ("limit(x, low, 2)", {"low": 3.0}, "not 3 and 2"),
    ],
)
def test_what_settings_make_of_a_block_is_looked_at_too(text, settings, said):
    with pytest.raises(ValueError, match=said):
        formula(text, settings)


def test_a_formula_without_inputs_is_constant():
    """The signal that says how many ticks there are is none of its numbers."""
    assert formula("0.5 * 2 - 3", {}).replayed({}, [TIME], PERIOD).tolist() == [-2.0] * TICKS


def test_memory_begins_at_rest():
    assert np.isnan(formula("mean(x, 5)", {}).memory()).all()
    assert not math.isnan(value("derivative(x)", x=SIGNAL)[0])
