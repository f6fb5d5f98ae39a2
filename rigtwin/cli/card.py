"""`rigtwin card`: a virtual card on a port, or the check of a channel table."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.options import add_effect, add_settings

SUMMARY = "a virtual card on a port, or the check of a channel table"
MORE = "docs/rig.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    deeds = parser.add_subparsers(dest="deed", metavar="deed", required=True)
    serving = deeds.add_parser(
        "serve", help="let the twin be the card of any NI-DAQmx gRPC client on this computer"
    )
    serving.add_argument(
        "card",
        type=Path,
        metavar="CARD.toml",
        help="channel table: how the twin is wired to the card",
    )
    serving.add_argument(
        "--port", type=int, default=31763, help="default 31763; 0 takes a free one"
    )
    serving.add_argument("--seed", type=int, default=0, help="of the sensors' noise (default 0)")
    add_effect(serving, "give the rig an effect, e.g. coulomb@rail=80")
    add_settings(serving)
    checking = deeds.add_parser("check", help="find zero, span and signs; write the channel table")
    checking.add_argument(
        "card", type=Path, metavar="CARD.toml", help="the channel table to begin with"
    )
    checking.add_argument(
        "--out",
        "-o",
        type=Path,
        required=True,
        metavar="NEW.toml",
        help="where to write what was found",
    )
    checking.add_argument("--operator", required=True, metavar="NAME", help="who does it")
    checking.add_argument("--note", default="", help="kept in the table")
    checking.add_argument(
        "--signs",
        action="store_true",
        help="move each output a little and see which signal follows, and how",
    )
    checking.add_argument(
        "--zero", action="store_true", help="as it stands now, every input reads its reference"
    )
    checking.add_argument(
        "--reference",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="other than zero, with --zero",
    )
    checking.add_argument(
        "--span",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="as it stands now, it reads this",
    )
    checking.add_argument(
        "--stroke",
        type=float,
        default=0.005,
        metavar="M",
        help="of the plates, with --signs (default 0.005)",
    )
    checking.add_argument(
        "--moved",
        action="append",
        default=[],
        metavar="OUTPUT=+|-",
        help="which way it went, if not asked",
    )
    checking.add_argument(
        "--arm", action="store_true", help="do not ask: everybody is clear of the rig"
    )
    checking.add_argument(
        "--virtual",
        type=Path,
        metavar="WIRING.toml",
        help="on a virtual card that is wired like this",
    )
    freeing = deeds.add_parser(
        "release", help="free what a program that died has left on a gRPC device server"
    )
    freeing.add_argument("card", type=Path, metavar="CARD.toml")


def execute(parsed: argparse.Namespace) -> int:
    from rigtwin.cli.card_commands import DEEDS

    return DEEDS[parsed.deed](parsed)
