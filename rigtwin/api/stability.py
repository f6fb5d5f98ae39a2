"""Stability of a vehicle on the rig."""

from __future__ import annotations

from collections.abc import Mapping

from controllers import PlateCompensator
from experiments.vehicles import find_vehicle
from rigtwin.errors import RigtwinError
from rigtwin.studies.stability.judgement import ModelStability as ModelStability
from rigtwin.studies.stability.judgement import Stability, judge
from rigtwin.studies.stability.tested import RigMargin as RigMargin
from rigtwin.studies.stability.tested import judge_margin
from rigtwin.studies.stability.vehicle import QuarterCar, check_plausible, check_time


def stability(
    vehicle: str | QuarterCar = "quarter-car",
    *,
    changes: Mapping[str, float] | None = None,
    tau: float = 0.01,
    delay: bool = False,
) -> Stability:
    """Judge whether a vehicle is stable on the rig with lags, and which lags it tolerates.

    Parameters
    ----------
    vehicle
        Name, such as "truck", or a `QuarterCar`. Defaults to the vehicle of thesis Table 6.2.
    changes
        Changed parameters of the vehicle in SI units, such as {"suspension_damping": 500}.
    tau
        Time constant of the lag in every path, in s, 0.01 by default.
    delay
        Whether to compute the rightmost pole with pure delays of `tau` in place of lags.

    Returns
    -------
    Stability
        `models`, model → `ModelStability`: rightmost pole in 1/s, and critical lag and delay in s.

    Raises
    ------
    RigtwinError
        For an unknown vehicle or parameter, or values for which no pole can be computed.
    """
    car = _car(vehicle)
    for name, value in {**(changes or {}), "tau": tau}.items():
        # Python counts True as 1, which would pass for a parameter.
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RigtwinError(f"{name} = {value!r:.60}: expected a number")
    for name in changes or {}:
        if name not in QuarterCar._fields:
            known = ", ".join(QuarterCar._fields)
            raise RigtwinError(f"unknown parameter {name!r} of a vehicle; there are {known}")
    # Checked after the changes, which may leave the plausible range as well.
    car = check_plausible(car._replace(**(changes or {})))
    return judge(car, check_time("tau", tau), delay)


def _car(vehicle: str | QuarterCar) -> QuarterCar:
    """Return a vehicle's parameters. Raises RigtwinError for an unknown vehicle."""
    car = find_vehicle(vehicle) if isinstance(vehicle, str) else vehicle
    if not isinstance(car, QuarterCar):
        raise RigtwinError(f"vehicle {car!r:.60}: expected a name, or a QuarterCar")
    return car


def rig_margin(
    vehicle: str | QuarterCar = "quarter-car", *, compensator: str = "kalman-inverse"
) -> RigMargin:
    """Judge the stability margin of a vehicle on the rig with its real sampled loop.

    Parameters
    ----------
    vehicle
        Name, such as "truck", or a `QuarterCar`.
    compensator
        Name of the plate's delay compensator, a value of the setting
        `controller.plate_compensator`.

    Returns
    -------
    RigMargin
        Real part of the slowest pole in 1/s, without and with compensation, and the additional
        delay in s at which the compensated loop becomes unstable.

    Raises
    ------
    RigtwinError
        For an unknown vehicle or compensator, or values for which no pole can be computed.
    """
    try:
        parsed = PlateCompensator.parse(compensator)
    except ValueError as error:
        raise RigtwinError(f"compensator {error}") from None
    return judge_margin(check_plausible(_car(vehicle)), parsed)
