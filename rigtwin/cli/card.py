"""`rigtwin card`: a virtual card on a port, or the check of a channel table."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    _add_serve(deeds)
    _add_check(deeds)
    freeing = deeds.add_parser(
        "release", help="release the lines that a dead program holds on a gRPC device server"
    )
    freeing.add_argument("card", type=Path, metavar="CARD.toml")
    _add_machine(freeing)


def _add_serve(deeds: Any) -> None:
    serving = deeds.add_parser(
        "serve", help="serve the twin as a card to NI-DAQmx gRPC clients on this computer"
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
    serving.add_argument("--seed", type=int, default=0, help="seed of the sensor noise (default 0)")
    add_effect(serving, "simulate an effect, e.g. coulomb@rail=80")
    add_settings(serving)


def _add_check(deeds: Any) -> None:
    checking = deeds.add_parser(
        "check", help="calibrate zero, span and signs; write the channel table"
    )
    checking.add_argument("card", type=Path, metavar="CARD.toml", help="channel table to correct")
    checking.add_argument(
        "--out",
        "-o",
        type=Path,
        required=True,
        metavar="NEW.toml",
        help="where to write the corrected table",
    )
    checking.add_argument(
        "--operator", required=True, metavar="NAME", help="name of the person who calibrates"
    )
    checking.add_argument("--note", default="", help="remark that is stored in the table")
    _add_corrections(checking)
    checking.add_argument(
        "--arm",
        action="store_true",
        help="arm without asking; make sure that everybody is clear of the rig",
    )
    checking.add_argument(
        "--virtual",
        type=Path,
        metavar="WIRING.toml",
        help="check a virtual card that is wired by this table",
    )


def _add_corrections(checking: argparse.ArgumentParser) -> None:
    """Add the options that say what is corrected, and by which values."""
    checking.add_argument(
        "--signs",
        action="store_true",
        help="move each output slightly and check which signals follow, with which sign",
    )
    checking.add_argument(
        "--zero",
        action="store_true",
        help="every input is at its reference value now; set its zero",
    )
    checking.add_argument(
        "--reference",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="reference value of an input that is not zero, with --zero",
    )
    checking.add_argument(
        "--span",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="present value of an input, from which its span is set",
    )
    checking.add_argument(
        "--stroke",
        type=float,
        default=0.005,
        metavar="M",
        help="stroke of the plates in m, with --signs (default 0.005)",
    )
    checking.add_argument(
        "--moved",
        action="append",
        default=[],
        metavar="OUTPUT=+|-",
        help="direction of an output, in place of the question",
    )


def _add_machine(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--machine",
        default=DEFAULT_MACHINE,
        metavar="F.toml",
        help="machine on the card, by name or description (default: the suspension rig)",
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
    released = rigtwin.release_card(parsed.card, machine=parsed.machine)
    done = "lines of a dead program released" if released else "no lines were held"
    print(f"outputs at zero, power off; {done}")
    return 0


def _check(parsed: argparse.Namespace) -> int:
    writable(parsed.out)
    check = rigtwin.check_card(
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
    for line in check.changes or (("every sign is right",) if parsed.signs else ()):
        print(line)
    rigtwin.write_table(check.table, parsed.out)
    print(f"channel table in {parsed.out}")
    return 0


def _show(rest: Sequence[RestReading]) -> None:
    rows: list[tuple[str, ...]] = [("signal", "mean", "noise", "same in a row")]
    rows += [(s.name, f"{s.mean:.5g}", f"{s.noise:.3g} rms", str(s.repeats)) for s in rest]
    print(table(rows))


def _parse_values(texts: Sequence[str], option: str) -> dict[str, float]:
    """Return input → value of each NAME=VALUE. Raises RigtwinError if a value is not a number."""
    values = dict[str, float]()
    for text in texts:
        name, _, value = text.partition("=")
        try:
            values[name] = float(value)
        except ValueError:
            raise RigtwinError(
                f"{option} {text}: expected NAME=NUMBER, such as structure_lvdt=0.1"
            ) from None
    return values


def _parse_directions(texts: Sequence[str]) -> dict[str, int]:
    """Return output → direction of each OUTPUT=+ (1) or OUTPUT=- (-1); 0 for any other text."""
    pairs = (text.partition("=") for text in texts)
    # 0 is no direction; `check_card` refuses it with a message of its own.
    return {name: {"+": 1, "-": -1}.get(sign, 0) for name, _, sign in pairs}


def _ask_direction(output: str) -> int:
    motion = {
        "ground": "the ground plate go towards the wheel",
        "structure": "the structure plate go away from the wheel",
    }.get(output, "the motor push the plate away from the wheel")
    return 1 if _ask(f"did {motion} first? y/n: ", ("y", "n")) == "y" else -1


def _ask(question: str, answers: tuple[str, ...]) -> str:
    # Waiting for an answer that nobody can give would hang a script.
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
