"""What each command does. Imports stay inside the commands: none waits for what only another needs."""

from __future__ import annotations

import json
import math
import sys
import textwrap
from argparse import Namespace
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin.configuration import Configuration
    from rigtwin.diagnosis.residual import Residual


def _configured(configuration: Configuration, parsed: Namespace) -> Configuration:
    from rigtwin.configuration import from_assignments, from_toml

    if parsed.config is not None:
        configuration = from_toml(configuration, parsed.config)
    return from_assignments(configuration, parsed.set)


def _apart(out: Path, *inputs: Path) -> Path:
    """The output's path. Raises RigtwinError if it is one of the inputs, which would be lost."""
    if out.exists() and any(path.exists() and out.samefile(path) for path in inputs):
        raise RigtwinError(f"{out} is the input; name another output")
    return out


def _table(rows: list[tuple[str, ...]]) -> str:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)


def list_experiments(parsed: Namespace) -> int:
    from controllers.quantity import Quantity
    from experiments import EXPERIMENTS, find
    from rigtwin.configuration import parameters

    if parsed.settings is None:
        rows = [("experiment", "what", "source", "seconds")]
        for experiment in EXPERIMENTS.values():
            duration = f"{experiment.configuration.timing.duration:g}"
            rows.append((experiment.name, experiment.summary, experiment.source, duration))
        print(_table(rows))
        return 0
    rows = [("setting", "value", "unit", "allowed", "source")]
    for key, value, meaning in parameters(find(parsed.settings).configuration):
        if isinstance(meaning, Quantity):
            rows.append((key, f"{value:g}", meaning.unit, f"{meaning.low:g} to {meaning.high:g}", meaning.source))
        else:
            rows.append((key, value.label, "", " | ".join(meaning.labels()), ""))
    print(_table(rows))
    return 0


def run(parsed: Namespace) -> int:
    from tqdm import tqdm

    from experiments import find
    from rigtwin.runner import record

    if parsed.seed < 0:
        raise RigtwinError(f"--seed {parsed.seed}: expected 0 or more")
    experiment = find(parsed.name)
    configuration = _configured(experiment.configuration, parsed)
    demands = experiment.demands(configuration, parsed.seed)
    path = parsed.out or _fresh(f"{experiment.name}-{parsed.seed}")
    with tqdm(total=len(demands), unit="tick", unit_scale=True, disable=None, desc=experiment.name, leave=False) as bar:
        outcome = record(path, experiment.name, configuration, demands, parsed.seed, bar.update, parsed.effect)
    seconds = outcome.ticks * configuration.timing.period
    print(f"{experiment.name}: {seconds:.3f} s recorded in {outcome.path}; {outcome.reason}")
    return 3 if outcome.tripped else 0


def effects(parsed: Namespace) -> int:
    from rigtwin.effects import candidates
    from rigtwin.parameters import Plant

    plant = Plant()
    rows: list[tuple[str, ...]] = [("effect", "parameter", "nominal", "unit", "allowed", "what it does")]
    for effect in candidates(plant):
        if parsed.component not in (None, effect.component):
            continue
        name, meaning = effect.name, effect.kind.meaning
        for parameter, quantity in effect.quantities().items():
            value, allowed = effect.nominal(plant)[parameter], f"{quantity.low:g} to {quantity.high:g}"
            rows.append((name, parameter, f"{value:g}", quantity.unit, allowed, meaning))
            name = meaning = ""
    if len(rows) == 1:
        components = dict.fromkeys(effect.component for effect in candidates(plant))
        raise RigtwinError(f"unknown component {parsed.component!r}; there are {', '.join(components)}")
    print(_table(rows))
    print("setting@controller=NAME:VALUE  a setting that is not what the recording says; rigtwin list --settings has them")
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

    from rigtwin.channels import CHANNELS
    from rigtwin.recording import load

    recording = load(parsed.recording)
    print(f"{recording.path}: {recording.experiment} on {recording.machine}")
    print(f"{recording.ticks} ticks of {recording.period:g} s, {recording.time[0]:g} to {recording.time[-1]:.3f} s")
    print(f"ended: {recording.end or 'not said'}")
    if recording.twin:
        print(f"made by a twin: seed {recording.twin.get('seed')}, rigtwin {recording.twin.get('version')}")
    for note in recording.notes:
        print(f"note: {note}")
    rows: list[tuple[str, ...]] = [("channel", "unit", "lowest", "mean", "highest", "meaning")]
    for channel in CHANNELS:
        if recording.has(channel.topic, channel.name):
            values = recording.column(channel.topic, channel.name)
            with np.errstate(over="ignore"):
                figures = (f"{values.min():.5g}", f"{values.mean():.5g}", f"{values.max():.5g}")
            rows.append((f"{channel.topic}.{channel.name}", channel.unit, *figures, channel.meaning))
    print(_table(rows))
    if recording.controller:
        settings = ", ".join(f"{key} {value}" for key, value in recording.controller.items())
        print(textwrap.fill(f"controller: {settings}", 120, subsequent_indent="  "))
    return 0


def plot(parsed: Namespace) -> int:
    from rigtwin.plot import draw
    from rigtwin.recording import load

    recording = load(parsed.recording)
    out = _apart(parsed.out or parsed.recording.with_suffix(".png"), parsed.recording)
    draw(recording, out, parsed.start, parsed.until)
    print(f"drawn in {out}")
    return 0


def video(parsed: Namespace) -> int:
    from tqdm import tqdm

    from rigtwin.recording import load
    from rigtwin.video import film

    recording = load(parsed.recording)
    out = _apart(parsed.out or parsed.recording.with_suffix(".mp4"), parsed.recording)
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

    write(load(parsed.recording), _apart(parsed.out, parsed.recording))
    print(f"written to {parsed.out}")
    return 0


def compare(parsed: Namespace) -> int:
    from tqdm import tqdm

    from rigtwin.configuration import Configuration, Timing
    from rigtwin.diagnosis.compare import compare as replay_all
    from rigtwin.diagnosis.compare import compare_recordings, configuration_of, differences
    from rigtwin.diagnosis.replays import REPLAYS
    from rigtwin.effects import applied
    from rigtwin.parameters import Plant
    from rigtwin.recording import load

    recording = load(parsed.recording)
    if parsed.json is not None:
        _apart(parsed.json, parsed.recording, *([parsed.other] if parsed.other else []))
    if parsed.other is not None:
        if parsed.config is not None or parsed.set or parsed.effect:
            raise RigtwinError("--set, --config and --effect change the twin; two recordings are compared without one")
        other = load(parsed.other)
        results, left_out = compare_recordings(recording, other), {}
        notes = (*recording.notes, *other.notes, *differences(recording, other))
        print(f"{recording.path} against {parsed.other}, tick against tick")
    else:
        twin = applied(_configured(Configuration(), parsed), parsed.effect)
        besides = twin._replace(plant=Plant(), timing=twin.timing._replace(timestep=Timing().timestep))
        if besides != Configuration():
            raise RigtwinError("compare changes the plant and timing.timestep only; all other settings are the recording's own")
        configuration = configuration_of(recording, twin)
        with tqdm(total=len(REPLAYS), disable=None, desc="replaying", leave=False) as bar:
            comparison = replay_all(recording, configuration, lambda name: bar.update() and bar.set_postfix_str(name))
        results, left_out, notes = comparison.replays, comparison.left_out, comparison.notes
        print(f"{recording.path} against the twin; a ratio of 1 is noise alone")
    for note in notes:
        print(f"note: {note}")
    rows: list[tuple[str, ...]] = [("replay", "residual rms", "noise floor", "ratio", "most of it, Hz")]
    for name, result in results.items():
        rows.append(_row(name, result))
        rows += [_row(f"  {output}", part) for output, part in result.outputs.items()]
    print(_table(rows))
    for name, reason in left_out.items():
        print(f"{name}: left out; {reason}")
    if parsed.json is not None:
        document = {"recording": str(recording.path), "replays": {name: asdict(result) for name, result in results.items()}}
        _write_json(parsed.json, {**document, "left_out": left_out, "notes": list(notes)})
    return 0


def _row(name: str, result: Residual) -> tuple[str, ...]:
    unit = "floors" if result.unit == "1" else result.unit
    low, high = result.band_hz
    return (
        name,
        f"{result.residual:.3g} {unit}",
        f"{result.noise_floor:.3g} {unit}",
        f"{result.ratio:.3f}",
        f"{low:.3g} to {high:.3g}",
    )


def _finite(document: object) -> object:
    """The document with null for what is not a finite number, which JSON does not have."""
    if isinstance(document, float):
        return document if math.isfinite(document) else None
    if isinstance(document, dict):
        return {key: _finite(value) for key, value in document.items()}
    if isinstance(document, list | tuple):
        return [_finite(value) for value in document]
    return document


def _write_json(path: Path, document: object) -> None:
    try:
        path.write_text(json.dumps(_finite(document), indent=1, allow_nan=False) + "\n")
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None


def diagnose(parsed: Namespace) -> int:
    from tqdm import tqdm

    from experiments import EXPERIMENTS
    from rigtwin.configuration import Configuration, Timing
    from rigtwin.diagnosis.diagnose import diagnose as answer
    from rigtwin.diagnosis.text import described
    from rigtwin.effects import without
    from rigtwin.parameters import Plant
    from rigtwin.recording import load

    base = _configured(Configuration(), parsed)
    besides = base._replace(plant=Plant(), timing=base.timing._replace(timestep=Timing().timestep))
    if besides != Configuration():
        raise RigtwinError("diagnose changes the plant and timing.timestep only; all other settings are the recording's own")
    for name in parsed.without:
        base = without(base, name)
    inputs = [*parsed.recordings, *parsed.held_out]
    for out in (parsed.json, parsed.html, parsed.save_twin):
        if out is not None:
            _apart(out, *inputs)
            if not out.parent.is_dir():
                raise RigtwinError(f"cannot write {out}: its folder does not exist")
    if len({path.resolve() for path in inputs}) < len(inputs):
        raise RigtwinError("a recording is named twice; each counts once, and what is held out must not be fitted")
    recordings, held_out = [load(path) for path in parsed.recordings], [load(path) for path in parsed.held_out]
    tests = [(e.name, e.configuration, e.demands) for e in EXPERIMENTS.values() if e.name in NEXT_TESTS]
    with tqdm(disable=None, unit=" fits", desc="diagnosing", leave=False) as bar:

        def progress(stage: str, steps: int) -> None:
            bar.set_description(stage, refresh=False)
            bar.update(steps)

        outcome = answer(recordings, base, held_out, tests, progress)
    print(described(outcome.diagnosis))
    if parsed.json is not None:
        _write_json(parsed.json, outcome.diagnosis.document())
    if parsed.html is not None:
        from rigtwin.diagnosis.report import write

        write(parsed.html, outcome)
        print(f"report in {parsed.html}")
    if parsed.save_twin is not None:
        from rigtwin.diagnosis.calibrated import save

        save(parsed.save_twin, outcome)
        print(f"corrected twin in {parsed.save_twin}; use it with --config")
    return 1 if outcome.diagnosis.verdict == "unusable" else 0


NEXT_TESTS = ("imposed", "imposed-fast", "road10", "road1.6", "drop")
"""Experiments that a diagnosis may propose."""


def blindcheck(parsed: Namespace) -> int:
    from tqdm import tqdm

    from rigtwin.blindcheck.check import check
    from rigtwin.blindcheck.score import document, table

    if parsed.cases < 1 or parsed.seed < 0:
        raise RigtwinError("--cases must be at least 1, --seed at least 0")
    with tqdm(total=2 * parsed.cases, disable=None, unit="case", desc="withheld effects", leave=False) as bar:
        result = check(parsed.folder, parsed.cases, parsed.seed, parsed.baselines, bar.update)
    print(table(result))
    if parsed.json is not None:
        _write_json(parsed.json, document(result))
    return 0


def reproduce(parsed: Namespace) -> int:
    from tqdm import tqdm

    from experiments.studies import STUDIES

    if parsed.study not in STUDIES:
        raise RigtwinError(f"unknown study {parsed.study!r}; there are {', '.join(STUDIES)}")
    if parsed.seeds < 1:
        raise RigtwinError(f"--seeds {parsed.seeds}: expected 1 or more")
    with tqdm(total=parsed.seeds, disable=None, desc=parsed.study, leave=False, file=sys.stderr) as bar:
        print(STUDIES[parsed.study](parsed.seeds, parsed.out, bar.update))
    return 0


COMMANDS: dict[str, Callable[[Namespace], int]] = {
    "list": list_experiments,
    "run": run,
    "effects": effects,
    "info": info,
    "plot": plot,
    "video": video,
    "export": export,
    "compare": compare,
    "diagnose": diagnose,
    "blindcheck": blindcheck,
    "reproduce": reproduce,
}
