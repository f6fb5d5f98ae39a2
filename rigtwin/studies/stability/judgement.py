"""Whether a vehicle is stable on the rig, by every model of its loop."""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.studies.stability.critical import critical_delay, critical_lag
from rigtwin.studies.stability.delayed import rightmost_delay_root
from rigtwin.studies.stability.loop import LOOPS
from rigtwin.studies.stability.models import MODELS, rightmost
from rigtwin.studies.stability.vehicle import QuarterCar

ROUNDING = 1e-12
"""Of a pole's distance from the origin: a real part within this is none."""


@dataclass(frozen=True)
class ModelStability:
    """What one model says.

    real, imaginary: of the rightmost pole, 1/s; critical_lag, critical_delay: s at which the loop
    begins to swing, and at how many rad/s; None where none does.
    """

    real: float
    imaginary: float
    stable: bool
    critical_lag: float | None
    critical_lag_frequency: float | None
    critical_delay: float | None
    critical_delay_frequency: float | None


@dataclass(frozen=True)
class Stability:
    """A vehicle on the rig.

    tau: s, of every path; delay: whether poles are with pure delays instead of lags; models: name →
    what it says.
    """

    vehicle: QuarterCar
    tau: float
    delay: bool
    models: dict[str, ModelStability]


def judge(vehicle: QuarterCar, tau: float, delay: bool) -> Stability:
    """The poles and the critical lag and delay of every model of a vehicle.

    Parameters
    ----------
    vehicle
        Of a size at which its poles can be told from rounding.
    tau
        s, lag of every path.
    delay
        Whether poles are with pure delays instead.

    Returns
    -------
    Stability
        By every model.
    """
    found = {}
    for name, model in MODELS.items():
        loop = LOOPS[name](vehicle)
        pole = rightmost_delay_root(loop, tau) if delay else rightmost(model(vehicle, tau))
        lag, pure = critical_lag(loop), critical_delay(loop)
        found[name] = ModelStability(
            real=pole.real,
            imaginary=abs(pole.imag),
            stable=pole.real < -ROUNDING * abs(pole),
            critical_lag=lag.time if lag else None,
            critical_lag_frequency=lag.frequency if lag else None,
            critical_delay=pure.time if pure else None,
            critical_delay_frequency=pure.frequency if pure else None,
        )
    return Stability(vehicle, tau, delay, found)
