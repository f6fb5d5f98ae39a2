"""Size of a gap, before and after the correction."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """A value and the ends of its interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Level:
    """Size of a gap before and after the correction, and the floor that noise alone leaves."""

    before: float
    after: float
    floor: float


@dataclass(frozen=True)
class Gap:
    """Difference between twin and machine before and after the correction.

    Attributes
    ----------
    before, after
        Rms over all sensors of measured minus predicted, in units of the sensors' white noise.
    floor
        The same rms for a perfect twin.
    shrinkage_predicted
        Share of the gap above the floor that the correction closes on the data of the fit.
    shrinkage_held_out
        Share that the correction closes on data held out of the fit, with a bootstrap interval.
    held_out
        Description of the held-out data.
    replays
        Component → gap of the component driven alone by recorded signals.
    closed_loop
        Difference in dB between the spectra of the recording and of the twin's own closed-loop run.
        The spectra hold no phase, so the phase of a limit cycle does not matter. None where the
        machine has no closed loop to run.
    """

    before: float
    after: float
    floor: float
    shrinkage_predicted: float
    shrinkage_held_out: Interval
    held_out: str
    replays: dict[str, Level]
    closed_loop: Level | None
