"""`rigtwin reproduce`: does the jobs of what was asked for, then prints and draws what was
concluded."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from tqdm import tqdm

from experiments.thesis.catalogue import asked
from experiments.thesis.reproduction import Chapter, cut, document, gallery, page, text
from experiments.thesis.work import done
from rigtwin.console import writable, write_json
from rigtwin.errors import RigtwinError
from rigtwin.render.plot import check_ending, save
from rigtwin.studies.sweep import open_workers

MOST_SEEDS = 1000


def reproduce(parsed: Namespace) -> int:
    """Runs the studies asked for; a second run goes on where the first was stopped."""
    wanted = asked(" ".join(parsed.what) or None)
    if not 1 <= parsed.seeds <= MOST_SEEDS:
        raise RigtwinError(f"--seeds {parsed.seeds}: expected 1 to {MOST_SEEDS}")
    for out in (parsed.json, parsed.html):
        if out is not None:
            writable(out)
    pictures = parsed.draw or parsed.folder / "figures"
    if pictures.exists() and not pictures.is_dir():
        raise RigtwinError(f"cannot draw into {pictures}: it is a file")
    with (
        open_workers(parsed.workers, parsed.cluster) as workers,
        tqdm(disable=None, desc="reproduce", unit="job", leave=False, file=sys.stderr) as bar,
    ):

        def progress(count: int, total: int) -> None:
            bar.total = total
            bar.update(count - bar.n)

        results = done(wanted.studies, parsed.seeds, parsed.folder, workers, progress)
    chapters = [cut(study, study.conclude(results[study.name]), wanted) for study in wanted.studies]
    every = len(parsed.what) == 0
    print(text(chapters, every))
    if parsed.json is not None:
        write_json(parsed.json, document(chapters, every))
    if parsed.html is not None:
        try:
            parsed.html.write_text(page(chapters, every), encoding="utf-8")
        except OSError as error:
            raise RigtwinError(f"cannot write {parsed.html}: {error.strerror}") from None
        print(f"\nlook at {parsed.html}")
    drawn = _draw(chapters, pictures)
    if len(drawn) == 1:
        print(f"\n{drawn[0][0]} drawn in {drawn[0][1]}")
    elif drawn:
        print(f"\n{len(drawn)} figures drawn in {pictures}")
    if parsed.gallery is not None:
        print(f"\ngallery in {gallery(chapters, parsed.gallery, every)}")
    return 0


def _draw(chapters: list[Chapter], folder: Path) -> list[tuple[str, Path]]:
    """Draws every figure; what each covers, and its file."""
    drawn: list[tuple[str, Path]] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigtwinError(f"cannot write {folder}: {error.strerror}") from None
    for chapter in chapters:
        for drawing in chapter.conclusion.drawings:
            out = folder / f"{chapter.study.name}-{drawing.name}.png"
            check_ending(out)
            save(drawing.figure, out)
            drawn.append((drawing.covers, out))
    return drawn
