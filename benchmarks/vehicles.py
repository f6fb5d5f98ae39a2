"""Errors of the vehicles of thesis Table 6.1 on the rig, plain and compensated, and their causes.

python -m benchmarks.vehicles [--picture F.png]

The motor is as strong as a vehicle requires: the lab's motor has 1860 N, less than the heavy ones
weigh. Everything else is the rig's. The ideal vehicle drives over the measured ground motion.
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
"""Cut-off frequencies of the measured ground motion and of the compared forces, Hz."""


@dataclass(frozen=True)
class Errors:
    """Errors of a test relative to the ideal vehicle.

    Attributes
    ----------
    position, force : float
        Standard deviation of the error over that of the ideal. NaN if the test diverged.
    """

    position: float
    force: float

    @property
    def text(self) -> str:
        """Errors in %, as text."""
        if not np.isfinite(self.position):
            return "diverged"
        return f"{100.0 * self.position:.1f} / {100.0 * self.force:.1f}"


def low_pass(signal: Array, frequency: float, period: float) -> Array:
    """Return a signal after a low pass without phase lag; frequency: Hz, period: s."""
    sos = butter(2, frequency, fs=1.0 / period, output="sos")
    return sosfiltfilt(sos, signal)


def silent(plant: RigPlant) -> RigPlant:
    """Return the rig with noiseless sensors."""
    names = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
    sensors = {name: getattr(plant, name)._replace(white=0.0, hum=0.0) for name in names}
    return plant._replace(**sensors)


def smooth_rail(plant: RigPlant) -> RigPlant:
    """Return the rig without friction of the rail."""
    return plant._replace(rail=plant.rail._replace(coulomb=0.0))


def configure(vehicle: str, test: str) -> Configuration:
    """Return the configuration of a vehicle in a test, on a rig with a strong enough motor."""
    base = find(test).configuration
    timing = base.timing._replace(duration=SECONDS)
    return sized(configure_vehicle(find_vehicle(vehicle)))._replace(road=base.road, timing=timing)


def run(configuration: Configuration, test: str, compensated: bool) -> Errors:
    """Run one test and return its errors."""
    if compensated:
        configuration = set_for_compensation(configuration)
    experiment = replace(find(test), configuration=configuration)
    recording = rigtwin.run("suspension-rig", experiment, seed=SEED)
    period = configuration.timing.period
    ideal = simulate_ideal(
        configuration, low_pass(recording["/sensor.ground_lvdt"], GROUND, period)
    )
    position = np.std(recording["/sensor.structure_lvdt"] - ideal.structure) / np.std(
        ideal.structure
    )
    force_error = low_pass(recording["/sensor.load_cell"] - ideal.force, FORCE, period)
    force = float(np.std(force_error) / np.std(ideal.force))
    # A diverged or tripped test has no meaningful error; NaN is caught as well.
    if not position < 10.0:
        return Errors(np.nan, np.nan)
    return Errors(float(position), force)


def print_table() -> None:
    """Print the errors of position / force, %, one line per vehicle and test.

    The columns are plain, compensated, with noiseless sensors, and without rail friction as well.
    """
    print("position / force, %: plain, compensated, and sensors silent, and rail smooth")
    for vehicle in (*VEHICLES, TABLE_6_2):
        for test in TESTS:
            nominal = configure(vehicle, test)
            quiet = nominal._replace(plant=silent(nominal.plant))
            clean = nominal._replace(plant=smooth_rail(quiet.plant))
            errors = [
                run(nominal, test, False),
                *(run(setup, test, True) for setup in (nominal, quiet, clean)),
            ]
            print(
                f"{vehicle:12s} {test:8s}", *(f"{error.text:>15s}" for error in errors), flush=True
            )


def draw_region(out: Path) -> None:
    """Draw the stability region over sprung mass and stiffness, plain and compensated."""
    from matplotlib.figure import Figure

    from rigtwin.studies.stability.mapping import Axis, stability_map

    car = find_vehicle(TABLE_6_2)
    across = Axis("sprung_mass", np.logspace(0.7, 3.3, 27))
    up = Axis("suspension_stiffness", np.logspace(2.0, 5.5, 28))
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    for column, (model, title) in enumerate(
        (("sampled", "as it is"), ("compensated", "the plate's delay compensated")), start=1
    ):
        region = stability_map(model, car, 0.01, across, up)
        axes = figure.add_subplot(1, 2, column)
        axes.contourf(
            across.values,
            up.values,
            region.rightmost,
            [-1e9, 0.0, 1e9],
            colors=["#cfe8cf", "#f2d0cc"],
        )
        axes.contour(
            across.values, up.values, region.rightmost, [0.0], colors="black", linewidths=1.0
        )
        axes.plot(car.sprung_mass, car.suspension_stiffness, "ko", label="Table 6.2")
        axes.set(xscale="log", yscale="log", xlabel="sprung mass, kg", title=title)
        axes.set_ylabel("suspension stiffness, N/m")
        axes.legend(loc="upper left")
    figure.savefig(out, dpi=120)


def main() -> None:
    """Print the table, or draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--picture", type=Path, metavar="F.png")
    parsed = parser.parse_args()
    if parsed.picture is None:
        print_table()
    else:
        draw_region(parsed.picture)


if __name__ == "__main__":
    main()
