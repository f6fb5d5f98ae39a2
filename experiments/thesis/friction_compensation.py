"""Chapter 4 (Tables 4.1 and 4.2): friction compensation of the force loop.

The compensator is compared with no compensation, with its partial forms and with an observer.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from controllers import Compensator
from experiments.thesis.friction_conclusions import OFFSETS, TABLE_4_1, conclude
from experiments.thesis.friction_tests import (
    LOOPS,
    calibrate,
    calibrated_errors,
    detect_reversals,
    run_compensated,
    run_timed_steps,
    variant_errors,
)
from experiments.thesis.study import Job, Result, ThesisStudy, span
from rigtwin.numerics.arrays import Array

MOST_SEEDS = 4
SINES = {"1 Hz": (1.0, 0.02), "5 Hz": (5.0, 0.001)}
"""Frequency, Hz, and amplitude of the plate, m, of Figures 4.8 and 4.9."""


def _variants() -> dict[str, dict[str, object]]:
    """Return the settings of every table row, with the thesis' parameters, and of the observer."""
    variants: dict[str, dict[str, object]] = {"none": {}}
    for name, threshold in TABLE_4_1:
        if threshold:
            variants[f"{name} {threshold}"] = {
                "compensator": Compensator.parse(name),
                "spike_threshold": float(threshold),
            }
    variants["two-step 4"] = {"compensator": Compensator.TWO_STEP, "spike_threshold": 4.0}
    variants["observer"] = {"compensator": Compensator.OBSERVER}
    return variants


def _few() -> dict[str, dict[str, object]]:
    """Return the settings that are also run with the nominal force loop."""
    return {
        name: settings
        for name, settings in _variants().items()
        if name in ("none", "one-step 4", "two-step 4", "observer")
    }


def _section(settings: Mapping[str, object]) -> Result:
    """Return a section of the test without and with each compensator (Fig. 4.10 to 4.17)."""
    signals: dict[str, Array | float] = {}
    for name in ("none", "one-step", "two-step", "observer"):
        test = run_compensated(
            0, **LOOPS["nominal"], **settings, compensator=Compensator.parse(name)
        )
        # Four seconds of the test from 10 s on, in ticks of 1 ms.
        shown = slice(10_000, 14_000)
        signals |= {
            "time": test.time[shown],
            f"{name} asked": test.simulation.commands[shown, 2],
            f"{name} force": test.force[shown],
            f"{name} velocity": np.gradient(test.travel, 1e-3)[shown],
        }
    return signals


def _calibrated(loop: str, count: int) -> Result:
    """Return all results that need a calibration, for one force loop.

    These are the errors, the drawn section of the test, and the detected reversals of sine motions.
    """
    calibration, settings = calibrate(loop)
    result = dict(calibrated_errors(loop, calibration, settings, count))
    result |= _section(settings)
    for label, (frequency, amplitude) in SINES.items():
        result |= {
            f"{label} {key}": value
            for key, value in detect_reversals(frequency, amplitude, 25.0, 0, **settings).items()
        }
    return result


def jobs(seeds: int) -> Mapping[str, Job]:
    """Return the jobs of the study; at most `MOST_SEEDS` seeds are used."""
    # Each seed stands for a test of every variant, so few seeds have to do.
    count = min(seeds, MOST_SEEDS)
    work: dict[str, Job] = {
        f"calibrated-{loop}": (lambda loop=loop: _calibrated(loop, count)) for loop in LOOPS
    }
    for seed in range(count):
        work[f"fitted/{seed}"] = lambda seed=seed: variant_errors("fitted", _variants(), seed)
        work[f"nominal/{seed}"] = lambda seed=seed: variant_errors("nominal", _few(), seed)
    work |= {
        f"timing/{offset}": (lambda offset=offset: run_timed_steps(offset)) for offset in OFFSETS
    }
    for label, (frequency, amplitude) in SINES.items():
        work[f"detection/{label}"] = lambda f=frequency, a=amplitude: detect_reversals(
            f, a, 25.0, 0, spike_threshold=2.0
        )
    return work


STUDY = ThesisStudy(
    "friction-compensation",
    "Friction compensation of the force loop",
    "4",
    ("Table 4.1", "Table 4.2", *span("Figure", "4.", 3, 17)),
    conclude,
    jobs,
)
