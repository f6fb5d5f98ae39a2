"""Options that several commands have."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Protocol


class Command(Protocol):
    """Adds a command: its name, what it does in a line, and more."""

    def __call__(self, name: str, summary: str, more: str = "") -> argparse.ArgumentParser: ...


def added(commands: Any) -> Command:
    """Adds commands to the top parser's."""

    def command(name: str, summary: str, more: str = "") -> argparse.ArgumentParser:
        return commands.add_parser(
            name,
            help=summary,
            description=f"{summary}.\n\n{more}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )

    return command


def settings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override one setting, e.g. rail.coulomb=60",
    )
    parser.add_argument(
        "--config",
        type=Path,
        metavar="F.toml",
        help="override settings from a TOML file, before --set",
    )


def effect(parser: argparse.ArgumentParser, summary: str) -> None:
    parser.add_argument(
        "--effect", action="append", default=[], metavar="KIND@COMPONENT=VALUE", help=summary
    )


def workers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="processes that work side by side (default: one a core)",
    )
    parser.add_argument(
        "--cluster", metavar="ADDRESS", help="work on a dask cluster instead, e.g. tcp://host:8786"
    )


def stretch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--from",
        dest="start",
        type=float,
        default=0.0,
        metavar="S",
        help="start at this time (default 0)",
    )
    parser.add_argument(
        "--until", type=float, metavar="S", help="stop at this time (default: the end)"
    )
