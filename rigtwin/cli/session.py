"""`rigtwin session`: a list of tests on the rig."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.options import add_effect, add_settings
from rigtwin.cli.rig_options import add_supervised

SUMMARY = "run a list of tests on the rig, one recording each"
MORE = """\
The list is a TOML file of [[test]] tables: experiment, and if wanted seed, pause (s before it),
name, set (a table of settings). After each test its recording is compared with the twin. A session
ends at the first test that does not complete; --resume goes on with what is missing."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("list", type=Path, metavar="LIST.toml", help="the tests")
    parser.add_argument(
        "--folder", type=Path, default=Path("session"), help="of the recordings (default session)"
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep the recordings that were completed; run the others",
    )
    add_effect(parser, "give the twin an effect that its settings do not tell")
    add_settings(parser)
    add_supervised(parser)


def execute(parsed: argparse.Namespace) -> int:
    from rigtwin.cli.session_commands import session

    return session(parsed)
