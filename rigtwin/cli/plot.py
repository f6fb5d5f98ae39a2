"""`rigtwin plot`: a recording as a picture."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.options import add_stretch
from rigtwin.console import tell_notes

SUMMARY = "draw a recording: motions, force, wheel and voltage over time"
MORE = """\
examples:
  rigtwin plot road.mcap -o road.png --from 5 --until 10
  rigtwin plot road.mcap -o figure.pdf --style paper --panel wheel --panel "suspension force\""""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    parser.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="F.png",
        help="png, svg or pdf (default: beside the recording)",
    )
    parser.add_argument(
        "--style",
        default="screen",
        metavar="STYLE",
        help="screen, paper (a column of a journal, 3.5 in) or paper-wide (two, 7.16 in)",
    )
    parser.add_argument(
        "--panel",
        action="append",
        default=[],
        metavar="NAME",
        help="draw only panels whose title begins with NAME; may be repeated",
    )
    add_stretch(parser)


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    recording = rigtwin.load(parsed.recording)
    tell_notes(recording)
    out = parsed.out or parsed.recording.with_suffix(".png")
    drawn = recording.plot(out, parsed.start, parsed.until, style=parsed.style, panels=parsed.panel)
    print(f"drawn in {drawn}")
    return 0
