"""Options of the commands that run tests on the rig."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_supervised(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("on the rig (docs/rig.md)")
    group.add_argument(
        "--target", choices=("twin", "daq"), default="twin", help="what to run on (default twin)"
    )
    group.add_argument(
        "--card",
        type=Path,
        metavar="CARD.toml",
        help="channel table; with the twin: its converters, ramps, limits",
    )
    group.add_argument(
        "--dry-run",
        action="store_true",
        help="with daq: the exact session on the virtual card first",
    )
    group.add_argument("--real-time", action="store_true", help="the twin at the pace of the clock")
    group.add_argument(
        "--arm",
        action="store_true",
        help="do not ask before the rig is armed: everybody is clear of it",
    )
    group.add_argument(
        "--without-dry-run",
        metavar="NAME",
        help="arm without a dry run; NAME answers for it, and is recorded",
    )
    group.add_argument(
        "--stop-file",
        type=Path,
        metavar="F",
        help="stop when this file appears; signals and keys stop anyway",
    )
    group.add_argument(
        "--live",
        type=int,
        nargs="?",
        const=8765,
        default=0,
        metavar="PORT",
        help="live view for Foxglove (default port 8765)",
    )
