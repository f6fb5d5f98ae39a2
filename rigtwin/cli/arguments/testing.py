"""The commands that run tests, on the twin and on the rig."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.arguments.shared import Command, effect, settings
from rigtwin.hardware.daq import CARD


def add(command: Command) -> None:
    listing = command(
        "list",
        "list the experiments, or the settings",
        "rigtwin list --settings drop prints every setting of an experiment with unit, bounds and source.",
    )
    listing.add_argument(
        "--settings", metavar="NAME", help="the settings of that experiment instead"
    )

    run = command(
        "run",
        "run an experiment on the twin and record it",
        "examples:\n  rigtwin run drop --out drop.mcap\n"
        "  rigtwin run road10 --seed 3 --set controller.kp=0.5 --set timing.duration=10\n\n"
        "exit code 3: a limit tripped; the recording is kept.",
    )
    run.add_argument("name", help="an experiment of rigtwin list")
    run.add_argument(
        "--seed",
        type=int,
        default=0,
        help="of noise and road (default 0); the same seed gives the same bytes",
    )
    run.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="F.mcap",
        help="where to record; replaced if there (default NAME-SEED.mcap, numbered if there)",
    )
    effect(run, "give the rig an effect that its settings do not tell, e.g. coulomb@rail=80")
    settings(run)
    supervised(run)

    card(
        command("card", "a virtual card on a port, or the check of a channel table", "docs/rig.md")
    )
    session(command("session", "run a list of tests on the rig, one recording each", SESSION))
    faults(
        command(
            "faults",
            "put faults into sessions on the virtual card; see that each is stopped",
            "docs/faults.md",
        )
    )

    effects = command(
        "effects",
        "list the effects that a rig can have",
        "Give one to a test with rigtwin run NAME --effect KIND@COMPONENT=VALUE.",
    )
    effects.add_argument("component", nargs="?", help="only those of this component")


SESSION = """\
The list is a TOML file of [[test]] tables: experiment, and if wanted seed, pause (s before it), name, set (a table of
settings). After each test its recording is compared with the twin. A session ends at the first test that does not
complete; --resume goes on with what is missing."""


def card(parser: argparse.ArgumentParser) -> None:
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
    effect(serving, "give the rig an effect, e.g. coulomb@rail=80")
    settings(serving)
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


def session(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("list", type=Path, metavar="LIST.toml", help="the tests")
    parser.add_argument(
        "--folder", type=Path, default=Path("session"), help="of the recordings (default session)"
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep the recordings that were completed; run the others",
    )
    effect(parser, "give the twin an effect that its settings do not tell")
    settings(parser)
    supervised(parser)


def faults(parser: argparse.ArgumentParser) -> None:
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


def supervised(parser: argparse.ArgumentParser) -> None:
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
