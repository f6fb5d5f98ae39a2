"""`rigtwin diagnose`: why recordings and the twin disagree."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigtwin.cli.options import (
    add_columns,
    add_held_out,
    add_json,
    add_machine,
    add_settings,
    add_without,
    add_workers,
    counting_bar,
    read_recordings,
    settings_of,
)
from rigtwin.console import writable, write_json
from rigtwin.diagnosis.thresholds import STANDARD
from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    import rigtwin

SUMMARY = "say why recordings of one machine and the twin disagree"
MORE = """\
Checks the data, fits every effect that the twin knows, and says which explains the gap, how sure
that is, where it lies, and how far the gap shrinks on data that were not fitted; or that there is
no gap, or none that it knows. With a model (MJCF or URDF) as the machine, the recordings are logs
of other programs; what is taken for what is printed first, and --column corrects it.

examples:
  rigtwin diagnose rig.mcap --html report.html --save-twin calibrated.toml
  rigtwin diagnose log.csv --machine arm.xml
  rigtwin diagnose monday.mcap tuesday.mcap --held-out wednesday.mcap
  rigtwin diagnose monday.mcap friday.mcap --changed
  rigtwin diagnose tests/*.mcap --each answers
  rigtwin compare rig.mcap --config calibrated.toml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recordings",
        type=Path,
        nargs="+",
        metavar="recording",
        help="recordings of one machine, explained together unless --each",
    )
    add_json(parser, "the answer for other programs")
    parser.add_argument(
        "--html", type=Path, metavar="F.html", help="also write a report to look at, one file"
    )
    for kind in ("pdf", "png"):
        parser.add_argument(
            f"--{kind}",
            type=Path,
            metavar=f"F.{kind}",
            help=f"the same report as {kind.upper()}, printed by Chrome, Chromium or Edge",
        )
    _add_scope(parser)
    parser.add_argument(
        "--save-twin", type=Path, metavar="F.toml", help="write the corrected twin, for --config"
    )
    parser.add_argument(
        "--save-mjcf",
        type=Path,
        metavar="F.xml",
        help="write the machine's own MJCF with the corrected values, nothing else changed",
    )
    parser.add_argument(
        "--changed",
        action="store_true",
        help="find what changed between the recordings instead; give them in order of time",
    )
    parser.add_argument(
        "--each",
        type=Path,
        metavar="FOLDER",
        help="diagnose each recording by itself, and keep all answers in this folder; a second "
        "call continues where the first was stopped",
    )
    add_workers(parser)
    add_machine(parser)
    add_columns(parser)
    add_settings(parser)


def _add_scope(parser: argparse.ArgumentParser) -> None:
    """Add the options that say what is searched for, and what is judged on."""
    add_without(parser)
    parser.add_argument(
        "--exclude",
        action="append",
        default=[],
        metavar="EFFECT",
        help="effect not to search for, e.g. delay@motor, or delay for every component",
    )
    add_held_out(parser)
    parser.add_argument(
        "--effort",
        type=float,
        metavar="SECONDS",
        help="estimated processor time after which the search tries no further hypothesis; "
        f"default {STANDARD.effort:.0f}",
    )


def execute(parsed: argparse.Namespace) -> int:
    from tqdm import tqdm

    import rigtwin

    if parsed.each is not None:
        return _diagnose_each(parsed)
    # They would silently do nothing otherwise.
    if parsed.workers is not None or parsed.cluster is not None:
        raise RigtwinError("--workers and --cluster: of --each; one diagnosis uses all cores")
    begun = time.perf_counter()
    reports = _check_outputs(parsed)
    recordings, held_out = read_recordings(parsed)
    with tqdm(disable=None, unit=" fits", desc="diagnosing", leave=False) as bar:

        def progress(stage: str, steps: int) -> None:
            bar.set_description(stage, refresh=False)
            bar.update(steps)

        def show(look: rigtwin.FirstLook) -> None:
            seconds = time.perf_counter() - begun
            bar.write(f"first look, {seconds:.1f} s: {look}", file=sys.stderr)

        options: dict[str, Any] = {
            "settings": settings_of(parsed),
            "without": parsed.without,
            "exclude": parsed.exclude,
            "progress": progress,
        }
        if parsed.changed:
            if parsed.effort is not None:
                raise RigtwinError("--changed does not search for effects; leave out --effort")
            changes = rigtwin.what_changed(recordings, **options)
            if parsed.json is not None:
                write_json(parsed.json, changes.document())
            # The bar is removed before the answer is printed in its place.
            bar.close()
            print(changes)
            return 0
        if parsed.effort is not None:
            options["effort"] = parsed.effort
        diagnosis = rigtwin.diagnose(recordings, held_out=held_out, first_look=show, **options)
    print("\n".join(_write_files(parsed, diagnosis, reports)))
    return 1 if diagnosis.verdict == "unusable" else 0


def _check_outputs(parsed: argparse.Namespace) -> list[Path]:
    """Return the paths of the reports. Raise RigtwinError for outputs that cannot be written."""
    from rigtwin.render.browser import find_browser

    reports = [each for each in (parsed.html, parsed.pdf, parsed.png) if each is not None]
    outputs = (parsed.json, parsed.save_twin, parsed.save_mjcf, *reports)
    if parsed.changed and (parsed.held_out or any(outputs[1:])):
        raise RigtwinError(
            "--changed compares recordings and writes --json only; "
            "leave out --held-out, --html, --pdf, --png, --save-twin and --save-mjcf"
        )
    for out in outputs:
        if out is not None:
            writable(out)
    for name, ending in (("pdf", ".pdf"), ("png", ".png")):
        out = getattr(parsed, name)
        if out is not None:
            if out.suffix.lower() != ending:
                raise RigtwinError(f"--{name} {out}: expected a name that ends in {ending}")
            # A missing browser is said now, not after minutes of fits.
            find_browser()
    return reports


def _write_files(
    parsed: argparse.Namespace, diagnosis: rigtwin.Diagnosis, reports: Sequence[Path]
) -> list[str]:
    """Write the files that were asked for; return the lines to print."""
    # Files first: whoever reads the terminal may stop reading.
    said = [str(diagnosis)]
    if parsed.json is not None:
        write_json(parsed.json, diagnosis.document())
    said += [f"report in {diagnosis.report(each)}" for each in reports]
    if parsed.save_twin is not None and diagnosis.verdict != "unusable":
        twin = diagnosis.save_twin(parsed.save_twin)
        said.append(f"corrected twin in {twin}; use it with --config")
    elif parsed.save_twin is not None:
        said.append(f"{parsed.save_twin} not written: the data cannot be diagnosed")
    if parsed.save_mjcf is not None and diagnosis.effects:
        omitted = diagnosis.save_mjcf(parsed.save_mjcf)
        said.append(f"corrected MJCF in {parsed.save_mjcf}")
        said += [f"  not in it, as MJCF has no attribute for it: {each}" for each in omitted]
    elif parsed.save_mjcf is not None:
        said.append(f"{parsed.save_mjcf} not written: there is nothing to correct")
    return said


def _diagnose_each(parsed: argparse.Namespace) -> int:
    """1 if one of them has no answer, else 0."""
    import rigtwin
    from rigtwin.api.each import TABLE

    alone = (parsed.json, parsed.html, parsed.pdf, parsed.png, parsed.save_twin, parsed.save_mjcf)
    if parsed.exclude:
        raise RigtwinError(
            "--exclude: of one diagnosis; for --each, list the effects of a component in its "
            "description, effects = [...]"
        )
    if parsed.changed or parsed.held_out or parsed.effort is not None or any(alone):
        raise RigtwinError(
            "--each keeps its answers in its folder; leave out --held-out, --effort, --changed, "
            "--json, --html, --pdf, --png, --save-twin and --save-mjcf"
        )
    with counting_bar("recording", "diagnose") as progress:
        answers = rigtwin.diagnose_each(
            parsed.recordings,
            parsed.each,
            machine=parsed.machine,
            settings=settings_of(parsed),
            without=parsed.without,
            workers=parsed.workers,
            cluster=parsed.cluster,
            progress=progress,
        )
    for answer in answers:
        print(answer)
    print(f"{len(answers)} recordings; answers in {parsed.each / TABLE}")
    missing = [
        each for each in answers if each.document is None or each.document["verdict"] == "unusable"
    ]
    if missing:
        print(
            f"rigtwin: {len(missing)} of {len(answers)} recordings have no answer, see above",
            file=sys.stderr,
        )
    return 1 if missing else 0
