"""The vehicles of thesis Table 6.1, dropped on the rig as it is. All are unstable with its delays
(thesis §6.2); the heavy ones exceed the motor's force at once and trip."""

from __future__ import annotations

from typing import NamedTuple

from controllers import Settings
from experiments.experiment import flat_ground
from rigtwin.components import Carriage, Tyre
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.simulation.experiment import Experiment
from rigtwin.studies.stability.tested import rig_as
from rigtwin.studies.stability.vehicle import QuarterCar

TABLE_6_2 = "quarter-car"
"""The name of the vehicle of thesis Table 6.2."""


class Vehicle(NamedTuple):
    """A quarter car: tyre stiffness N/m, unsprung mass kg, suspension stiffness N/m and damping
    Ns/m, sprung mass kg."""

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
"""Thesis Table 6.1."""


def configuration(vehicle: Vehicle) -> Configuration:
    """The rig set up as that vehicle, its spring carrying 90 % of the static load at the start so
    that the body drops."""
    return rig_as(QuarterCar(tyre_damping=0.0, **vehicle._asdict()))


EXPERIMENTS = tuple(
    Experiment(
        name,
        f"{name} dropped: unstable on this rig",
        "thesis Table 6.1",
        configuration(vehicle),
        flat_ground,
    )
    for name, vehicle in VEHICLES.items()
)


def find_vehicle(name: str) -> QuarterCar:
    """A vehicle as a linear quarter car.

    Parameters
    ----------
    name
        Of thesis Table 6.1, or `quarter-car` for that of Table 6.2.

    Raises
    ------
    RigtwinError
        With what there is.
    """
    tyre, settings = Tyre(), Settings()
    found = {
        TABLE_6_2: QuarterCar(
            tyre.stiffness,
            tyre.damping,
            Carriage().mass,
            settings.suspension_stiffness,
            settings.suspension_damping,
            settings.sprung_mass,
        )
    }
    for each, vehicle in VEHICLES.items():
        found[each] = QuarterCar(tyre_damping=0.0, **vehicle._asdict())
    if name not in found:
        raise RigtwinError(f"unknown vehicle {name!r}; there are {', '.join(found)}")
    return found[name]
