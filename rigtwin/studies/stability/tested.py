"""A vehicle on the rig as it runs: sampled, with cylinders, motor, filters and delays; plain, and
with what makes most vehicles testable."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from controllers import Settings
from controllers.settings import Compensator, PlateCompensator
from rigtwin.components import Carriage, RigPlant, Tyre
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Timing
from rigtwin.simulation.runner import without_limits
from rigtwin.studies.stability.compensated import (
    with_cylinder_delay,
    with_exact_plate,
    with_filters,
)
from rigtwin.studies.stability.sampled_loop import decay
from rigtwin.studies.stability.vehicle import QuarterCar

CARRIED = 0.9
"""Share of the body's weight that the spring carries at the start, so that it drops."""
FILTER, KP, KI = 1e-3, 1.0, 50.0
"""s, and the force loop's gains, of a compensated test: with the plate's delay gone, those of the
filters and of the force are what is left."""
LONGEST, CLOSE = 0.05, 1e-4
"""s: the longest delay of the cylinder that is looked at, and how closely."""
ANY_FORCE, ANY_VOLTAGE = 1e9, 1e7
"""N and V: of a motor that bears any vehicle."""


@dataclass(frozen=True)
class RigMargin:
    """plain, compensated: how fast the loop's slowest motion dies away, 1/s, below zero it grows;
    bears: s of delay of the structure cylinder that the compensator is not told of and with which
    the loop still is stable, None where it never is."""

    plain: float
    compensated: float
    bears: float | None


def rig_as(car: QuarterCar) -> Configuration:
    """The rig set up as a vehicle that is dropped.

    Parameters
    ----------
    car
        The vehicle.
    """
    preload = CARRIED * car.sprung_mass * Settings().gravity
    return Configuration(
        plant=RigPlant(
            carriage=Carriage(car.unsprung_mass),
            tyre=Tyre(car.tyre_stiffness, car.tyre_damping),
        ),
        controller=Settings(
            start=-preload / car.tyre_stiffness,
            sprung_mass=car.sprung_mass,
            suspension_stiffness=car.suspension_stiffness,
            suspension_damping=car.suspension_damping,
            preload=preload,
        ),
        timing=Timing(duration=10.0),
    )


def sized(configuration: Configuration) -> Configuration:
    """The same on a rig whose motor, amplifier and limits bear any vehicle."""
    plant, controller = configuration.plant, configuration.controller
    motor = plant.motor._replace(force_limit=ANY_FORCE, voltage_limit=ANY_VOLTAGE)
    return without_limits(
        configuration._replace(
            plant=plant._replace(motor=motor),
            controller=controller._replace(voltage_limit=ANY_VOLTAGE),
        )
    )


def set_for_compensation(
    configuration: Configuration, by: PlateCompensator = PlateCompensator.KALMAN_INVERSE
) -> Configuration:
    """The same with the settings of a compensated test: the plate's delay taken away by what is
    told of the cylinder as it is, short filters, a firm force loop, and the motor's friction
    observed and taken away, which a loop with the plate's delay does not bear."""
    short = with_filters(with_exact_plate(configuration), FILTER)
    controller = short.controller._replace(
        compensator=Compensator.OBSERVER,
        kp=KP,
        ki=KI,
        plate_compensator=by,
    )
    return short._replace(controller=controller)


def decay_plain(car: QuarterCar) -> float:
    """How fast the slowest motion dies away on the rig as it is, 1/s."""
    return decay(rig_as(car))


def decay_compensated(
    car: QuarterCar,
    untold: float = 0.0,
    by: PlateCompensator = PlateCompensator.KALMAN_INVERSE,
) -> float:
    """The same with the plate compensated. untold: s of delay of the cylinder that the compensator
    does not know."""
    return decay(with_cylinder_delay(set_for_compensation(rig_as(car), by), untold))


AS_RUN: Mapping[str, Callable[[QuarterCar], float]] = {
    "sampled": decay_plain,
    "compensated": decay_compensated,
}
"""Name of a model of the whole sampled loop → its decay."""


def judge_margin(
    car: QuarterCar, by: PlateCompensator = PlateCompensator.KALMAN_INVERSE
) -> RigMargin:
    """A vehicle on the rig as it runs.

    Parameters
    ----------
    car
        The vehicle.
    by
        The compensator of the plate's delay.

    Returns
    -------
    RigMargin
        Plain and compensated.
    """
    plain, compensated = decay_plain(car), decay_compensated(car, by=by)
    if compensated <= 0.0:
        return RigMargin(plain, compensated, None)
    low, high = 0.0, LONGEST
    while high - low > CLOSE:
        middle = 0.5 * (low + high)
        if decay_compensated(car, middle, by) > 0.0:
            low = middle
        else:
            high = middle
    return RigMargin(plain, compensated, low)
