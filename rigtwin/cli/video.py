"""`rigtwin video`: a recording as a film."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.options import add_machine, add_settings, add_stretch, settings_of
from rigtwin.console import tell_notes
from rigtwin.errors import RigtwinError

SUMMARY = "film a recording: the machine moving, its signals drawn beneath"
MORE = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    parser.add_argument(
        "--out", "-o", type=Path, metavar="F.mp4", help="default: beside the recording"
    )
    parser.add_argument(
        "--camera",
        help="camera of the model, or free; the rig has overview, side and wheel (default: first)",
    )
    parser.add_argument(
        "--magnify",
        type=float,
        default=1.0,
        metavar="X",
        help="draw motions X times as large (default 1)",
    )
    parser.add_argument(
        "--ghost",
        type=float,
        nargs="?",
        const=1.0,
        default=0.0,
        metavar="X",
        help="draw the twin's prediction through it, the gap X times as large (default 1)",
    )
    add_machine(parser)
    add_settings(parser)
    add_stretch(parser)


def execute(parsed: argparse.Namespace) -> int:
    from tqdm import tqdm

    import rigtwin

    # Changes of a twin that nobody sees would be a mistake left unsaid.
    if not parsed.ghost and (parsed.set or parsed.config):
        raise RigtwinError("--set and --config are of the twin that --ghost draws; add --ghost")
    recording = rigtwin.load(parsed.recording, parsed.machine)
    tell_notes(recording)
    out = parsed.out or parsed.recording.with_suffix(".mp4")
    with tqdm(unit="frame", disable=None, desc="filming", leave=False) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        recording.video(
            out,
            camera=parsed.camera,
            start=parsed.start,
            until=parsed.until,
            magnify=parsed.magnify,
            ghost=parsed.ghost,
            settings=settings_of(parsed),
            progress=progress,
        )
    print(f"filmed in {out}")
    return 0
