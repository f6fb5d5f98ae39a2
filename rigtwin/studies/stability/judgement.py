"""Stability of a vehicle on the rig, by every model of its loop."""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.studies.stability.critical import critical_delay, critical_lag
from rigtwin.studies.stability.delayed import rightmost_delay_root
from rigtwin.studies.stability.loop import LOOPS
from rigtwin.studies.stability.models import MODELS, rightmost
from rigtwin.studies.stability.vehicle import QuarterCar

ROUNDING = 1e-12
"""Relative real part, in shares of the pole's magnitude, that counts as zero."""


@dataclass(frozen=True)
class ModelStability:
    """Stability by one model.

    Attributes
    ----------
    real, imaginary
        Rightmost pole, in 1/s.
    stable
        Whether the rightmost pole lies in the left half plane.
    critical_lag, critical_delay
        Lag and delay at which the loop begins to oscillate, in s; None if it never does.
    critical_lag_frequency, critical_delay_frequency
        Frequencies of these oscillations, in rad/s; None if there are none.
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
    """Stability of a vehicle on the rig by all models.

    Attributes
    ----------
    vehicle
        The vehicle under test.
    tau
        Lag or delay of every path, in s.
    delay
        Whether the poles belong to pure delays instead of first-order lags.
    models
        Name of the model → its result.
    """

    vehicle: QuarterCar
    tau: float
    delay: bool
    models: dict[str, ModelStability]


def judge(vehicle: QuarterCar, tau: float, delay: bool) -> Stability:
    """Return the poles, the critical lag and the critical delay of a vehicle by every model.

    Parameters
    ----------
    vehicle
        Vehicle of plausible size, so that rounding does not decide the sign of a pole.
    tau
        Lag of every path, in s.
    delay
        Whether the poles are computed with pure delays instead of lags.

    Returns
    -------
    Stability
        Results of all models.
    """
    models = {}
    for name, model in MODELS.items():
        loop = LOOPS[name](vehicle)
        # With delays there is no finite set of poles, so the rightmost root is searched for.
        pole = rightmost_delay_root(loop, tau) if delay else rightmost(model(vehicle, tau))
        # Both tolerances of the loop are reported, whichever of lags and delays is asked about.
        lag, pure = critical_lag(loop), critical_delay(loop)
        models[name] = ModelStability(
            real=pole.real,
            imaginary=abs(pole.imag),
            # A pole on the axis within rounding counts as unstable, which is the safe side.
            stable=pole.real < -ROUNDING * abs(pole),
            critical_lag=lag.time if lag else None,
            critical_lag_frequency=lag.frequency if lag else None,
            critical_delay=pure.time if pure else None,
            critical_delay_frequency=pure.frequency if pure else None,
        )
    return Stability(vehicle, tau, delay, models)
