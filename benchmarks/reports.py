"""Reports of every kind of answer, checked in a browser.

python -m benchmarks.reports OUT [FOLDER]

OUT gets every report as HTML, PDF and PNG, and a sheet of their first screens (sheet.png). FOLDER
holds one folder of data per real machine (docs/diagnosis.md names the sources). Without it only
tests of the twin are reported.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from PIL import Image

import rigtwin
from benchmarks.real_machines import judge
from rigtwin.description.catalogue import SHIPPED
from rigtwin.recording import RecordedTest
from tests.helpers.browser import looked_at
from tests.helpers.recordings import replace_sensors

WIDTHS = (1280, 390)
"""Widths of the windows, px: a screen and a telephone."""
COLUMNS = 4
"""Columns of the sheet."""


def recorded(**effects: float) -> RecordedTest:
    """Record 30 s of the suspension rig with some effects, named `kind_at_component`."""
    named = {name.replace("_at_", "@"): value for name, value in effects.items()}
    settings = {"timing": {"duration": 30.0}}
    return rigtwin.run("suspension-rig", "imposed", seed=4, settings=settings, effects=named)


def drifting() -> RecordedTest:
    """Return a recording with a drifting load cell, an effect without a name in the library."""
    sound = recorded()
    return replace_sensors(sound, load_cell=sound["/sensor.load_cell"] + 4.0 * sound.time)


def in_millimetres() -> RecordedTest:
    """Return a recording with one channel in the wrong unit."""
    sound = recorded()
    return replace_sensors(sound, suspension_lvdt=1e3 * sound["/sensor.suspension_lvdt"])


def arm(folder: Path) -> rigtwin.Diagnosis:
    """Return the diagnosis of the TX40 robot."""
    files = [folder / "tx40" / f"{name}_data.csv" for name in ("pos_read", "curr")]
    with tempfile.TemporaryDirectory() as work:
        made = rigtwin.import_data(files, SHIPPED / "maps/tx40.toml", Path(work) / "tx40.mcap")
        return rigtwin.diagnose(made)


RIG: dict[str, Callable[[], RecordedTest]] = {
    "one-effect": lambda: recorded(viscous_at_motor=50.0),
    "pair": lambda: recorded(viscous_at_motor=50.0, coulomb_at_rail=75.0),
    "unknown": drifting,
    "no-gap": recorded,
    "unusable": in_millimetres,
}
REAL: dict[str, Callable[[Path], rigtwin.Diagnosis]] = {
    "friction-damper": lambda folder: judge("damper-0", folder).answer,
    "emps": lambda folder: judge("emps", folder).answer,
    "tx40": arm,
}


def show(name: str, answer: rigtwin.Diagnosis, out: Path) -> None:
    """Write a report, check it in a browser, and print the result."""
    path = answer.report(out / f"{name}.html")
    page = path.read_text(encoding="utf-8")
    start = time.perf_counter()
    answer.report(out / f"{name}.pdf")
    seconds = time.perf_counter() - start
    answer.report(out / f"{name}.png")
    findings = []
    for width in WIDTHS:
        with tempfile.TemporaryDirectory() as folder:
            checked = looked_at(page, width, Path(folder))
        serious = ", ".join(checked["serious"]) or "nothing serious"
        findings.append(f"{width} px: {checked['wide']} wide, {checked['drawn']} drawn, {serious}")
    size = len(page.encode()) / 1e6
    print(f"{name}: {answer.verdict}, {size:.1f} MB, PDF in {seconds:.1f} s; {'; '.join(findings)}")


def lay_out(pictures: Sequence[Path], path: Path) -> None:
    """Write a sheet with the first screens of some reports."""
    width, height = 480, 600
    sheet = Image.new("RGB", (width * COLUMNS, height * -(-len(pictures) // COLUMNS)), "white")
    for number, path_of_picture in enumerate(pictures):
        with Image.open(path_of_picture) as picture:
            scale = width / picture.width
            shown = min(picture.height, round(height / scale))
            screen = picture.convert("RGB").crop((0, 0, picture.width, shown))
            size = (width, round(shown * scale))
            corner = (width * (number % COLUMNS), height * (number // COLUMNS))
            sheet.paste(screen.resize(size, Image.Resampling.LANCZOS), corner)
    sheet.quantize(128, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)


def main() -> None:
    """Print one line per report.

    Fails if the browser's console reports an error or a page requests anything from the network.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--only", nargs="+", default=[*RIG, *REAL], choices=[*RIG, *REAL])
    parsed = parser.parse_args()
    parsed.out.mkdir(parents=True, exist_ok=True)
    for name in parsed.only:
        if name in RIG:
            show(name, rigtwin.diagnose(RIG[name]()), parsed.out)
        elif parsed.folder is not None:
            show(name, REAL[name](parsed.folder), parsed.out)
    paths = [parsed.out / f"{name}.png" for name in (*RIG, *REAL)]
    pictures = [path for path in paths if path.exists()]
    lay_out(pictures, parsed.out / "sheet.png")


if __name__ == "__main__":
    main()
