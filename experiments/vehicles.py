"""The vehicles of thesis Table 6.1, dropped and on a road.

Each test exists plain and with the delay of the plate compensated. Without compensation all
vehicles are unstable with the rig's delays (thesis §6.2). The heavy ones exceed the motor's force
at once, and trip with or without compensation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from controllers import Settings
from experiments import quarter_car
from experiments.experiment import flat_ground, road_ground
from experiments.quarter_car import ROAD_10
from rigtwin.components import Carriage, Tyre
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.simulation.experiment import Experiment
from rigtwin.studies.stability.tested import configure_vehicle, set_for_compensation
from rigtwin.studies.stability.vehicle import QuarterCar

TABLE_6_2 = "quarter-car"
"""Name of the vehicle of thesis Table 6.2."""


class Vehicle(NamedTuple):
    """Quarter car of thesis Table 6.1.

    Attributes
    ----------
    tyre_stiffness : float
        Stiffness of the tyre, N/m. The table gives no tyre damping.
    unsprung_mass : float
        Mass of wheel and axle, kg.
    suspension_stiffness, suspension_damping : float
        Stiffness, N/m, and damping, Ns/m, of the suspension.
    sprung_mass : float
        Mass of the body, kg.
    """

    tyre_stiffness: float
    unsprung_mass: float
    suspension_stiffness: float
    suspension_damping: float
    sprung_mass: float


VEHICLES = {
    "boeing-707": Vehicle(8_461_000.0, 1140.0, 11_250_000.0, 105_400.0, 68_210.0),
    "truck": Vehicle(500_000.0, 420.0, 1_950_000.0, 94_300.0, 4450.0),
    "car": Vehicle(250_000.0, 400.0, 20_000.0, 1300.0, 400.0),
    "motorcycle": Vehicle(180_000.0, 25.0, 7600.0, 750.0, 72.5),
}
"""Vehicles of thesis Table 6.1 by name."""


def configuration(vehicle: Vehicle) -> Configuration:
    """Return the configuration of the rig that emulates a vehicle.

    At the start the spring carries 90 % of the static load, so the body drops.
    """
    return configure_vehicle(QuarterCar(tyre_damping=0.0, **vehicle._asdict()))


COMPENSATED = "-compensated"
"""Suffix of the name of a test in which the delay of the plate is compensated."""


def _tests() -> Iterator[Experiment]:
    """Yield the uncompensated tests: every vehicle of Table 6.1, then that of Table 6.2."""
    for name, vehicle in VEHICLES.items():
        dropped = configuration(vehicle)
        yield Experiment(
            name, f"{name} dropped: unstable on this rig", "thesis Table 6.1", dropped, flat_ground
        )
        yield Experiment(
            f"{name}-road10",
            f"{name}, motorway at 15 km/h, 0.01-10 Hz: unstable on this rig",
            "thesis Table 6.1, §6.3.3",
            dropped._replace(road=ROAD_10, timing=dropped.timing._replace(duration=15.0)),
            road_ground,
        )
    for experiment in quarter_car.EXPERIMENTS:
        if experiment.name in ("drop", "road1.6", "road10"):
            yield experiment


def _compensated(plain: Experiment) -> Experiment:
    """Return a test with the delay of the plate compensated."""
    # The remark on stability holds for the plain test alone.
    summary = plain.summary.removesuffix(": unstable on this rig")
    return replace(
        plain,
        name=plain.name + COMPENSATED,
        summary=f"{summary}, the plate's delay compensated",
        configuration=set_for_compensation(plain.configuration),
    )


# The tests of Table 6.2 stand in `quarter_car` already; only their compensated forms are added.
EXPERIMENTS = tuple(
    test
    for plain in _tests()
    for test in (plain, _compensated(plain))
    if test not in quarter_car.EXPERIMENTS
)


def find_vehicle(name: str) -> QuarterCar:
    """Return a vehicle as a linear quarter car.

    Parameters
    ----------
    name : str
        Name of a vehicle of thesis Table 6.1, or `quarter-car` for the one of Table 6.2.

    Returns
    -------
    QuarterCar
        Linear quarter car. The vehicles of Table 6.1 have no tyre damping.

    Raises
    ------
    RigtwinError
        If no vehicle has this name. The message lists the names.
    """
    tyre, settings = Tyre(), Settings()
    cars = {
        TABLE_6_2: QuarterCar(
            tyre.stiffness,
            tyre.damping,
            Carriage().mass,
            settings.suspension_stiffness,
            settings.suspension_damping,
            settings.sprung_mass,
        )
    }
    # Table 6.1 has no tyre damping, as in `configuration`.
    for vehicle_name, vehicle in VEHICLES.items():
        cars[vehicle_name] = QuarterCar(tyre_damping=0.0, **vehicle._asdict())
    if name not in cars:
        raise RigtwinError(f"unknown vehicle {name!r}; there are {', '.join(cars)}")
    return cars[name]
