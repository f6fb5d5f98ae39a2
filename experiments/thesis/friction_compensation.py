"""Chapter 4: the friction compensator against no compensation, its partial forms, and an observer:
Tables 4.1 and 4.2."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from controllers import Compensator
from experiments.thesis.entry import Entry, digits, factor, statement
from experiments.thesis.friction_drawings import IN_TIME, LATE, drawings, errors_of, two_step
from experiments.thesis.friction_tests import (
    LOOPS,
    calibrated_rows,
    calibration,
    compensated,
    detected,
    rows,
    timed,
)
from experiments.thesis.study import Conclusion, Job, Result, Study, span
from rigtwin.numerics.arrays import Array

WITHIN = 1.5
MOST_SEEDS = 4
TABLE_4_1 = {
    ("none", 0): ("3.955", "0.281", "4.236"),
    ("one-step", 1): ("2.714", "0.240", "2.954"),
    ("one-step", 2): ("2.689", "0.221", "2.910"),
    ("one-step", 3): ("2.718", "0.215", "2.933"),
    ("one-step", 4): ("2.663", "0.220", "2.883"),
    ("one-step", 5): ("2.943", "0.224", "3.167"),
    ("force-profile", 1): ("4.285", "1.119", "5.404"),
    ("force-profile", 2): ("4.074", "0.828", "4.902"),
    ("force-profile", 3): ("3.760", "0.606", "4.366"),
    ("force-profile", 4): ("3.444", "0.519", "3.963"),
    ("force-profile", 5): ("3.135", "0.353", "3.488"),
    ("force-threshold", 2): ("7.276", "0.333", "7.609"),
    ("force-threshold", 4): ("6.115", "0.300", "6.415"),
    ("force-threshold", 6): ("4.061", "0.231", "4.292"),
    ("force-threshold", 8): ("3.440", "0.227", "3.667"),
    ("force-threshold", 10): ("3.622", "0.255", "3.877"),
    ("force-threshold", 12): ("3.854", "0.318", "4.172"),
}
"""Thesis Table 4.1, rms N: (algorithm, force threshold N) → tracking, numerical, total. `A1.184` is
a misprint of 5.404, the sum of the other two in its row."""
TABLE_4_2 = {
    "none": ("3.955", "0.281", "4.236"),
    "one-step": ("2.663", "0.212", "2.875"),
    "two-step": ("2.474", "0.196", "2.670"),
}
"""Thesis Table 4.2; it calls the tracking error e1 and the numerical one e2."""
NOISE = (
    "the thesis' spikes rise in 20 ms and its filtered noise is 1 N; the "
    "nominal rig's friction turns within a tick and its "
    "hum is 3.1 N after the filter, as high as these thresholds"
)
SINES = {"1 Hz": (1.0, 0.02), "5 Hz": (5.0, 0.001)}
"""Hz and m of the plate, Fig. 4.8 and 4.9."""
OFFSETS = (None, -0.015, -0.005, 0.0, 0.005, 0.015)
ERRORS = ("tracking", "numerical", "total")


def _variants() -> dict[str, dict[str, object]]:
    """Thesis parameters: every row of both tables, and the observer."""
    found: dict[str, dict[str, object]] = {"none": {}}
    for name, threshold in TABLE_4_1:
        if threshold:
            found[f"{name} {threshold}"] = {
                "compensator": Compensator.parse(name),
                "spike_threshold": float(threshold),
            }
    found["two-step 4"] = {"compensator": Compensator.TWO_STEP, "spike_threshold": 4.0}
    found["observer"] = {"compensator": Compensator.OBSERVER}
    return found


def _few() -> dict[str, dict[str, object]]:
    return {
        name: settings
        for name, settings in _variants().items()
        if name in ("none", "one-step 4", "two-step 4", "observer")
    }


def _section(settings: Mapping[str, object]) -> Result:
    """A stretch of the test without, with the calibrated compensators and with the observer (Fig.
    4.10 to 4.17)."""
    found: dict[str, Array | float] = {}
    for name in ("none", "one-step", "two-step", "observer"):
        test = compensated(0, **LOOPS["nominal"], **settings, compensator=Compensator.parse(name))
        shown = slice(10_000, 14_000)
        found |= {
            "time": test.time[shown],
            f"{name} asked": test.ran.commands[shown, 2],
            f"{name} force": test.force[shown],
            f"{name} velocity": np.gradient(test.travel, 1e-3)[shown],
        }
    return found


def _calibrated(loop: str, count: int) -> Result:
    """All that needs the calibration: its rows, the stretch that is drawn, and what it detects of
    sine motions."""
    found, settings = calibration(loop)
    result = dict(calibrated_rows(loop, found, settings, count))
    result |= _section(settings)
    for label, (frequency, amplitude) in SINES.items():
        result |= {
            f"{label} {key}": value
            for key, value in detected(frequency, amplitude, 25.0, 0, **settings).items()
        }
    return result


def jobs(seeds: int) -> Mapping[str, Job]:
    count = min(seeds, MOST_SEEDS)
    found: dict[str, Job] = {
        f"calibrated-{loop}": (lambda loop=loop: _calibrated(loop, count)) for loop in LOOPS
    }
    for seed in range(count):
        found[f"fitted/{seed}"] = lambda seed=seed: rows("fitted", _variants(), seed)
        found[f"nominal/{seed}"] = lambda seed=seed: rows("nominal", _few(), seed)
    found |= {f"timing/{offset}": (lambda offset=offset: timed(offset)) for offset in OFFSETS}
    for label, (frequency, amplitude) in SINES.items():
        found[f"detection/{label}"] = lambda f=frequency, a=amplitude: detected(
            f, a, 25.0, 0, spike_threshold=2.0
        )
    return found


def _reduction(
    results: Mapping[str, Result], loop: str, row: str, error: str, base: str = "none"
) -> Array:
    """In %, of each seed."""
    return 100 * (1 - errors_of(results, loop, row)[error] / errors_of(results, loop, base)[error])


def _tables(results: Mapping[str, Result]) -> list[Entry]:
    entries: list[Entry] = []
    for (name, threshold), printed in TABLE_4_1.items():
        row = f"{name} {threshold}" if threshold else name
        found = errors_of(results, "fitted", row)
        for error, text in zip(ERRORS, printed, strict=True):
            note = "printed `A1.184`; its row sums to 5.404" if text == "5.404" else ""
            entry = factor("Table 4.1", f"{row}: {error}", text, found[error], "N", WITHIN, note)
            entries.append(entry if entry.agrees or note else _noted(entry, NOISE))
    for name, printed in TABLE_4_2.items():
        row = name if name == "none" else f"{name} 4"
        found = errors_of(results, "fitted", row)
        for error, text in zip(ERRORS, printed, strict=True):
            entry = factor("Table 4.2", f"{name}: {error}", text, found[error], "N", WITHIN)
            entries.append(entry if entry.agrees else _noted(entry, NOISE))
    entries.append(
        digits(
            "Table 4.2",
            "total of two steps against none, from the table itself",
            "37",
            100 * (1 - 2.670 / 4.236),
            "%",
        )
    )
    return entries


def _noted(entry: Entry, note: str) -> Entry:
    return Entry(**{**vars(entry), "note": note})


def _interval(values: Array, unit: str = " %") -> str:
    low, middle, high = np.percentile(values, [5, 50, 95])
    return f"{middle:.3g}{unit} ({low:.3g} to {high:.3g})"


def _goals(results: Mapping[str, Result]) -> list[Entry]:
    entries = []
    for loop in ("nominal", "fitted"):
        for row in ("calibrated one-step", "calibrated two-step"):
            found = _reduction(results, loop, row, "total")
            holds = bool(np.median(found) >= 37.0)
            note = (
                ""
                if holds
                else f"{NOISE}; the sample in which friction turns, "
                "before any loop can act, is 2.0 N of it"
            )
            says = "37 % less e1 + e2"
            entries.append(
                statement(
                    "§4.6",
                    f"{row}, {loop} force loop",
                    says,
                    holds,
                    f"{_interval(found)} less",
                    note,
                )
            )
    spike = _reduction(results, "nominal", "calibrated two-step", "spike")
    before = errors_of(results, "nominal", "none")["spike"]
    text = f"{_interval(spike)} less, from {np.median(before):.0f} N"
    holds = bool(np.median(spike) >= 50)
    entries.append(
        statement(
            "Figure 4.17",
            "spike, two steps, nominal loop",
            "50 % less, from 20 N to 10 N",
            holds,
            text,
        )
    )
    own = errors_of(results, "nominal", "observer")["total"]
    best = np.minimum(
        np.minimum(
            *(
                errors_of(results, "nominal", f"calibrated {kind}")["total"]
                for kind in ("one-step", "two-step")
            )
        ),
        np.minimum(
            *(
                errors_of(results, "fitted", f"calibrated {kind}")["total"]
                for kind in ("one-step", "two-step")
            )
        ),
    )
    text = (
        f"{np.median(own):.2f} N against {np.median(best):.2f} N, "
        f"{_interval(100 * (1 - own / best))} less, in every seed"
    )
    beats = bool(np.all(own < best))
    entries.append(
        statement(
            "beyond", "observer against the thesis' best, same seeds", "less e1 + e2", beats, text
        )
    )
    return entries


def _timing(results: Mapping[str, Result]) -> list[Entry]:
    found = {offset: float(results[f"timing/{offset}"]["rms"]) for offset in OFFSETS}
    none = found[None]
    text = (
        ", ".join(f"{1e3 * o:+.0f} ms {v:.2f} N" for o, v in found.items() if o is not None)
        + f"; none {none:.2f} N"
    )
    good = all(found[o] < 0.85 * none for o in (-0.005, 0.0, 0.005))
    bad = all(found[o] > 0.95 * none for o in (-0.015, 0.015))
    entries = [
        statement(
            "Figure 4.6",
            "steps within 5 ms of the reversal",
            "reduce the error",
            good,
            text,
            "" if good else NOISE,
        ),
        statement("Figure 4.6", "steps 15 ms early or late", "no improvement", bad, text),
    ]
    for figure, label in (("Figure 4.8", "1 Hz"), ("Figure 4.9", "5 Hz")):
        tuned = {
            key: results["calibrated-fitted"][f"{label} {key}"]
            for key in ("reversals", "seen", "false", "delay")
        }
        for words, one in (("threshold 2 N", results[f"detection/{label}"]), ("calibrated", tuned)):
            delay = float(one["delay"])
            late = "none in time" if math.isnan(delay) else f"{1e3 * delay:.0f} ms late"
            text = f"{one['seen']:.0f} of {one['reversals']:.0f}, {one['false']:.0f} false, {late}"
            all_seen = one["seen"] == one["reversals"] and one["false"] == 0
            note = "" if all_seen else NOISE
            entries.append(
                statement(
                    figure,
                    f"{label}, {words}: spikes of 25 s detected",
                    "all, none false",
                    all_seen,
                    text,
                    note,
                )
            )
    return entries


def conclude(results: Mapping[str, Result]) -> Conclusion:
    time, late, _ = two_step(2.0, LATE)
    _, well, _ = two_step(2.0, IN_TIME)
    overshoot = [-float(np.min(error[time > 0.004])) for error in (well, late)]
    text = f"{overshoot[1]:.1f} N beyond zero, in time {overshoot[0]:.1f} N"
    entries = [
        *_tables(results),
        *_goals(results),
        *_timing(results),
        statement(
            "Figure 4.14", "second step late", "overshoots", overshoot[1] > 1.5 * overshoot[0], text
        ),
    ]
    remarks = []
    for loop in ("nominal", "fitted"):
        found = results[f"calibrated-{loop}"]
        remarks.append(
            f"calibrated with the {loop} loop (K_p {LOOPS[loop]['kp']:g}, "
            f"K_i {LOOPS[loop]['ki']:g} 1/s): "
            f"F_c {found['friction']:.1f} N, threshold {found['setting spike_threshold']:.1f} N, "
            f"gradient {1e-3 * float(found['setting spike_gradient']):.2f} N a tick "
            f"over {found['setting spike_samples']:.0f} samples, "
            f"window {1e3 * float(found['setting crossing_time']):.0f} ms; "
            f"{found['detected']:.0f} of {found['reversals']:.0f} "
            f"reversals detected, {found['false']:.0f} false, "
            f"{1e3 * float(found['delay']):.0f} ms late"
        )
        for row in (
            "one-step 4",
            "two-step 4",
            "calibrated one-step",
            "calibrated two-step",
            "observer",
        ):
            text = (
                f"{loop} loop, {row}: e1 + e2 "
                f"{np.median(errors_of(results, loop, row)['total']):.2f} N, "
            )
            remarks.append(
                text + f"{_interval(_reduction(results, loop, row, 'total'))} less than without"
            )
    return Conclusion(entries, drawings(results), remarks)


STUDY = Study(
    "friction-compensation",
    "Friction compensation of the force loop",
    "4",
    ("Table 4.1", "Table 4.2", *span("Figure", "4.", 3, 17)),
    conclude,
    jobs,
)
