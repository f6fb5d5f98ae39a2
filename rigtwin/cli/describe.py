"""`rigtwin describe`: a description and a map, made from a model and a log."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.options import add_columns, columns_of

SUMMARY = "describe a machine from its model and a log"
MORE = """\
Says which column of the log is which quantity of which joint, in what unit, and what kind of test
it is; --out writes that as two files to be edited. Where two readings are possible it asks, and
--column answers. docs/your_robot.md has an example.

examples:
  rigtwin describe arm.xml --log log.csv
  rigtwin describe arm.xml --log log.csv --column "elbow.position=q2 [deg]" --out my-arm
  rigtwin describe arm.urdf --log angles.csv torques.csv --column time=0.002"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, metavar="MODEL.{xml,urdf}")
    parser.add_argument(
        "--log",
        type=Path,
        nargs="+",
        required=True,
        metavar="LOG",
        help="log of another program; the columns of several files are joined row by row",
    )
    add_columns(parser)
    parser.add_argument(
        "--out", "-o", type=Path, metavar="FOLDER", help="write NAME.toml and map.toml there"
    )


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    described = rigtwin.describe(
        parsed.model, parsed.log, columns=columns_of(parsed), test=parsed.test
    )
    if parsed.out is None:
        print(described)
        return 0
    # Written before anything is printed, so that the printed commands work at once.
    description, mapping = described.write(parsed.out)
    print(described)
    logs = " ".join(map(str, parsed.log))
    recording = description.with_suffix(".mcap")
    print(
        f"written: {description}, {mapping}; edit them, then\n"
        f"  rigtwin import {logs} --map {mapping} -o {recording}\n"
        f"  rigtwin diagnose {recording} --machine {description}"
    )
    return 0
