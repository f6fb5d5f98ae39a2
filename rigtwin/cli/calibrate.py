"""`rigtwin calibrate`: the friction compensator's settings from a recording."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.console import writable
from rigtwin.files import atomic_write

SUMMARY = "find the friction compensator's settings from a recording"
MORE = """\
The recording must be made without compensation and reverse often, such as friction-road.

example:
  rigtwin calibrate friction.mcap -o compensator.toml
  rigtwin run friction-road --config compensator.toml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    parser.add_argument(
        "--out", "-o", type=Path, metavar="F.toml", help="where to write them (default: print)"
    )


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    recording = rigtwin.load(parsed.recording)
    # Checked before the work, which would be lost otherwise.
    if parsed.out is not None:
        writable(parsed.out)
    for note in recording.notes:
        print(f"note: {note}")
    calibration = rigtwin.calibrate(recording)
    print(
        f"{recording.path}: Coulomb friction of the motor {calibration.friction:.1f} N, "
        f"from {calibration.reversals} reversals"
    )
    print(
        f"tried on the recording: {calibration.detected} of {calibration.reversals} reversals "
        f"detected, "
        f"{calibration.false} false steps, {1e3 * calibration.delay:.0f} ms after the reversal"
    )
    if parsed.out is None:
        print(calibration.toml(), end="")
    else:
        atomic_write(parsed.out, calibration.toml())
        print(f"settings in {parsed.out}, for --config")
    return 0
