"""`rigtwin import`: other programs' data as a recording."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.console import writable

SUMMARY = "make a recording of other programs' data"
MORE = """\
A map says which column is which channel, in what unit, and what the time base is;
docs/machines.md explains it. Several files are put side by side, row by row.

examples:
  rigtwin import bench.csv --map bench-map.toml -o bench.mcap
  rigtwin import positions.csv currents.csv --map arm.toml -o arm.mcap"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("data", type=Path, nargs="+", metavar="DATA.{csv,json,mat,parquet}")
    parser.add_argument("--map", type=Path, required=True, metavar="MAP.toml")
    parser.add_argument("--out", "-o", type=Path, required=True, metavar="F.mcap")


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    writable(parsed.out)
    for line in rigtwin.import_data(parsed.data, parsed.map, parsed.out).report:
        print(line)
    return 0
