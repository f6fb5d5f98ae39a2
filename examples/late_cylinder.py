"""From a test that trips to one that runs: a structure cylinder is late by what nobody knew, and
the compensator of its delay is told too little. The diagnosis of the test that tripped says so, and
the corrected twin tells the compensator.

    python examples/late_cylinder.py [--video FOLDER]

The rig is a twin here, with 8 ms of delay that the nominal one does not have.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import rigtwin
from experiments.vehicles import VEHICLES

TEST, VEHICLE = "motorcycle-road10-compensated", VEHICLES["motorcycle"]
ON_STIFFER_SPRINGS = {"controller": {"suspension_stiffness": 20e3, "suspension_damping": 100.0}}
LATE = {"delay@structure_cylinder": 8e-3}
"""s; neither the compensator nor the diagnosis is told."""


def run(effects: Mapping[str, float], corrected: Sequence[str | Path] = ()) -> rigtwin.Recording:
    """The motorcycle on a road. effects: of the rig; corrected: files of settings."""
    settings = [*corrected, ON_STIFFER_SPRINGS]
    return rigtwin.run("suspension-rig", TEST, seed=1, settings=settings, effects=effects)


def main(arguments: Sequence[str] | None = None) -> None:
    """Prints what becomes of each step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--video", type=Path, metavar="FOLDER", help="films of both tests")
    parsed = parser.parse_args(arguments)

    twin = run({})
    print(f"on the nominal twin: {twin.end}, {twin.time[-1]:.1f} s")
    first = run(LATE)
    print(f"on the rig: {first.end}, {first.time[-1]:.1f} s")

    wheel = {
        "tyre": {"stiffness": VEHICLE.tyre_stiffness, "damping": 0.0},
        "carriage": {"mass": VEHICLE.unsprung_mass},
    }
    answer = rigtwin.diagnose(first, settings=wheel)
    print(answer.sentence)
    with tempfile.TemporaryDirectory() as folder:
        second = run(LATE, [answer.save_twin(Path(folder) / "found.toml")])
    print(f"with the compensator of the corrected twin: {second.end}, {second.time[-1]:.1f} s")
    if parsed.video:
        parsed.video.mkdir(parents=True, exist_ok=True)
        first.video(parsed.video / "trips.mp4")
        second.video(parsed.video / "runs.mp4")


if __name__ == "__main__":
    main()
