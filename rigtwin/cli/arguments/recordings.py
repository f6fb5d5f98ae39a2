"""The commands that take recordings as they are."""

from __future__ import annotations

from pathlib import Path

from rigtwin.cli.arguments.shared import Command, stretch


def add(command: Command) -> None:
    info = command("info", "say what is in a recording")
    info.add_argument("recording", type=Path)

    plot = command("plot", "draw a recording: motions, force, wheel and voltage over time")
    plot.add_argument("recording", type=Path)
    plot.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="F.png",
        help="png, svg or pdf (default: beside the recording)",
    )
    stretch(plot)

    video = command("video", "film a recording: the rig moving, its force and travel drawn beneath")
    video.add_argument("recording", type=Path)
    video.add_argument(
        "--out", "-o", type=Path, metavar="F.mp4", help="default: beside the recording"
    )
    video.add_argument(
        "--camera", default="overview", help="overview, side or wheel (default overview)"
    )
    video.add_argument(
        "--magnify",
        type=float,
        default=1.0,
        metavar="X",
        help="draw motions X times as large (default 1)",
    )
    stretch(video)

    export = command("export", "write a recording as CSV or MAT for other programs")
    export.add_argument("recording", type=Path)
    export.add_argument("--out", "-o", type=Path, required=True, metavar="F.csv|F.mat")

    importing = command(
        "import",
        "make a recording of other programs' data",
        "A map says which column is which channel, in what unit, and what the time base is; docs/tutorial.md explains it.\n\n"
        "example:\n  rigtwin import bench.csv --map bench-map.toml -o bench.mcap",
    )
    importing.add_argument("data", type=Path, metavar="DATA.{csv,mat,parquet}")
    importing.add_argument("--map", type=Path, required=True, metavar="MAP.toml")
    importing.add_argument("--out", "-o", type=Path, required=True, metavar="F.mcap")

    calibrate = command(
        "calibrate",
        "find the friction compensator's settings from a recording",
        "The recording must be made without compensation and reverse often, such as friction-road.\n\n"
        "example:\n  rigtwin calibrate friction.mcap -o compensator.toml\n"
        "  rigtwin run friction-road --config compensator.toml",
    )
    calibrate.add_argument("recording", type=Path)
    calibrate.add_argument(
        "--out", "-o", type=Path, metavar="F.toml", help="where to write them (default: print)"
    )
