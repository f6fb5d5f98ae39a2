"""Predictions that miss most of a signal are never called right."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rigtwin.diagnosis.judgement import _is_lost
from tests.engine.linear import lines_of


@pytest.mark.parametrize(
    ("missed", "noise", "is_lost"),
    [(0.1, 0.01, False), (0.9, 0.01, True), (0.9, 0.5, False), (100.0, 0.01, True)],
)
def test_a_residual_beyond_half_of_a_signal_is_no_noise(
    missed: float, noise: float, is_lost: bool
) -> None:
    """A residual counts from half of the signal's deviation and five times its noise on."""
    wave = np.sqrt(2.0) * np.sin(np.linspace(0.0, 100.0 * np.pi, 4001))[None]
    lines = lines_of(wave, np.array([noise]))
    evidence: Any = SimpleNamespace(lines=[lines], differences=lambda _: [missed * wave])
    assert _is_lost(evidence, evidence) is is_lost
