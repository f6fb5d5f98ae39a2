"""`rigtwin card`: a virtual card on a port, or the check of a channel table."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import rigtwin
from machines import DEFAULT_MACHINE
from rigtwin.cli.options import add_effect, add_settings, settings_of
from rigtwin.console import table, writable
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin.hardware.daq.calibration import RestReading

SUMMARY = "a virtual card on a port, or the check of a channel table"
MORE = "docs/rig.md"
ARM = "the check moves ground, structure and motor a little; everybody clear? type arm to go: "


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
    _add_machine(serving)
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
    _add_machine(freeing)


def _add_machine(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--machine",
        default=DEFAULT_MACHINE,
        metavar="F.toml",
        help="on the card, by name or description (default: the suspension rig)",
    )


def execute(parsed: argparse.Namespace) -> int:
    deeds = {"serve": _serve, "check": _check, "release": _release}
    return deeds[parsed.deed](parsed)


def _serve(parsed: argparse.Namespace) -> int:
    from rigtwin.hardware.session.stops import stop_requests

    served = rigtwin.serve_card(
        parsed.card,
        machine=parsed.machine,
        port=parsed.port,
        settings=settings_of(parsed),
        effects=parsed.effect,
        seed=parsed.seed,
    )
    print(
        f"virtual card {served.device}: "
        f'set address = "{served.address}" in the channel table. Ctrl-C ends it.',
        flush=True,
    )
    with stop_requests() as stop:
        while stop() is None:
            time.sleep(0.1)
    served.close()
    print(f"{served.ticks()} ticks")
    return 0


def _release(parsed: argparse.Namespace) -> int:
    left = rigtwin.release_card(parsed.card, machine=parsed.machine)
    done = "what a dead program had is free" if left else "nothing had been left"
    print(f"outputs at zero, power off; {done}")
    return 0


def _check(parsed: argparse.Namespace) -> int:
    writable(parsed.out)
    found = rigtwin.check_card(
        parsed.card,
        operator=parsed.operator,
        note=parsed.note,
        zero=parsed.zero,
        references=_parse_values(parsed.reference, "--reference"),
        spans=_parse_values(parsed.span, "--span"),
        signs=parsed.signs,
        stroke=parsed.stroke,
        directions=_parse_directions(parsed.moved),
        arm=lambda: parsed.arm or _ask(ARM, ("arm",)) == "arm",
        ask=_ask_direction,
        virtual=parsed.virtual,
        show=_show,
    )
    for line in found.said or (("every sign is right",) if parsed.signs else ()):
        print(line)
    rigtwin.write_table(found.table, parsed.out)
    print(f"channel table in {parsed.out}")
    return 0


def _show(rest: Sequence[RestReading]) -> None:
    rows: list[tuple[str, ...]] = [("signal", "mean", "noise", "same in a row")]
    rows += [(s.name, f"{s.mean:.5g}", f"{s.noise:.3g} rms", str(s.repeats)) for s in rest]
    print(table(rows))


def _parse_values(texts: Sequence[str], option: str) -> dict[str, float]:
    """input → value of each NAME=VALUE. Raises RigtwinError."""
    found = dict[str, float]()
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            raise RigtwinError(
                f"{option} {text}: expected NAME=NUMBER, such as structure_lvdt=0.1"
            ) from None
    return found


def _parse_directions(texts: Sequence[str]) -> dict[str, int]:
    """output → which way it went, of each OUTPUT=+ or OUTPUT=-; 0 for what is neither."""
    pairs = (text.partition("=") for text in texts)
    return {name: {"+": 1, "-": -1}.get(sign, 0) for name, _, sign in pairs}


def _ask_direction(output: str) -> int:
    what = {
        "ground": "the ground plate go towards the wheel",
        "structure": "the structure plate go away from the wheel",
    }.get(output, "the motor push the plate away from the wheel")
    return 1 if _ask(f"did {what} first? y/n: ", ("y", "n")) == "y" else -1


def _ask(question: str, answers: tuple[str, ...]) -> str:
    if not sys.stdin.isatty():
        raise RigtwinError(
            f"no terminal to ask: {question.strip()} (--arm and --moved answer beforehand)"
        )
    try:
        while (said := input(question).strip().lower()) not in answers:
            pass
    except EOFError:
        raise RigtwinError(f"not answered: {question.strip()}") from None
    return said
