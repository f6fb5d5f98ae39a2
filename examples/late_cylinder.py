"""From a test that trips to one that runs: a structure cylinder is late by what nobody knew, the
diagnosis of the test that tripped says so, and a compensator made from the corrected twin lets the
test run.

    python examples/late_cylinder.py [--video FOLDER]

The rig is a twin here, with 8 ms of delay that the nominal one does not have.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import rigtwin
from controllers.compensated import Compensated
from experiments.vehicles import VEHICLES
from rigtwin.studies.stability.compensated import plate_compensator

TEST, FILTERS = "motorcycle", 2e-3
VEHICLE = VEHICLES[TEST]
LATE = 8e-3
"""s; the diagnosis is not told."""
SETTINGS = {
    "controller": dict.fromkeys(("filter_position", "filter_velocity", "filter_force"), FILTERS)
}


def run_on_rig(controller: Compensated | None = None) -> rigtwin.Recording:
    """The motorcycle dropped on the rig whose cylinder is late."""
    return rigtwin.run(
        "suspension-rig",
        TEST,
        seed=1,
        settings=SETTINGS,
        effects={"delay@structure_cylinder": LATE},
        controller=controller,
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Prints what becomes of each step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--video", type=Path, metavar="FOLDER", help="films of both tests")
    parsed = parser.parse_args(arguments)

    twin = rigtwin.run("suspension-rig", TEST, seed=1, settings=SETTINGS)
    print(f"on the nominal twin: {twin.end}, {twin.time[-1]:.1f} s")
    first = run_on_rig()
    print(f"on the rig: {first.end}, {first.time[-1]:.1f} s")

    tyre, carriage = VEHICLE.tyre_stiffness, VEHICLE.unsprung_mass
    nominal = {"tyre": {"stiffness": tyre}, "carriage": {"mass": carriage}}
    answer = rigtwin.diagnose(first, settings=nominal)
    print(answer.sentence)

    corrected = answer.corrected
    law = plate_compensator(corrected.plant.structure_cylinder, corrected.timing.period)
    second = run_on_rig(Compensated(corrected.controller, corrected.timing.period, law))
    print(f"with its compensator: {second.end}, {second.time[-1]:.1f} s")
    if parsed.video:
        parsed.video.mkdir(parents=True, exist_ok=True)
        first.video(parsed.video / "trips.mp4")
        second.video(parsed.video / "runs.mp4")


if __name__ == "__main__":
    main()
