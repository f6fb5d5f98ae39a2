"""`rigtwin compare`: where a recording and the twin disagree."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.cli.options import add_effect, add_json, add_machine, add_settings, settings_of
from rigtwin.console import table, write_json
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    from rigtwin import Comparison, Recording
    from rigtwin.diagnosis.residual import Residual

SUMMARY = "replay each component of a recording on the twin and print the residuals"
MORE = """\
One recording: motor, carriage, mechanics, both cylinders, controller and closed loop, each driven
by measured signals; of another machine, signal by signal. A ratio of 1 means that noise is all that
is left. Two recordings: of one test, sensor by sensor.
--set, --config and --effect change the twin that it is compared with."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    parser.add_argument("other", type=Path, nargs="?", help="a second recording of the same test")
    add_json(parser, "the figures to a file")
    add_machine(parser)
    add_effect(parser, "compare with a twin that has an effect, e.g. coulomb@rail=80")
    add_settings(parser)


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    recording = rigtwin.load(parsed.recording, parsed.machine)
    left_out: Mapping[str, str] = {}
    if parsed.other is not None:
        if parsed.config is not None or parsed.set or parsed.effect:
            raise RigtwinError(
                "--set, --config and --effect change the twin; "
                "two recordings are compared without one"
            )
        # Its own machine is not asked for: `compare_recordings` refuses different ones.
        second = rigtwin.load(parsed.other)
        results, differences = rigtwin.compare_recordings(recording, second)
        notes = (*recording.notes, *second.notes, *differences)
        print(f"{recording.path} against {parsed.other}, tick against tick")
    else:
        comparison = _compare(recording, parsed)
        results, left_out, notes = comparison.replays, comparison.left_out, comparison.notes
        print(f"{recording.path} against the twin; a ratio of 1 is noise alone")
    for note in notes:
        print(f"note: {note}")
    rows: list[tuple[str, ...]] = [
        ("replay", "residual rms", "noise floor", "ratio", "most of it, Hz")
    ]
    for name, result in results.items():
        # Parts of a replay are indented below it.
        rows.append(_row(name, result))
        rows += [_row(f"  {output}", part) for output, part in result.outputs.items()]
    print(table(rows))
    for name, reason in left_out.items():
        print(f"{name}: left out; {reason}")
    if parsed.json is not None:
        replays = {name: asdict(result) for name, result in results.items()}
        document = {"recording": str(recording.path), "replays": replays}
        write_json(parsed.json, {**document, "left_out": left_out, "notes": list(notes)})
    return 0


def _compare(recording: Recording, parsed: argparse.Namespace) -> Comparison:
    from tqdm import tqdm

    import rigtwin

    with tqdm(disable=None, desc="replaying", leave=False) as bar:

        def progress(name: str) -> None:
            bar.update()
            bar.set_postfix_str(name)

        return rigtwin.compare(
            recording, settings=settings_of(parsed), effects=parsed.effect, progress=progress
        )


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
