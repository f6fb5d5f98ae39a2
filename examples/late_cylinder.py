"""From a test that trips to one that runs.

The structure cylinder has an unknown delay, so its compensator compensates too little and the test
trips. The diagnosis of that test finds the delay, and the corrected twin sets the compensator.

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
HIDDEN_DELAY = {"delay@structure_cylinder": 8e-3}
"""True delay of the cylinder, s. Neither compensator nor diagnosis gets it."""


def run(effects: Mapping[str, float], corrected: Sequence[str | Path] = ()) -> rigtwin.Recording:
    """Run the motorcycle on a road; effects: of the rig, corrected: files of settings."""
    settings = [*corrected, ON_STIFFER_SPRINGS]
    return rigtwin.run("suspension-rig", TEST, seed=1, settings=settings, effects=effects)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the outcome of every step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--video", type=Path, metavar="FOLDER", help="films of both tests")
    parsed = parser.parse_args(arguments)

    twin = run({})
    print(f"on the nominal twin: {twin.end}, {twin.time[-1]:.1f} s")
    first = run(HIDDEN_DELAY)
    print(f"on the rig: {first.end}, {first.time[-1]:.1f} s")

    wheel = {
        "tyre": {"stiffness": VEHICLE.tyre_stiffness, "damping": 0.0},
        "carriage": {"mass": VEHICLE.unsprung_mass},
    }
    # Wheel and tyre of the emulated vehicle are real on this rig, so the diagnosis gets them.
    answer = rigtwin.diagnose(first, settings=wheel)
    print(answer.sentence)
    with tempfile.TemporaryDirectory() as folder:
        second = run(HIDDEN_DELAY, [answer.save_twin(Path(folder) / "found.toml")])
    print(f"with the compensator of the corrected twin: {second.end}, {second.time[-1]:.1f} s")
    if parsed.video:
        parsed.video.mkdir(parents=True, exist_ok=True)
        first.video(parsed.video / "trips.mp4")
        second.video(parsed.video / "runs.mp4")


if __name__ == "__main__":
    main()
