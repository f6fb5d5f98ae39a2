"""Catalogue of the studies and tables of the thesis."""

from __future__ import annotations

from dataclasses import dataclass

from experiments.rths import study as rths
from experiments.thesis import (
    beams,
    friction_compensation,
    identification,
    quarter_car_stability,
    quarter_car_tests,
    root_loci,
    similitude,
    single_mass_stability,
    skyhook,
    validation,
    vehicles_stability,
)
from experiments.thesis.study import ThesisStudy, span
from rigtwin.errors import RigtwinError

STUDIES: dict[str, ThesisStudy] = {
    module.STUDY.name: module.STUDY
    for module in (
        similitude,
        validation,
        friction_compensation,
        single_mass_stability,
        quarter_car_stability,
        root_loci,
        identification,
        vehicles_stability,
        quarter_car_tests,
        skyhook,
        beams,
    )
}
BENCHMARKS: dict[str, ThesisStudy] = {rths.STUDY.name: rths.STUDY}
"""Studies of benchmarks other than the thesis. They run only if requested by name."""
TABLES = (
    *("Table 2.1",),
    *span("Table", "3.", 1, 5),
    *span("Table", "4.", 1, 2),
    *span("Table", "5.", 1, 13),
    *span("Table", "6.", 1, 5),
    *span("Table", "7.", 1, 5),
    *(table for part in ("A1.", "A2.", "A3.") for table in span("Table", part, 1, 5)),
    *(f"Table B{part}.1" for part in range(1, 6)),
)
"""Every numbered table of the thesis."""
# A test holds the studies to this list: every table is covered, or named below.
NOTHING_TO_COMPUTE = {
    "Table 2.1": "compares fluids of dampers from the literature; nothing of it is of the rig"
}
"""Tables without a computable result, with the reason."""


@dataclass(frozen=True)
class ThesisSelection:
    """Part of the thesis to reproduce.

    Attributes
    ----------
    studies : tuple of Study
        Studies that cover it.
    where : str or None
        Table, figure or equation to restrict the studies to. None keeps all of them.
    """

    studies: tuple[ThesisStudy, ...]
    where: str | None


def select_studies(name: str | None) -> ThesisSelection:
    """Return the studies of a name.

    The name is a study, a chapter (`5`, `A`), a table, figure or equation (`table-5.1`,
    `figure 6.26`), or None for the whole thesis. Raises RigtwinError, listing the chapters and
    studies, for an unknown name.
    """
    if name is None:
        return ThesisSelection(tuple(STUDIES.values()), None)
    if name in STUDIES:
        return ThesisSelection((STUDIES[name],), None)
    if name in BENCHMARKS:
        return ThesisSelection((BENCHMARKS[name],), None)
    # Accept `5`, `chapter 5`, `Chapter-5` and `appendix A` alike.
    plain = name.strip().lower().removeprefix("chapter").removeprefix("appendix").strip(" -")
    chapter = tuple(study for study in STUDIES.values() if plain in study.chapter.lower().split())
    if chapter:
        return ThesisSelection(chapter, None)
    # table-5.1, `Table 5.1` and `table 5.1` name the same.
    wanted = " ".join(name.replace("-", " ").split()).lower()
    for study in STUDIES.values():
        for covered in study.covers:
            if covered.lower() == wanted:
                return ThesisSelection((study,), covered)
    for table, reason in NOTHING_TO_COMPUTE.items():
        if table.lower() == wanted:
            raise RigtwinError(f"{table} {reason}")
    chapters = sorted({part for study in STUDIES.values() for part in study.chapter.split()})
    raise RigtwinError(
        f"nothing to reproduce under {name!r}; there are chapters "
        f"{', '.join(chapters)}, studies {', '.join([*STUDIES, *BENCHMARKS])}, "
        "and tables, figures and equations such as table-5.1, figure-6.26, equation-6.1"
    )


def covers_figure(covers: str, where: str) -> bool:
    """Return whether a drawing covers a figure.

    A drawing that covers `Figure 3.11 to 3.14, B1.1` covers `Figure 3.12` and `Figure B1.1`.
    """
    kind, _, number = where.partition(" ")
    kind_of_part = ""
    for part in covers.replace(" and ", ", ").split(", "):
        first_word, _, rest = part.partition(" ")
        # `Figure 7.7, B1.1`: a part without a kind has the kind of the part before it.
        kind_of_part, places = (
            (first_word, rest) if first_word in ("Figure", "Table") else (kind_of_part, part)
        )
        first, _, last = places.partition(" to ")
        if kind_of_part == kind and (number == first or (last and _between(number, first, last))):
            return True
    return False


def _between(number: str, first: str, last: str) -> bool:
    """Return whether `3.12` lies between `3.11` and `3.14`."""
    (group, _, place), (start_group, _, start), (_, _, end) = (
        text.rpartition(".") for text in (number, first, last)
    )
    return (
        group == start_group
        and place.isdigit()
        and start.isdigit()
        and end.isdigit()
        and int(start) <= int(place) <= int(end)
    )
