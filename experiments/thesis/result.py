"""The thesis reproduced: does the jobs of what was asked for, and holds what was concluded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from experiments.thesis import reproduction
from experiments.thesis.catalogue import asked
from experiments.thesis.reproduction import Chapter, cut
from experiments.thesis.work import done
from rigtwin.errors import RigtwinError
from rigtwin.render.plot import check_ending, save
from rigtwin.studies.sweep import Workers

MOST_SEEDS = 1000


@dataclass(frozen=True)
class Reproduction:
    """What was asked for of the thesis, beside ours. every: whether that was everything."""

    chapters: tuple[Chapter, ...]
    every: bool

    def text(self) -> str:
        """Everything as plain text."""
        return reproduction.text(self.chapters, self.every)

    def document(self) -> dict[str, object]:
        """Everything for other programs."""
        return reproduction.document(self.chapters, self.every)

    def page(self, out: str | Path) -> Path:
        """Writes everything as one HTML file. Raises RigtwinError if it cannot."""
        try:
            Path(out).write_text(reproduction.page(self.chapters, self.every), encoding="utf-8")
        except OSError as error:
            raise RigtwinError(f"cannot write {out}: {error.strerror}") from None
        return Path(out)

    def gallery(self, folder: str | Path) -> Path:
        """Writes gallery.md and its pictures into a folder. Raises RigtwinError if it cannot."""
        return reproduction.gallery(self.chapters, Path(folder), self.every)

    def draw(self, folder: str | Path) -> dict[Path, str]:
        """Draws every figure into a folder.

        Parameters
        ----------
        folder
            It is made.

        Returns
        -------
        dict
            File → what of the thesis it covers.

        Raises
        ------
        RigtwinError
            If it cannot be written.
        """
        drawn: dict[Path, str] = {}
        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RigtwinError(f"cannot write {folder}: {error.strerror}") from None
        for chapter in self.chapters:
            for drawing in chapter.conclusion.drawings:
                out = Path(folder) / f"{chapter.study.name}-{drawing.name}.png"
                check_ending(out)
                save(drawing.figure, out)
                drawn[out] = drawing.covers
        return drawn


def reproduce(
    what: str | None,
    seeds: int,
    folder: Path,
    workers: Workers,
    progress: Callable[[int, int], object] = lambda *_: None,
) -> Reproduction:
    """Runs the studies asked for; a second run goes on where the first was stopped.

    Parameters
    ----------
    what
        A chapter, study, table, figure or equation; None for everything.
    seeds
        Roads and noise to judge over.
    folder
        Of the results.
    workers
        That do the jobs.
    progress
        Called with the jobs done and with how many there are.

    Raises
    ------
    RigtwinError
        If nothing is called that, for a number of seeds that makes no sense, or if the folder
        cannot be written.
    """
    wanted = asked(what)
    if not 1 <= seeds <= MOST_SEEDS:
        raise RigtwinError(f"--seeds {seeds}: expected 1 to {MOST_SEEDS}")
    results = done(wanted.studies, seeds, folder, workers, progress)
    return Reproduction(
        tuple(cut(study, study.conclude(results[study.name]), wanted) for study in wanted.studies),
        what is None,
    )
