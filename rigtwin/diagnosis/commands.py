"""What the commands do that look for a gap: compare, diagnose, blindcheck. Imports stay inside, as in rigtwin.commands."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from typing import TYPE_CHECKING

from rigtwin.console import apart, configured, table, write_json
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin.diagnosis.residual import Residual


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
        apart(parsed.json, parsed.recording, *([parsed.other] if parsed.other else []))
    if parsed.other is not None:
        if parsed.config is not None or parsed.set or parsed.effect:
            raise RigtwinError("--set, --config and --effect change the twin; two recordings are compared without one")
        other = load(parsed.other)
        results, left_out = compare_recordings(recording, other), {}
        notes = (*recording.notes, *other.notes, *differences(recording, other))
        print(f"{recording.path} against {parsed.other}, tick against tick")
    else:
        twin = applied(configured(Configuration(), parsed), parsed.effect)
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
    print(table(rows))
    for name, reason in left_out.items():
        print(f"{name}: left out; {reason}")
    if parsed.json is not None:
        document = {"recording": str(recording.path), "replays": {name: asdict(result) for name, result in results.items()}}
        write_json(parsed.json, {**document, "left_out": left_out, "notes": list(notes)})
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


def diagnose(parsed: Namespace) -> int:
    from tqdm import tqdm

    from experiments import EXPERIMENTS
    from rigtwin.configuration import Configuration, Timing
    from rigtwin.diagnosis.diagnose import diagnose as answer
    from rigtwin.diagnosis.text import described
    from rigtwin.effects import without
    from rigtwin.parameters import Plant
    from rigtwin.recording import load

    base = configured(Configuration(), parsed)
    besides = base._replace(plant=Plant(), timing=base.timing._replace(timestep=Timing().timestep))
    if besides != Configuration():
        raise RigtwinError("diagnose changes the plant and timing.timestep only; all other settings are the recording's own")
    for name in parsed.without:
        base = without(base, name)
    inputs = [*parsed.recordings, *parsed.held_out]
    for out in (parsed.json, parsed.html, parsed.save_twin):
        if out is not None:
            apart(out, *inputs)
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
        write_json(parsed.json, outcome.diagnosis.document())
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
    from rigtwin.blindcheck.score import document
    from rigtwin.blindcheck.score import table as scores

    if parsed.cases < 1 or parsed.seed < 0:
        raise RigtwinError("--cases must be at least 1, --seed at least 0")
    with tqdm(total=2 * parsed.cases, disable=None, unit="case", desc="withheld effects", leave=False) as bar:
        result = check(parsed.folder, parsed.cases, parsed.seed, parsed.baselines, bar.update)
    print(scores(result))
    if parsed.json is not None:
        write_json(parsed.json, document(result))
    return 0
