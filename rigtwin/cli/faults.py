"""`rigtwin faults`: faults put into sessions on the virtual card."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.hardware.daq import CARD

SUMMARY = "put faults into sessions on the virtual card; see that each is stopped"
MORE = "docs/faults.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--each",
        type=int,
        default=11,
        metavar="N",
        help="sessions of each kind in one process (default 11)",
    )
    parser.add_argument(
        "--processes",
        type=int,
        default=4,
        metavar="N",
        help="of each kind that kills a process (default 4)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of kinds' times, tests and places (default 0)"
    )
    parser.add_argument(
        "--card",
        type=Path,
        default=CARD,
        metavar="CARD.toml",
        help="channel table (default the packaged one)",
    )
    parser.add_argument("--out", "-o", type=Path, metavar="F.md", help="write the table there")
    parser.add_argument("--json", type=Path, metavar="J.json", help="write every outcome there")


def execute(parsed: argparse.Namespace) -> int:
    from rigtwin.hardware.daq.card import require_client

    require_client()
    from rigtwin.cli.faults_commands import faults

    return faults(parsed)
