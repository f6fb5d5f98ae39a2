"""What each command does. Imports stay inside the commands: none waits for what only another needs."""

from __future__ import annotations

import textwrap
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from rigtwin.cli.diagnosis_commands import compare, diagnose
from rigtwin.cli.machine_commands import machine, machines
from rigtwin.console import apart, configured, late, table, writable
from rigtwin.errors import RigtwinError


def list_experiments(parsed: Namespace) -> int:
    from controllers.quantity import Quantity
    from experiments import EXPERIMENTS, find
    from rigtwin.description.configuration import parameters

    if parsed.settings is None:
        rows = [("experiment", "what", "source", "seconds")]
        for experiment in EXPERIMENTS.values():
            duration = f"{experiment.configuration.timing.duration:g}"
            rows.append((experiment.name, experiment.summary, experiment.source, duration))
        print(table(rows))
        return 0
    rows = [("setting", "value", "unit", "allowed", "source")]
    for key, value, meaning in parameters(find(parsed.settings).configuration):
        if isinstance(meaning, Quantity):
            rows.append(
                (
                    key,
                    f"{value:g}",
                    meaning.unit,
                    f"{meaning.low:g} to {meaning.high:g}",
                    meaning.source,
                )
            )
        else:
            rows.append((key, value.label, "", " | ".join(meaning.labels()), ""))
    print(table(rows))
    return 0


def run(parsed: Namespace) -> int:
    from tqdm import tqdm

    from experiments import find
    from rigtwin.simulation.runner import record

    if parsed.seed < 0:
        raise RigtwinError(f"--seed {parsed.seed}: expected 0 or more")
    experiment = find(parsed.name)
    path = parsed.out or _fresh(f"{experiment.name}-{parsed.seed}")
    if parsed.target == "daq" or parsed.card is not None or parsed.real_time:
        return _run_supervised(parsed, path)
    for option in ("dry_run", "arm", "without_dry_run", "stop_file", "live"):
        if getattr(parsed, option):
            needs = "--card or --real-time" if option in ("stop_file", "live") else "--target daq"
            raise RigtwinError(f"--{option.replace('_', '-')} goes with {needs}")
    configuration = configured(experiment.configuration, parsed)
    demands = experiment.demands(configuration, parsed.seed)
    with tqdm(
        total=len(demands),
        unit="tick",
        unit_scale=True,
        disable=None,
        desc=experiment.name,
        leave=False,
    ) as bar:
        outcome = record(
            path, experiment.name, configuration, demands, parsed.seed, bar.update, parsed.effect
        )
    seconds = outcome.ticks * configuration.timing.period
    print(f"{experiment.name}: {seconds:.3f} s recorded in {outcome.path}; {outcome.reason}")
    return 3 if outcome.tripped else 0


def _run_supervised(parsed: Namespace, path: Path) -> int:
    from rigtwin.cli.session_commands import plan_test
    from rigtwin.cli.session_commands import run as work

    if parsed.target == "daq" and parsed.card is None:
        raise RigtwinError("--target daq needs the card's channel table: --card CARD.toml")
    if parsed.target == "twin" and (parsed.dry_run or parsed.without_dry_run or parsed.arm):
        raise RigtwinError("--dry-run, --without-dry-run and --arm go with --target daq")
    if parsed.live and not (parsed.real_time or (parsed.target == "daq" and not parsed.dry_run)):
        raise RigtwinError(
            "--live goes with a session in real time: --real-time, or --target daq without --dry-run"
        )
    writable(apart(path, *(given for given in (parsed.card, parsed.config) if given is not None)))
    return work(parsed, plan_test(parsed, parsed.name), path)


def card(parsed: Namespace) -> int:
    from rigtwin.cli.card_commands import DEEDS

    return DEEDS[parsed.deed](parsed)


def session(parsed: Namespace) -> int:
    from rigtwin.cli.session_commands import session as work

    return work(parsed)


def faults(parsed: Namespace) -> int:
    from rigtwin.hardware.daq.card import require_client

    require_client()
    from rigtwin.cli.faults_commands import faults as work

    return work(parsed)


def effects(parsed: Namespace) -> int:
    from rigtwin.components import RigPlant, candidates

    plant = RigPlant()
    rows: list[tuple[str, ...]] = [
        ("effect", "parameter", "nominal", "unit", "allowed", "what it does")
    ]
    for effect in candidates(plant):
        if parsed.component not in (None, effect.component):
            continue
        name, meaning = effect.name, effect.kind.meaning
        for parameter, quantity in effect.quantities().items():
            value, allowed = (
                effect.nominal(plant)[parameter],
                f"{quantity.low:g} to {quantity.high:g}",
            )
            rows.append((name, parameter, f"{value:g}", quantity.unit, allowed, meaning))
            name = meaning = ""
    if len(rows) == 1:
        components = dict.fromkeys(effect.component for effect in candidates(plant))
        raise RigtwinError(
            f"unknown component {parsed.component!r}; there are {', '.join(components)}"
        )
    print(table(rows))
    print(
        "setting@controller=NAME:VALUE  a setting that is not what the recording says; rigtwin list --settings has them"
    )
    return 0


def _fresh(stem: str) -> Path:
    """A file name that is not taken."""
    path, number = Path(f"{stem}.mcap"), 1
    while path.exists():
        number += 1
        path = Path(f"{stem}-{number}.mcap")
    return path


def info(parsed: Namespace) -> int:
    import numpy as np

    from rigtwin.recording import load
    from rigtwin.recording.channels import channels_of

    recording = load(parsed.recording)
    print(f"{recording.path}: {recording.experiment} on {recording.machine}")
    print(
        f"{recording.ticks} ticks of {recording.period:g} s, {recording.time[0]:g} to {recording.time[-1]:.3f} s"
    )
    print(f"ended: {recording.end or 'not said'}")
    if recording.twin:
        print(
            f"made by a twin: seed {recording.twin.get('seed')}, rigtwin {recording.twin.get('version')}"
        )
    for note in recording.notes:
        print(f"note: {note}")
    for step in recording.transitions:
        print(
            f"{step.get('time', '?'):>12s} s  {step.get('from')} → {step.get('to')}: {step.get('reason')}"
        )
    if recording.lateness:
        print(late(recording.lateness))
    rows: list[tuple[str, ...]] = [("channel", "unit", "lowest", "mean", "highest", "meaning")]
    for channel in channels_of(recording.columns):
        values = recording.column(channel.topic, channel.name)
        with np.errstate(over="ignore"):
            figures = (f"{values.min():.5g}", f"{values.mean():.5g}", f"{values.max():.5g}")
        rows.append((f"{channel.topic}.{channel.name}", channel.unit, *figures, channel.meaning))
    print(table(rows))
    if recording.controller:
        settings = ", ".join(f"{key} {value}" for key, value in recording.controller.items())
        print(textwrap.fill(f"controller: {settings}", 120, subsequent_indent="  "))
    return 0


def plot(parsed: Namespace) -> int:
    from rigtwin.recording import load
    from rigtwin.render.plot import draw

    recording = load(parsed.recording)
    out = apart(parsed.out or parsed.recording.with_suffix(".png"), parsed.recording)
    draw(recording, out, parsed.start, parsed.until)
    print(f"drawn in {out}")
    return 0


def video(parsed: Namespace) -> int:
    from tqdm import tqdm

    from rigtwin.recording import load
    from rigtwin.render.video import film

    recording = load(parsed.recording)
    out = apart(parsed.out or parsed.recording.with_suffix(".mp4"), parsed.recording)
    with tqdm(unit="frame", disable=None, desc="filming", leave=False) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        film(recording, out, parsed.camera, parsed.start, parsed.until, parsed.magnify, progress)
    print(f"filmed in {out}")
    return 0


def export(parsed: Namespace) -> int:
    from rigtwin.recording import load
    from rigtwin.recording.export import export as write

    write(load(parsed.recording), apart(parsed.out, parsed.recording))
    print(f"written to {parsed.out}")
    return 0


def blindcheck(parsed: Namespace) -> int:
    from rigtwin.cli.blindcheck_commands import blindcheck as work

    return work(parsed)


def tune(parsed: Namespace) -> int:
    from rigtwin.cli.tuning_commands import tune as work

    return work(parsed)


def reproduce(parsed: Namespace) -> int:
    from experiments.thesis.commands import reproduce as work

    return work(parsed)


def stability(parsed: Namespace) -> int:
    from rigtwin.cli.stability_commands import stability as work

    return work(parsed)


def calibrate(parsed: Namespace) -> int:
    from controllers import Compensator, Settings
    from rigtwin.description.configuration import Configuration, overridden
    from rigtwin.diagnosis.checks import check
    from rigtwin.recording import load
    from rigtwin.recording.channels import SUSPENSION_RIG
    from rigtwin.studies.friction_spikes import BOUNDS, calibrated

    recording = load(parsed.recording)
    if recording.machine != SUSPENSION_RIG:
        raise RigtwinError(
            f"{recording.path}: it is of machine {recording.machine!r}; expected {SUSPENSION_RIG}"
        )
    if parsed.out is not None:
        writable(apart(parsed.out, parsed.recording))
    told: Settings = overridden(Configuration(), {"controller": recording.controller}).controller
    for fault in check(
        recording, overridden(Configuration(), {"controller": recording.controller})
    ):
        if fault.fatal:
            raise RigtwinError(f"{recording.path}: {fault.message}")
        print(f"note: {fault.message}")
    for note in recording.notes:
        print(f"note: {note}")
    found = calibrated(recording, told)
    print(
        f"{recording.path}: Coulomb friction of the motor {found.friction:.1f} N, from {found.reversals} reversals"
    )
    print(
        f"tried on the recording: {found.detected} of {found.reversals} reversals detected, {found.false} false steps, "
        f"{1e3 * found.delay:.0f} ms after the reversal"
    )
    if found.detected < 0.8 * found.reversals or found.false > 0.1 * found.reversals:
        raise RigtwinError(
            f"{recording.path}: a compensator found from it would do harm; record a test that reverses often, such as "
            "friction-road, without compensation"
        )
    values = {name: float(getattr(found.settings, name)) for name in ("friction_step", *BOUNDS)}
    lines = [
        "[controller]",
        f'compensator = "{Compensator.TWO_STEP.label}"',
        *(f"{name} = {v:.6g}" for name, v in values.items()),
    ]
    if parsed.out is None:
        print("\n".join(lines))
    else:
        try:
            parsed.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
        except OSError as error:
            raise RigtwinError(f"cannot write {parsed.out}: {error.strerror}") from None
        print(f"settings in {parsed.out}, for --config")
    return 0


def import_(parsed: Namespace) -> int:
    from rigtwin.importing.convert import convert

    apart(parsed.out, parsed.data, parsed.map)
    writable(parsed.out)
    for line in convert(parsed.data, parsed.map, parsed.out):
        print(line)
    return 0


COMMANDS: dict[str, Callable[[Namespace], int]] = {
    "list": list_experiments,
    "run": run,
    "session": session,
    "card": card,
    "faults": faults,
    "effects": effects,
    "info": info,
    "plot": plot,
    "video": video,
    "export": export,
    "import": import_,
    "machines": machines,
    "machine": machine,
    "compare": compare,
    "diagnose": diagnose,
    "blindcheck": blindcheck,
    "reproduce": reproduce,
    "tune": tune,
    "stability": stability,
    "calibrate": calibrate,
}
