"""Settings of the thesis' friction compensator, identified from the friction spikes of a recording
(§4.5).

A recording made without compensation shows how far the force jumps when the motor reverses, how the
force error rises afterwards, and how early the filtered velocity indicates the reversal. The force
error is split into the part that friction causes through the known force loop and the remainder.
The compensator is then simulated on the recording, with its steps closed through that loop. The
identified settings minimise the force error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controllers import Compensator, Settings
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.studies.friction_loop import ForceTest, close_loop, filter_lag
from rigtwin.studies.reversals import (
    average_rises,
    list_complete_reversals,
    list_directions,
    measure_jumps,
)

WINDOW = 0.02
"""Time before and after a reversal over which the friction is averaged, in s."""
REQUIRED = (
    ("/command", "force"),
    ("/command", "voltage"),
    ("/sensor", "suspension_lvdt"),
    ("/sensor", "load_cell"),
)
# Ranges that the search covers, each in the setting's unit. The upper bound of the integer setting
# spike_samples lies just below 6, because its fraction is cut off.
BOUNDS = {
    "spike_threshold": (1.0, 12.0),
    "spike_gradient": (50.0, 4000.0),
    "spike_samples": (1.0, 5.99),
    "crossing_time": (0.01, 0.15),
    "crossing_extension": (0.0, 0.05),
    "filter_acceleration": (0.002, 0.05),
}


@dataclass(frozen=True)
class Calibration:
    """Identified settings, and the performance of the detector on the recording.

    Attributes
    ----------
    settings
        Identified settings of the controller.
    friction
        Coulomb force of the motor, in N.
    envelope
        Mean force error after a reversal, positive in the new direction, in N; one value per tick
        for twice `WINDOW`.
    reversals
        Number of measured reversals.
    detected
        Number of reversals the compensator detected.
    false
        Number of steps without a reversal.
    delay
        Median time from reversal to detection, in s; NaN without detections.
    """

    settings: Settings
    friction: float
    envelope: Array
    reversals: int
    detected: int
    false: int
    delay: float

    def toml(self) -> str:
        """Return the settings as TOML text, for the option `--config`."""
        names = ("friction_step", *BOUNDS)
        values = [f"{name} = {float(getattr(self.settings, name)):.6g}" for name in names]
        compensator = f'compensator = "{Compensator.TWO_STEP.label}"'
        return "\n".join(["[controller]", compensator, *values]) + "\n"


def find_compensator(recording: RecordedTest, settings: Settings) -> Calibration:
    """Identify the compensator's settings from a recording made without compensation.

    Parameters
    ----------
    recording
        Recording made without compensation.
    settings
        Settings of the controller that made the recording.

    Returns
    -------
    Calibration
        Settings with the least force error, and the detector's performance with them.

    Raises
    ------
    RigtwinError
        If the recording was made with compensation, has values that are not finite, has too few
        reversals, or its force does not jump at them.
    """
    _check_recording(recording, settings)
    period = recording.period
    window = round(WINDOW / period)
    turns, directions, crowded = list_complete_reversals(recording, window)
    ticks, coulomb = measure_jumps(recording, turns, directions, window)
    cell = recording.column("/sensor", "load_cell")
    errors = recording.column("/command", "force") - filter_lag(cell, settings.filter_force, period)
    envelope = average_rises(errors, ticks, directions, window)
    friction = coulomb * list_directions(recording.ticks, ticks, directions, crowded)
    # A reversal turns friction from -F to +F, so the compensating step is 2 F.
    base = settings._replace(compensator=Compensator.ONE_STEP, friction_step=2 * coulomb)
    travels = recording.column("/sensor", "suspension_lvdt")
    test = ForceTest(travels, np.zeros(recording.ticks), friction, period)
    # `due` is the error that friction causes through the known loop; the measured error less that
    # part belongs to all other causes, and is assumed to be unchanged by compensation.
    due, steps = np.empty(recording.ticks), np.empty(recording.ticks)
    close_loop(base, False, test, due, steps)
    test = test._replace(rest=errors - due)

    best = _search_settings(base, test)
    close_loop(best, True, test, due, steps)
    # The search minimises the force error alone; detections and false steps only describe the
    # result.
    delays, false = _match_steps(steps, ticks, directions, len(envelope), crowded)
    delay = float(np.median(delays)) * period if delays else float("nan")
    return Calibration(
        settings=best,
        friction=coulomb,
        envelope=envelope,
        reversals=len(ticks),
        detected=len(delays),
        false=false,
        delay=delay,
    )


def _search_settings(base: Settings, test: ForceTest) -> Settings:
    """Return the settings within BOUNDS whose compensator leaves the least force error."""
    # scipy.optimize is imported here because it takes long to load.
    from scipy.optimize import differential_evolution

    due, steps = np.empty(len(test.travels)), np.empty(len(test.travels))

    def set_values(values: Array) -> Settings:
        changed = base._replace(**dict(zip(BOUNDS, values.tolist(), strict=True)))
        return changed._replace(spike_samples=float(int(changed.spike_samples)))

    def mean_square_error(values: Array) -> float:
        return float(close_loop(set_values(values), True, test, due, steps))

    # The detector's thresholds make the error piecewise constant in places, so the search must not
    # need gradients, and no polishing step follows it.
    optimum = differential_evolution(
        mean_square_error,
        list(BOUNDS.values()),
        popsize=8,
        maxiter=25,
        tol=1e-3,
        polish=False,
        rng=np.random.default_rng(0),
    )
    return set_values(np.asarray(optimum.x))


def _check_recording(recording: RecordedTest, settings: Settings) -> None:
    """Raise RigtwinError unless the recording was made uncompensated and is finite."""
    if settings.compensator != Compensator.NONE:
        state = f"recorded with compensator {settings.compensator.label!r}; expected 'none'"
        raise RigtwinError(f"{recording.path}: {state}")
    for topic, name in REQUIRED:
        if not np.isfinite(recording.column(topic, name)).all():
            raise RigtwinError(
                f"{recording.path}: {topic}.{name} has values that are not finite; "
                "expected finite numbers at every tick"
            )


def _match_steps(
    steps: Array, turns: NDArray[np.intp], directions: Array, within: int, crowded: NDArray[np.intp]
) -> tuple[list[int], int]:
    """Return the ticks from each detected reversal to its detection, and the number of false steps.

    A step near a crowded reversal counts as neither.
    """
    made = np.flatnonzero(steps)
    used, delays = np.zeros(len(made), bool), []
    for turn, way in zip(turns, directions, strict=True):
        # The reversal's own tick is uncertain by a few ticks, so a slightly early step counts.
        first, last = np.searchsorted(made, [turn - 3, turn + within])
        hits = [number for number in range(first, last) if steps[made[number]] == way]
        if hits:
            used[hits[0]] = True
            delays.append(max(int(made[hits[0]] - turn), 0))
    wrong = made[~used]
    # Both searches find the same place exactly if no crowded reversal lies in between.
    near = np.searchsorted(crowded, wrong - within) != np.searchsorted(crowded, wrong + within)
    return delays, int(np.sum(~near))
