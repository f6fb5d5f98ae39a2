"""`rigtwin import`: other programs' data as a recording."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.console import writable

SUMMARY = "make a recording of other programs' data"
MORE = """\
A map says which column is which channel, in what unit, and what the time base is;
docs/importing.md explains it. The columns of several files are joined row by row. A data set
of several episodes becomes a recording of each, in the folder that -o names.

examples:
  rigtwin import bench.csv --map bench-map.toml -o bench.mcap
  rigtwin import positions.csv currents.csv --map arm.toml -o arm.mcap
  rigtwin import my_bag/ --map arm-map.toml --machine arm.toml -o arm.mcap
  rigtwin import lerobot_dataset/ --map arm-map.toml -o episodes/"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "data",
        type=Path,
        nargs="+",
        metavar="DATA",
        help="csv, json, mat, npz, parquet; a ROS 2 bag; the folder of a bag or a LeRobot data set",
    )
    parser.add_argument("--map", type=Path, required=True, metavar="MAP.toml")
    parser.add_argument(
        "--out",
        "-o",
        required=True,
        metavar="F.mcap",
        help="the recording; for episodes a folder, which exists or ends with a slash",
    )
    parser.add_argument(
        "--machine",
        metavar="F.toml",
        help="the machine, by name or description, which the recording remembers "
        "(default: the one that the map names)",
    )


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    out = Path(parsed.out)
    # A Path drops the trailing slash, so the text as given is asked.
    if out.is_dir() or parsed.out.endswith(("/", "\\")):
        recordings = rigtwin.import_episodes(parsed.data, parsed.map, out, machine=parsed.machine)
        # Every report begins with what the data hold.
        lines = dict.fromkeys(line for recording in recordings for line in recording.report)
    else:
        writable(out)
        lines = rigtwin.import_data(parsed.data, parsed.map, out, machine=parsed.machine).report
    for line in lines:
        print(line)
    return 0
