"""A vehicle on the sampled rig with cylinders, motor, filters and delays.

The rig is studied as it is, and with the compensation that makes most vehicles testable.
"""

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
"""Share of the body's weight that the spring carries at the start; the body drops by the rest."""
FILTER, KP, KI = 1e-3, 1.0, 50.0
"""Time constant of the filters, in s, and gains of the force loop, of a compensated test. Without
the plate's delay, filters and force loop limit stability."""
LONGEST, CLOSE = 0.05, 1e-4
"""Longest delay of the cylinder that is tested, in s, and the accuracy of the limit, in s."""
ANY_FORCE, ANY_VOLTAGE = 1e9, 1e7
"""Limits of a motor that can carry any vehicle, in N and V."""


@dataclass(frozen=True)
class RigMargin:
    """Margin of stability of a vehicle on the sampled rig.

    Attributes
    ----------
    plain, compensated
        Rate of decay of the slowest mode, in 1/s, without and with compensation of the plate's
        delay. Negative if the mode grows.
    delay_margin
        Largest delay of the structure cylinder, in s, that is unknown to the compensator and with
        which the loop is still stable. None if the loop is never stable.
    """

    plain: float
    compensated: float
    delay_margin: float | None


def configure_vehicle(car: QuarterCar) -> Configuration:
    """Return the rig's settings for a vehicle that is dropped.

    Parameters
    ----------
    car
        The vehicle.
    """
    preload = CARRIED * car.sprung_mass * Settings().gravity
    return Configuration(
        plant=RigPlant(
            carriage=Carriage(car.unsprung_mass), tyre=Tyre(car.tyre_stiffness, car.tyre_damping)
        ),
        controller=Settings(
            # The wheel rests on a tyre compressed by the preload, so the plate starts that much
            # lower.
            start=-preload / car.tyre_stiffness,
            sprung_mass=car.sprung_mass,
            suspension_stiffness=car.suspension_stiffness,
            suspension_damping=car.suspension_damping,
            preload=preload,
        ),
        timing=Timing(duration=10.0),
    )


def sized(configuration: Configuration) -> Configuration:
    """Return the test on a rig whose motor, amplifier and limits suit any vehicle."""
    plant, controller = configuration.plant, configuration.controller
    motor = plant.motor._replace(force_limit=ANY_FORCE, voltage_limit=ANY_VOLTAGE)
    # Safety limits and saturation have no place in a linear study of stability.
    return without_limits(
        configuration._replace(
            plant=plant._replace(motor=motor),
            controller=controller._replace(voltage_limit=ANY_VOLTAGE),
        )
    )


def set_for_compensation(
    configuration: Configuration, compensator: PlateCompensator = PlateCompensator.KALMAN_INVERSE
) -> Configuration:
    """Return the test with the settings of a compensated test.

    The compensator knows the true cylinder. Filters are short and the force loop is stiff. The
    motor's friction is observed and compensated, which is unstable with the plate's delay.
    """
    short = with_filters(with_exact_plate(configuration), FILTER)
    controller = short.controller._replace(
        compensator=Compensator.OBSERVER, kp=KP, ki=KI, plate_compensator=compensator
    )
    return short._replace(controller=controller)


def decay_plain(car: QuarterCar) -> float:
    """Return the rate of decay of the slowest mode on the rig as it is, in 1/s."""
    return decay(configure_vehicle(car))


def decay_compensated(
    car: QuarterCar,
    unknown_delay: float = 0.0,
    compensator: PlateCompensator = PlateCompensator.KALMAN_INVERSE,
) -> float:
    """Return the rate of decay of the slowest mode with the plate compensated, in 1/s.

    Parameters
    ----------
    car
        The vehicle.
    unknown_delay
        Delay of the structure cylinder that the compensator does not know, in s.
    compensator
        Compensator of the plate's delay.
    """
    configuration = set_for_compensation(configure_vehicle(car), compensator)
    return decay(with_cylinder_delay(configuration, unknown_delay))


AS_RUN: Mapping[str, Callable[[QuarterCar], float]] = {
    "sampled": decay_plain,
    "compensated": decay_compensated,
}
"""Name of a model of the sampled loop → its rate of decay."""


def judge_margin(
    car: QuarterCar, compensator: PlateCompensator = PlateCompensator.KALMAN_INVERSE
) -> RigMargin:
    """Return the margins of stability of a vehicle on the sampled rig.

    Parameters
    ----------
    car
        The vehicle.
    compensator
        Compensator of the plate's delay.

    Returns
    -------
    RigMargin
        Rates of decay without and with compensation, and the delay margin.
    """
    plain, compensated = decay_plain(car), decay_compensated(car, compensator=compensator)
    if compensated <= 0.0:
        return RigMargin(plain, compensated, None)
    # Bisection: more unknown delay only destabilises.
    low, high = 0.0, LONGEST
    while high - low > CLOSE:
        middle = 0.5 * (low + high)
        if decay_compensated(car, middle, compensator) > 0.0:
            low = middle
        else:
            high = middle
    return RigMargin(plain, compensated, low)
