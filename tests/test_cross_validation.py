"""What a correction must do on data held out of its fit."""

from __future__ import annotations

import pytest

from rigtwin.diagnosis.cross_validation import drop_idle
from rigtwin.diagnosis.finding import Interval
from tests.helpers.twin import rig_effect


@pytest.mark.parametrize(
    ("low", "high", "stays"),
    [(-0.08, -0.01, False), (-0.02, 0.03, True), (0.5, 0.9, True), (0.0, 0.0, True)],
)
def test_what_surely_closes_nothing_of_the_gap_is_not_named(low: float, high: float, stays: bool):
    # Nothing was left to judge it on where both ends are 0.
    effects = (rig_effect("stribeck@rail"), rig_effect("mass@carriage"))
    kept, idle = drop_idle(effects, Interval(0.5 * (low + high), low, high))
    assert (kept, idle) == ((effects, ()) if stays else ((), effects))
    assert drop_idle((), Interval(0.0, low, high)) == ((), ())
