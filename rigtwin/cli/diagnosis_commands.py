"""What the commands do that look for a gap: compare, diagnose. Imports stay inside, as in rigtwin.cli.commands."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rigtwin.console import apart, configured, table, writable, write_json
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin.description.machine import Machine
    from rigtwin.diagnosis.residual import Residual
    from rigtwin.recording import Recording


def compare(parsed: Namespace) -> int:
    from tqdm import tqdm

    from rigtwin.components import RigPlant
    from rigtwin.description.configuration import Configuration, Timing, applied
    from rigtwin.diagnosis.compare import compare as replay_all
    from rigtwin.diagnosis.compare import compare_recordings, configuration_of, differences
    from rigtwin.diagnosis.replays import REPLAYS
    from rigtwin.recording import load
    from rigtwin.recording.channels import SUSPENSION_RIG

    recording = load(parsed.recording)
    if parsed.other is None and recording.machine != SUSPENSION_RIG:
        return _compare_described(recording, parsed)
    if parsed.json is not None:
        apart(parsed.json, parsed.recording, *([parsed.other] if parsed.other else []))
    if parsed.other is not None:
        if parsed.config is not None or parsed.set or parsed.effect:
            raise RigtwinError(
                "--set, --config and --effect change the twin; two recordings are compared without one"
            )
        other = load(parsed.other)
        results, left_out = compare_recordings(recording, other), {}
        notes = (*recording.notes, *other.notes, *differences(recording, other))
        print(f"{recording.path} against {parsed.other}, tick against tick")
    else:
        twin = applied(configured(Configuration(), parsed), parsed.effect)
        besides = twin._replace(
            plant=RigPlant(), timing=twin.timing._replace(timestep=Timing().timestep)
        )
        if besides != Configuration():
            raise RigtwinError(
                "compare changes the plant and timing.timestep only; all other settings are the recording's own"
            )
        configuration = configuration_of(recording, twin)
        with tqdm(total=len(REPLAYS), disable=None, desc="replaying", leave=False) as bar:
            comparison = replay_all(
                recording, configuration, lambda name: bar.update() and bar.set_postfix_str(name)
            )
        results, left_out, notes = comparison.replays, comparison.left_out, comparison.notes
        print(f"{recording.path} against the twin; a ratio of 1 is noise alone")
    for note in notes:
        print(f"note: {note}")
    rows: list[tuple[str, ...]] = [
        ("replay", "residual rms", "noise floor", "ratio", "most of it, Hz")
    ]
    for name, result in results.items():
        rows.append(_row(name, result))
        rows += [_row(f"  {output}", part) for output, part in result.outputs.items()]
    print(table(rows))
    for name, reason in left_out.items():
        print(f"{name}: left out; {reason}")
    if parsed.json is not None:
        document = {
            "recording": str(recording.path),
            "replays": {name: asdict(result) for name, result in results.items()},
        }
        write_json(parsed.json, {**document, "left_out": left_out, "notes": list(notes)})
    return 0


def _compare_described(recording: Recording, parsed: Namespace) -> int:
    """A recording of a described machine against its twin, signal by signal."""
    from rigtwin.diagnosis.data_checks import faults_of
    from rigtwin.diagnosis.evidence import Evidence
    from rigtwin.diagnosis.residual import single
    from rigtwin.models.replaying import setup_of

    if parsed.effect:
        raise RigtwinError(
            "--effect is for the suspension rig; give another machine's values with --set component.parameter=value"
        )
    machine = machine_of(recording, parsed.machine)
    setup = setup_of(machine, recording, base_of(machine, parsed))
    for fault in faults_of(machine, recording, setup):
        if fault.fatal:
            raise RigtwinError(f"{recording.path}: {fault.message}")
        print(f"note: {fault.message}")
    evidence = Evidence(machine, [recording], [setup])
    each, difference = (
        evidence.lines[0],
        evidence.lines[0].measured - evidence.predicted(setup.plant)[0],
    )
    print(f"{recording.path} against the twin of {machine.name}; a ratio of 1 is noise alone")
    results = {}
    for number, row in enumerate(machine.rows):
        counted = each.fade[number] > 0.5
        results[row.name] = single(
            difference[number][counted], float(each.noise[number]), row.unit, recording.period
        )
    print(
        table(
            [
                ("signal", "residual rms", "noise floor", "ratio", "most of it, Hz"),
                *(_row(*item) for item in results.items()),
            ]
        )
    )
    if parsed.json is not None:
        apart(parsed.json, parsed.recording)
        document = {
            "recording": str(recording.path),
            "signals": {name: asdict(each) for name, each in results.items()},
        }
        write_json(parsed.json, document)
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
    from rigtwin.diagnosis.diagnose import diagnose as answer
    from rigtwin.diagnosis.text import described
    from rigtwin.recording import load
    from rigtwin.recording.channels import SUSPENSION_RIG

    inputs = [*parsed.recordings, *parsed.held_out]
    for out in (parsed.json, parsed.html, parsed.save_twin):
        if out is not None:
            apart(out, *inputs)
            writable(out)
    if len({path.resolve() for path in inputs}) < len(inputs):
        raise RigtwinError(
            "a recording is named twice; each counts once, and what is held out must not be fitted"
        )
    recordings, held_out = (
        [load(path) for path in parsed.recordings],
        [load(path) for path in parsed.held_out],
    )
    machine = machine_of(recordings[0], parsed.machine)
    base = base_of(machine, parsed)
    menu = EXPERIMENTS.values() if machine.name == SUSPENSION_RIG else ()
    tests = [(e.name, e.configuration, e.demands) for e in menu if e.name in NEXT_TESTS]
    with tqdm(disable=None, unit=" fits", desc="diagnosing", leave=False) as bar:

        def progress(stage: str, steps: int) -> None:
            bar.set_description(stage, refresh=False)
            bar.update(steps)

        outcome = answer(machine, recordings, base, held_out, tests, progress)
    # Files first: whoever reads the terminal may stop reading.
    said = [described(outcome.diagnosis)]
    if parsed.json is not None:
        write_json(parsed.json, outcome.diagnosis.document())
    if parsed.html is not None:
        from rigtwin.diagnosis.report import write

        write(parsed.html, outcome)
        said.append(f"report in {parsed.html}")
    if parsed.save_twin is not None and outcome.evidence is not None:
        from rigtwin.diagnosis.calibrated import save

        save(parsed.save_twin, outcome)
        said.append(f"corrected twin in {parsed.save_twin}; use it with --config")
    elif parsed.save_twin is not None:
        said.append(f"{parsed.save_twin} not written: the data cannot be diagnosed")
    print("\n".join(said))
    return 1 if outcome.diagnosis.verdict == "unusable" else 0


def machine_of(recording: Recording, described: str | None) -> Machine:
    """The machine that a recording is of, or that of a description."""
    from rigtwin.description.catalogue import find, shipped

    if described is not None:
        return find(described)
    if recording.machine not in shipped():
        known = ", ".join(shipped())
        raise RigtwinError(
            f"{recording.path}: it is of machine {recording.machine!r}; give its description with --machine F.toml "
            f"(shipped ones: {known})"
        )
    return find(recording.machine)


def base_of(machine: Machine, parsed: Namespace) -> Any:
    """The twin that recordings are compared with, as the command line has it: a Configuration, or a Setup of a described
    machine."""
    from rigtwin.components import RigPlant
    from rigtwin.description import setting
    from rigtwin.description.configuration import Configuration, Timing, without
    from rigtwin.recording.channels import SUSPENSION_RIG

    if machine.name != SUSPENSION_RIG:
        setup = setting.nominal(machine)
        if parsed.config is not None:
            setup = setting.from_toml(setup, parsed.config)
        setup = setting.from_assignments(setup, parsed.set)
        for name in getattr(parsed, "without", []):
            setup = setting.without(setup, name)
        return setup
    base = configured(Configuration(), parsed)
    besides = base._replace(
        plant=RigPlant(), timing=base.timing._replace(timestep=Timing().timestep)
    )
    if besides != Configuration():
        raise RigtwinError(
            "diagnose changes the plant and timing.timestep only; all other settings are the recording's own"
        )
    for name in getattr(parsed, "without", []):
        base = without(base, name)
    return base


NEXT_TESTS = ("imposed", "imposed-fast", "road10", "road1.6", "drop")
"""Experiments that a diagnosis may propose."""
