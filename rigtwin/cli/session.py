"""`rigtwin session`: a list of tests on the rig, or on any machine's twin."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import rigtwin
from machines import DEFAULT_MACHINE
from rigtwin.cli.options import add_effect, add_settings, settings_of
from rigtwin.cli.supervised import add_supervised, plan, require_card
from rigtwin.cli.supervised import run as run_supervised
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin import Machine
    from rigtwin.hardware.session.plan import PlannedTest

SUMMARY = "run a list of tests on the rig or on a machine's twin, one recording each"
MORE = """\
The list is a TOML file of [[test]] tables: experiment, and if wanted seed, pause (s before it),
name, set (a table of settings). After each test its recording is compared with the twin. A session
ends at the first test that does not complete; --resume goes on with what is missing."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("list", type=Path, metavar="LIST.toml", help="the tests")
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("session"),
        help="folder of the recordings (default session)",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep the recordings that were completed; run the others",
    )
    parser.add_argument(
        "--machine",
        default=DEFAULT_MACHINE,
        metavar="F.toml",
        help="the machine, by name or description (default: the suspension rig)",
    )
    add_effect(parser, "simulate an effect that is not in the settings")
    add_settings(parser)
    add_supervised(parser)


def execute(parsed: argparse.Namespace) -> int:
    """Runs the list and tells of each test what the twin says of it."""
    machine = rigtwin.machine(parsed.machine)
    if machine.physics.card is None and not _needs_card(parsed):
        return _run_on_twin(parsed, machine)
    from rigtwin.hardware.session.permission import require_permission

    require_card(parsed, machine)
    real = parsed.target == "daq" and not parsed.dry_run
    code = 0

    def prepare(test: PlannedTest) -> None:
        ready = plan(_command_line(parsed, test), test.experiment)
        # Built only for its checks: a mistake must show before the first test moves anything.
        ready.operation()
        if real:
            require_permission(ready, parsed.card, parsed.without_dry_run)

    def run(test: PlannedTest, path: Path) -> bool:
        nonlocal code
        code = run_supervised(_command_line(parsed, test), test.experiment, path)
        if code == 0:
            _compare(path, parsed.machine)
        return code == 0

    rigtwin.run_session(
        parsed.list,
        parsed.folder,
        run,
        machine=machine,
        resume=parsed.resume,
        real=real,
        prepare=prepare,
        on_message=lambda line: print(line, flush=True),
    )
    return code


def _needs_card(parsed: argparse.Namespace) -> bool:
    """Whether an option is set that requires a channel table."""
    asked = ("card", "dry_run", "real_time", "arm", "without_dry_run", "stop_file", "live")
    return parsed.target == "daq" or any(getattr(parsed, name) for name in asked)


def _run_on_twin(parsed: argparse.Namespace, machine: Machine) -> int:
    """Runs the list on the twin of any machine."""
    from rigtwin.api.planning import check_settings
    from rigtwin.simulation.experiment import find_experiment

    code = 0

    def run(test: PlannedTest, path: Path) -> bool:
        nonlocal code
        recording = rigtwin.run(
            machine,
            test.experiment,
            seed=test.seed,
            effects=parsed.effect,
            settings=settings_of(_command_line(parsed, test)),
            path=path,
        )
        seconds = recording.ticks * recording.period
        print(f"{test.experiment}: {seconds:.3f} s recorded in {path}; {recording.end}")
        _compare(path, parsed.machine)
        code = 3 if recording.tripped else 0
        return not recording.tripped

    rigtwin.run_session(
        parsed.list,
        parsed.folder,
        run,
        machine=machine,
        resume=parsed.resume,
        prepare=lambda test: check_settings(
            machine,
            find_experiment(machine, test.experiment).configuration,
            settings_of(_command_line(parsed, test)),
        ),
        on_message=lambda line: print(line, flush=True),
    )
    return code


def _command_line(parsed: argparse.Namespace, test: PlannedTest) -> argparse.Namespace:
    """The command line of one test: its own settings after those of the session."""
    # Later settings win, so those of the test come last.
    settings = [*parsed.set, *test.settings]
    return argparse.Namespace(**{**vars(parsed), "seed": test.seed, "set": settings})


def _compare(path: Path, machine: str | None = None) -> None:
    """Says where the rig and the twin disagree, at once."""
    from rigtwin.cli.compare import execute as compare

    # The options that `rigtwin compare` would have parsed.
    defaults = {"other": None, "json": None, "machine": machine, "config": None}
    try:
        compare(argparse.Namespace(recording=path, effect=[], set=[], **defaults))
    except RigtwinError as error:
        print(f"not compared: {error}")
