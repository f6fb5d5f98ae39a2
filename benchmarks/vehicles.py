"""The vehicles of thesis Table 6.1 on the rig, plain and compensated: how far each test is from the
ideal vehicle, and why: `python -m benchmarks.vehicles [--picture F.png]`.

The motor is as strong as the vehicle asks: the lab's bears 1860 N, less than the heavy ones weigh.
Everything else is the rig's. The ideal vehicle is on the ground as it moved.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

import rigtwin
from experiments import find
from experiments.vehicles import TABLE_6_2, VEHICLES, find_vehicle
from rigtwin.components import RigPlant
from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.ideal import simulate_ideal
from rigtwin.studies.stability.tested import configure_vehicle, set_for_compensation, sized

TESTS = ("drop", "road1.6", "road10")
SECONDS, SEED = 10.0, 1
GROUND, FORCE = 60.0, 30.0
"""Hz; up to which the ground's sensor is taken for its motion, and forces are compared."""


@dataclass(frozen=True)
class Errors:
    """position, force: standard deviation of the error over that of the ideal, not numbers where
    the test did not reach its end."""

    position: float
    force: float

    @property
    def text(self) -> str:
        """In %."""
        if not np.isfinite(self.position):
            return "ran away"
        return f"{100.0 * self.position:.1f} / {100.0 * self.force:.1f}"


def low_pass(signal: Array, frequency: float, period: float) -> Array:
    """Without a phase."""
    sos = butter(2, frequency, fs=1.0 / period, output="sos")
    return sosfiltfilt(sos, signal)


def silent(plant: RigPlant) -> RigPlant:
    """The rig with sensors that neither hum nor hiss."""
    names = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
    sensors = {name: getattr(plant, name)._replace(white=0.0, hum=0.0) for name in names}
    return plant._replace(**sensors)


def smooth_rail(plant: RigPlant) -> RigPlant:
    """The rig whose rail does not rub."""
    return plant._replace(rail=plant.rail._replace(coulomb=0.0))


def configure(vehicle: str, test: str) -> Configuration:
    """That vehicle in that test, on a rig that is strong enough."""
    base = find(test).configuration
    timing = base.timing._replace(duration=SECONDS)
    return sized(configure_vehicle(find_vehicle(vehicle)))._replace(road=base.road, timing=timing)


def run(configuration: Configuration, test: str, compensated: bool) -> Errors:
    """The errors of one test."""
    if compensated:
        configuration = set_for_compensation(configuration)
    experiment = replace(find(test), configuration=configuration)
    made = rigtwin.run("suspension-rig", experiment, seed=SEED)
    period = configuration.timing.period
    ideal = simulate_ideal(configuration, low_pass(made["/sensor.ground_lvdt"], GROUND, period))
    position = np.std(made["/sensor.structure_lvdt"] - ideal.structure) / np.std(ideal.structure)
    off = low_pass(made["/sensor.load_cell"] - ideal.force, FORCE, period)
    force = float(np.std(off) / np.std(ideal.force))
    if not position < 10.0:
        return Errors(np.nan, np.nan)
    return Errors(float(position), force)


def print_table() -> None:
    """A line a vehicle and test: plain, compensated, with silent sensors, without the rail's
    friction too. Position / force, %."""
    print("position / force, %: plain, compensated, and sensors silent, and rail smooth")
    for vehicle in (*VEHICLES, TABLE_6_2):
        for test in TESTS:
            own = configure(vehicle, test)
            quiet = own._replace(plant=silent(own.plant))
            clean = own._replace(plant=smooth_rail(quiet.plant))
            found = [
                run(own, test, False),
                *(run(each, test, True) for each in (own, quiet, clean)),
            ]
            print(f"{vehicle:12s} {test:8s}", *(f"{each.text:>15s}" for each in found), flush=True)


def draw_region(out: Path) -> None:
    """Where a body on a suspension is stable, plain and compensated, with the vehicles in it."""
    from matplotlib.figure import Figure

    from rigtwin.studies.stability.mapping import Axis, stability_map

    car = find_vehicle(TABLE_6_2)
    across = Axis("sprung_mass", np.logspace(0.7, 3.3, 27))
    up = Axis("suspension_stiffness", np.logspace(2.0, 5.5, 28))
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    for place, (model, title) in enumerate(
        (("sampled", "as it is"), ("compensated", "the plate's delay compensated")), start=1
    ):
        found = stability_map(model, car, 0.01, across, up)
        axes = figure.add_subplot(1, 2, place)
        axes.contourf(
            across.values,
            up.values,
            found.rightmost,
            [-1e9, 0.0, 1e9],
            colors=["#cfe8cf", "#f2d0cc"],
        )
        axes.contour(
            across.values, up.values, found.rightmost, [0.0], colors="black", linewidths=1.0
        )
        axes.plot(car.sprung_mass, car.suspension_stiffness, "ko", label="Table 6.2")
        axes.set(xscale="log", yscale="log", xlabel="sprung mass, kg", title=title)
        axes.set_ylabel("suspension stiffness, N/m")
        axes.legend(loc="upper left")
    figure.savefig(out, dpi=120)


def main() -> None:
    """Prints the table, or draws the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--picture", type=Path, metavar="F.png")
    parsed = parser.parse_args()
    if parsed.picture is None:
        print_table()
    else:
        draw_region(parsed.picture)


if __name__ == "__main__":
    main()
