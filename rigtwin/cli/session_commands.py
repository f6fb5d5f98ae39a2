"""`rigtwin run` on a card or in real time, and `rigtwin session`."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from contextlib import ExitStack
from datetime import date
from pathlib import Path

from tqdm import tqdm

from rigtwin.api.rig import key_of, rehearse
from rigtwin.console import late, table
from rigtwin.description.changes import read_toml
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.table import load_table, require_trust
from rigtwin.hardware.daq.terminals import InRealTime, WiredTwin
from rigtwin.hardware.realtime import list_shortcomings
from rigtwin.hardware.session.dry_run import has_passed, ledger
from rigtwin.hardware.session.plan import PlannedTest, is_complete, move_aside, parse_plan
from rigtwin.hardware.session.record import (
    Test,
    open_card,
    record_at_leisure,
    record_in_real_time,
)
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.supervision import SessionEnd
from rigtwin.hardware.supervisor import COMPLETED
from rigtwin.recording import load

PORTS = 65535


def run(parsed: Namespace, test: Test, path: Path) -> int:
    """Runs a test under supervision as the command line asks. Returns the exit code."""
    if parsed.target == "twin":
        return _run_on_twin(parsed, test, path)
    if parsed.dry_run:
        return _dry_run(parsed, test, path)
    return _run_on_rig(parsed, test, path)


def _run_on_twin(parsed: Namespace, test: Test, path: Path) -> int:
    twin = WiredTwin(test.terminals(), test.table)
    with ExitStack() as stack:
        stop = stack.enter_context(stop_requests(parsed.stop_file))
        bar = stack.enter_context(_bar(test))
        if parsed.real_time:
            timed = InRealTime(twin, test.configuration.timing.period)
            ended = record_in_real_time(
                timed, test, path, stop, guarded=False, live=parsed.live, progress=bar.update
            )
        else:
            ended = record_at_leisure(twin, test, path, stop, bar.update)
    return _report_end(test, path, ended)


def _dry_run(parsed: Namespace, test: Test, path: Path) -> int:
    with stop_requests(parsed.stop_file) as stop, _bar(test) as bar:
        found = rehearse(test, parsed.card, path, bar.update, stop)
    ticks = found.recording.ticks if found.recording is not None else 0
    code = _report(test, path, ticks, found.cause, found.passed)
    if found.peaks:
        rows: list[tuple[str, ...]] = [("predicted", "peak", "limit", "margin")]
        for peak in found.peaks:
            values = (f"{peak.peak:.4g} {peak.unit}", f"{peak.limit:g} {peak.unit}")
            rows.append((peak.name, *values, f"{100 * peak.margin:.0f} %"))
        print(table(rows))
    for lacking in found.obstacles:
        print(f"before the rig may be armed: {lacking}")
    if found.passed and not test.effects:
        print(f"dry run passed, noted in {ledger(parsed.card)}")
    return code


def require_permission(
    parsed: Namespace, test: Test
) -> tuple[Card, list[tuple[str, dict[str, str]]]]:
    """The card, on which nothing has moved yet, and what the recording has to say of it.

    Raises RigtwinError if the test must not be run on the rig.
    """
    if test.effects:
        raise RigtwinError("--effect is the twin's; the rig has its own")
    require_trust(test.table, date.today())
    _ = test.card_configuration
    card = open_card(test)
    notes: list[tuple[str, dict[str, str]]] = []
    if not has_passed(parsed.card, key_of(test)):
        if not parsed.without_dry_run:
            raise RigtwinError(
                f"{test.experiment} with these settings has had no dry run; do it first: "
                "the same command with --dry-run "
                "(or say who answers for it: --without-dry-run NAME)"
            )
        notes.append(("rigtwin.override", {"dry run": f"left out by {parsed.without_dry_run}"}))
    return card, notes


def _run_on_rig(parsed: Namespace, test: Test, path: Path) -> int:
    card, notes = require_permission(parsed, test)
    for lacking in list_shortcomings():
        print(f"this computer lacks {lacking}")
    if not parsed.arm and not _ask_to_arm(test):
        print("not armed; nothing moved")
        return 1
    with stop_requests(parsed.stop_file) as stop, _bar(test) as bar:
        ended = record_in_real_time(
            card, test, path, stop, guarded=True, notes=notes, live=parsed.live, progress=bar.update
        )
    return _report_end(test, path, ended)


def _ask_to_arm(test: Test) -> bool:
    if not sys.stdin.isatty():
        raise RigtwinError(
            "no terminal to ask for arming; say --arm if everybody is clear of the rig"
        )
    print(
        f"{test.experiment} on card {test.table.device}. Any key stops it. Everybody clear of the "
        "rig?"
    )
    try:
        return input("type arm to go: ").strip() == "arm"
    except EOFError:
        return False


def _bar(test: Test) -> tqdm:
    return tqdm(
        total=len(test.demands),
        unit="tick",
        unit_scale=True,
        disable=None,
        desc=test.experiment,
        leave=False,
    )


def _report_end(test: Test, path: Path, ended: SessionEnd) -> int:
    return _report(test, path, ended.ticks, ended.cause.reason, ended.cause == COMPLETED)


def _report(test: Test, path: Path, ticks: int, cause: str, completed: bool) -> int:
    seconds = ticks * test.configuration.timing.period
    print(f"{test.experiment}: {seconds:.3f} s recorded in {path}; {cause}")
    lateness = load(path).lateness if ticks else {}
    if lateness:
        print(late(lateness))
    return 0 if completed else 3


def plan_test(parsed: Namespace, name: str) -> Test:
    """The test of a command line: experiment, settings, seed, card. Raises RigtwinError."""
    from experiments import find
    from rigtwin.console import configured

    if not 0 <= parsed.live <= PORTS:
        raise RigtwinError(f"--live {parsed.live}: expected a port up to {PORTS}")
    experiment = find(name)
    configuration = configured(experiment.configuration, parsed)
    demands = experiment.demands(configuration, parsed.seed)
    return Test(
        experiment.name,
        configuration,
        demands,
        parsed.seed,
        load_table(parsed.card or CARD),
        parsed.effect,
    )


def session(parsed: Namespace) -> int:
    """Runs a list of tests, up to the first that did not end as it should.

    Parameters
    ----------
    parsed : Namespace
        The command line of `rigtwin session`.

    Returns
    -------
    int
        The exit code.

    Raises
    ------
    RigtwinError
        For a mistake in the command line or in any test of the list, before anything moves.
    """
    from experiments import find

    if parsed.target == "daq" and parsed.card is None:
        raise RigtwinError("--target daq needs the card's channel table: --card CARD.toml")
    tests = read_toml(parsed.list, lambda tables: parse_plan(tables, find))
    try:
        parsed.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigtwinError(f"cannot make {parsed.folder}: {error.strerror}") from None
    real = parsed.target == "daq" and not parsed.dry_run
    paths = {test.name: parsed.folder / f"{test.name}.mcap" for test in tests}
    todo = [test for test in tests if not (parsed.resume and is_complete(paths[test.name], real))]
    taken = [test.name for test in todo if paths[test.name].exists()]
    if taken and not parsed.resume:
        raise RigtwinError(
            f"{parsed.folder} holds {taken[0]}.mcap already; "
            "--resume goes on, or name another --folder"
        )
    # Every mistake is found before the first test moves anything.
    ready = [(test, plan_test(_command_line(parsed, test), test.experiment)) for test in todo]
    for _, one in ready:
        _ = one.card_configuration
        if real:
            require_permission(parsed, one)
    if len(todo) < len(tests):
        print(f"{len(tests) - len(todo)} of {len(tests)} tests are done already")
    for test, one in ready:
        if test.pause:
            print(f"pause of {test.pause:g} s before {test.name}", flush=True)
            time.sleep(test.pause)
        path = paths[test.name]
        aside = move_aside(path)
        code = run(parsed, one, path)
        if aside is not None:
            print(f"what was there before is in {aside}")
        if code != 0:
            print(f"{test.name} did not complete; see {path}, then --resume")
            return code
        _compare(path)
    return 0


def _command_line(parsed: Namespace, test: PlannedTest) -> Namespace:
    """The command line of one test: its own settings after those of the session."""
    return Namespace(**{**vars(parsed), "seed": test.seed, "set": [*parsed.set, *test.settings]})


def _compare(path: Path) -> None:
    """Says where the rig and the twin disagree, at once."""
    from rigtwin.cli.compare import execute

    nothing = {"other": None, "json": None, "machine": None, "config": None}
    try:
        execute(Namespace(recording=path, effect=[], set=[], **nothing))
    except RigtwinError as error:
        print(f"not compared: {error}")
