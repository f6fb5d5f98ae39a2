"""Confidence: a calibrated probability, lowered by that of a mimic."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from rigtwin.diagnosis.support import Support

ANCHORS = [(0.0, 0.0), (0.5, 0.5), (0.8, 0.8), (0.95, 0.93), (0.999, 0.98), (1.0, 0.98)]


def confidence(probability: float, mimic: float = 0.0) -> float:
    return Support(probability, 10.0, 9.0, 0.0, 9.0, mimic).confidence


@pytest.mark.parametrize(("probability", "expected"), ANCHORS)
def test_confidence_at_its_anchors(probability, expected):
    assert confidence(probability) == pytest.approx(expected)


def test_confidence_is_straight_between_its_anchors():
    for (low, left), (high, right) in pairwise(ANCHORS):
        for part in (0.25, 0.5):
            expected = left + part * (right - left)
            assert confidence(low + part * (high - low)) == pytest.approx(expected)


@pytest.mark.parametrize("mimic", [0.1, 0.5, 1.0])
def test_a_mimic_lowers_the_probability_before_it_is_calibrated(mimic):
    """confidence(p, m) = calibration(p (1 − m))."""
    for probability in np.linspace(0.1, 1.0, 7):
        places, heights = zip(*ANCHORS, strict=True)
        expected = np.interp(probability * (1.0 - mimic), np.array(places), np.array(heights))
        assert confidence(float(probability), mimic) == pytest.approx(expected)
