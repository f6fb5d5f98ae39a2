"""The reproduction of the thesis: running the requested studies and writing the results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from experiments.thesis import reproduction
from experiments.thesis.catalogue import select_studies
from experiments.thesis.reproduction import Chapter, restrict
from experiments.thesis.work import run_studies
from rigtwin.errors import RigtwinError
from rigtwin.render.plot import check_ending, save
from rigtwin.studies.sweep import Workers

MOST_SEEDS = 1000
"""Largest number of seeds."""


@dataclass(frozen=True)
class Reproduction:
    """Requested parts of the thesis beside the computed results.

    Attributes
    ----------
    chapters : tuple of Chapter
        Studies with their conclusions.
    every : bool
        Whether the whole thesis was requested.
    """

    chapters: tuple[Chapter, ...]
    every: bool

    def text(self) -> str:
        """Return all results as plain text."""
        return reproduction.text(self.chapters, self.every)

    def document(self) -> dict[str, object]:
        """Return all results as a JSON document."""
        return reproduction.document(self.chapters, self.every)

    def page(self, out: str | Path) -> Path:
        """Write all results as one HTML file. Raises RigtwinError if it cannot be written."""
        try:
            Path(out).write_text(reproduction.page(self.chapters, self.every), encoding="utf-8")
        except OSError as error:
            raise RigtwinError(f"cannot write {out}: {error.strerror}") from None
        return Path(out)

    def gallery(self, folder: str | Path) -> Path:
        """Write gallery.md and its pictures. Raises RigtwinError if writing fails."""
        return reproduction.gallery(self.chapters, Path(folder), self.every)

    def draw(self, folder: str | Path) -> dict[Path, str]:
        """Draw every figure into a folder.

        Parameters
        ----------
        folder : str or Path
            Folder, created if it does not exist.

        Returns
        -------
        dict
            Path of a file → figures of the thesis that it covers.

        Raises
        ------
        RigtwinError
            The folder cannot be written.
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
    part: str | None,
    seeds: int,
    folder: Path,
    workers: Workers,
    progress: Callable[[int, int], object] = lambda *_: None,
) -> Reproduction:
    """Run the requested studies. A second run resumes an interrupted one.

    Parameters
    ----------
    part : str or None
        Chapter, study, table, figure or equation to reproduce. None reproduces everything.
    seeds : int
        Number of seeds of roads and noise, 1 to 1000.
    folder : Path
        Folder of the stored results.
    workers : Workers
        Processes that run the jobs.
    progress : callable
        Function called with the number of finished jobs and their total.

    Returns
    -------
    Reproduction
        Conclusions of the studies, restricted to the requested part.

    Raises
    ------
    RigtwinError
        If the part or the number of seeds is invalid, or the folder cannot be written.
    """
    wanted = select_studies(part)
    if not 1 <= seeds <= MOST_SEEDS:
        raise RigtwinError(f"--seeds {seeds}: expected 1 to {MOST_SEEDS}")
    results = run_studies(wanted.studies, seeds, folder, workers, progress)
    return Reproduction(
        tuple(
            restrict(study, study.conclude(results[study.name]), wanted) for study in wanted.studies
        ),
        part is None,
    )
