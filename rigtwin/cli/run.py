"""`rigtwin run`: run an experiment on the twin or the rig, and record it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from machines import DEFAULT_MACHINE
from rigtwin.cli.options import add_effect, add_machine, add_settings, settings_of
from rigtwin.cli.supervised import add_supervised, require_card, run
from rigtwin.console import writable
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin import Machine

SUMMARY = "run an experiment on the twin and record it"
MORE = """\
examples:
  rigtwin run drop --out drop.mcap
  rigtwin run road10 --seed 3 --set controller.kp=0.5 --set timing.duration=10
  rigtwin run positioning --machine emps --effect coulomb@guide=20

exit code 3: a limit tripped; the recording is kept."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", help="name of an experiment; rigtwin list prints them")
    add_machine(parser, "machine to simulate", DEFAULT_MACHINE)
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="seed of noise and road (default 0); the same seed gives the same bytes",
    )
    parser.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="F.mcap",
        help="file to write, replaced if it exists (default: NAME-SEED.mcap with a free number)",
    )
    add_effect(parser, "simulate an effect that is not in the settings, e.g. coulomb@rail=80")
    parser.add_argument(
        "--effects-from",
        type=float,
        default=0.0,
        metavar="S",
        help="time of the test from which the effects act, in s (default: the start)",
    )
    add_settings(parser)
    add_supervised(parser)


def execute(parsed: argparse.Namespace) -> int:
    from tqdm import tqdm

    import rigtwin
    from rigtwin.description.changes import with_changes
    from rigtwin.simulation.experiment import find_experiment

    machine = rigtwin.machine(parsed.machine)
    experiment = find_experiment(machine, parsed.name)
    # The default name is chosen so that no recording is overwritten; --out may overwrite one.
    path = parsed.out or _fresh(f"{experiment.name}-{parsed.seed}")
    if parsed.seed < 0:
        raise RigtwinError(f"--seed {parsed.seed}: expected 0 or more")
    if parsed.target == "daq" or parsed.card is not None or parsed.real_time:
        # In a supervised session the twin runs behind converters and has its effects from the
        # start.
        if parsed.effects_from:
            raise RigtwinError("--effects-from does not work with --target, --card or --real-time")
        return _run_supervised(parsed, machine, path)
    for option in ("dry_run", "arm", "without_dry_run", "stop_file", "live"):
        if getattr(parsed, option):
            needs = "--card or --real-time" if option in ("stop_file", "live") else "--target daq"
            raise RigtwinError(f"--{option.replace('_', '-')} requires {needs}")
    settings = settings_of(parsed)
    ticks = with_changes(experiment.configuration, settings).ticks
    shown = {"unit": "tick", "unit_scale": True, "desc": experiment.name, "leave": False}
    with tqdm(total=ticks, disable=None, **shown) as bar:
        recording = rigtwin.run(
            machine,
            experiment,
            seed=parsed.seed,
            effects=parsed.effect,
            effects_from=parsed.effects_from,
            settings=settings,
            path=path,
            progress=bar.update,
        )
    seconds = recording.ticks * recording.period
    print(f"{experiment.name}: {seconds:.3f} s recorded in {path}; {recording.end}")
    if (energy := rigtwin.energy_error(recording, machine=machine)) is not None:
        print(f"energy error: {energy}")
    return 3 if recording.tripped else 0


def _fresh(stem: str) -> Path:
    """A file name that is not taken."""
    path, number = Path(f"{stem}.mcap"), 1
    while path.exists():
        number += 1
        path = Path(f"{stem}-{number}.mcap")
    return path


def _run_supervised(parsed: argparse.Namespace, machine: Machine, path: Path) -> int:
    require_card(parsed, machine)
    if parsed.live and not (parsed.real_time or (parsed.target == "daq" and not parsed.dry_run)):
        raise RigtwinError(
            "--live requires a session in real time: --real-time, or --target daq without --dry-run"
        )
    writable(path)
    return run(parsed, parsed.name, path)
