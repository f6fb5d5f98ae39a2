"""`rigtwin plot`: a recording as a picture."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.options import add_stretch
from rigtwin.console import apart

SUMMARY = "draw a recording: motions, force, wheel and voltage over time"
MORE = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    parser.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="F.png",
        help="png, svg or pdf (default: beside the recording)",
    )
    add_stretch(parser)


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    recording = rigtwin.load(parsed.recording)
    out = apart(parsed.out or parsed.recording.with_suffix(".png"), parsed.recording)
    print(f"drawn in {recording.plot(out, parsed.start, parsed.until)}")
    return 0
