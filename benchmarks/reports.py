"""Reports of every sort of answer, opened in a browser:
`python -m benchmarks.reports OUT [FOLDER]`.

OUT gets each as HTML, PDF and PNG, and a sheet of their first screens (sheet.png). FOLDER holds the
data of real machines, a folder each (docs/diagnosis.md says where they are from); without it the
twin's own tests are all there is.
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
from rigtwin.recording import Recording
from tests.helpers.browser import looked_at
from tests.helpers.recordings import replace_sensors

WIDTHS = (1280, 390)
"""Of the windows, px: a screen and a telephone."""
COLUMNS = 4
"""Of the sheet."""


def recorded(**effects: float) -> Recording:
    """30 s of the suspension rig."""
    named = {name.replace("_at_", "@"): value for name, value in effects.items()}
    settings = {"timing": {"duration": 30.0}}
    return rigtwin.run("suspension-rig", "imposed", seed=4, settings=settings, effects=named)


def drifting() -> Recording:
    """Of a load cell that drifts, which nothing in the library stands for."""
    sound = recorded()
    return replace_sensors(sound, load_cell=sound["/sensor.load_cell"] + 4.0 * sound.time)


def in_millimetres() -> Recording:
    sound = recorded()
    return replace_sensors(sound, suspension_lvdt=1e3 * sound["/sensor.suspension_lvdt"])


def arm(folder: Path) -> rigtwin.Diagnosis:
    files = [folder / "tx40" / f"{name}_data.csv" for name in ("pos_read", "curr")]
    with tempfile.TemporaryDirectory() as work:
        made = rigtwin.import_data(files, SHIPPED / "maps/tx40.toml", Path(work) / "tx40.mcap")
        return rigtwin.diagnose(made)


RIG: dict[str, Callable[[], Recording]] = {
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
    """Writes a report, opens it, and prints what came of it."""
    path = answer.report(out / f"{name}.html")
    page = path.read_text(encoding="utf-8")
    began = time.perf_counter()
    answer.report(out / f"{name}.pdf")
    seconds = time.perf_counter() - began
    answer.report(out / f"{name}.png")
    said = []
    for width in WIDTHS:
        with tempfile.TemporaryDirectory() as folder:
            seen = looked_at(page, width, Path(folder))
        serious = ", ".join(seen["serious"]) or "nothing serious"
        said.append(f"{width} px: {seen['wide']} wide, {seen['drawn']} drawn, {serious}")
    size = len(page.encode()) / 1e6
    print(f"{name}: {answer.verdict}, {size:.1f} MB, PDF in {seconds:.1f} s; {'; '.join(said)}")


def lay_out(pictures: Sequence[Path], path: Path) -> None:
    """The first screens of reports side by side."""
    width, height = 480, 600
    sheet = Image.new("RGB", (width * COLUMNS, height * -(-len(pictures) // COLUMNS)), "white")
    for number, each in enumerate(pictures):
        with Image.open(each) as picture:
            scale = width / picture.width
            shown = min(picture.height, round(height / scale))
            screen = picture.convert("RGB").crop((0, 0, picture.width, shown))
            size = (width, round(shown * scale))
            place = (width * (number % COLUMNS), height * (number // COLUMNS))
            sheet.paste(screen.resize(size, Image.Resampling.LANCZOS), place)
    sheet.quantize(128, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)


def main() -> None:
    """Prints a line a report. Fails if the browser's console has an error, or a page asks for
    anything from elsewhere."""
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
    made = [each for name in (*RIG, *REAL) if (each := parsed.out / f"{name}.png").exists()]
    lay_out(made, parsed.out / "sheet.png")


if __name__ == "__main__":
    main()
