"""The thesis' studies and tables, by name."""

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
from experiments.thesis.study import Study, span
from rigtwin.errors import RigtwinError

STUDIES: dict[str, Study] = {
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
BENCHMARKS: dict[str, Study] = {rths.STUDY.name: rths.STUDY}
"""Studies of what others published beside the thesis; each only where it is asked for by name."""
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
NOTHING_TO_COMPUTE = {
    "Table 2.1": "compares fluids of dampers from the literature; nothing of it is of the rig"
}


@dataclass(frozen=True)
class Asked:
    """What of the thesis to reproduce. where: the tables or figures asked for alone, or None for
    all of the studies."""

    studies: tuple[Study, ...]
    where: str | None


def asked(name: str | None) -> Asked:
    """Of a study's name, a chapter (`5`, `A`), a table, figure or equation (`table-5.1`, `figure
    6.26`), or None for all.

    Raises RigtwinError listing what there is.
    """
    if name is None:
        return Asked(tuple(STUDIES.values()), None)
    if name in STUDIES:
        return Asked((STUDIES[name],), None)
    if name in BENCHMARKS:
        return Asked((BENCHMARKS[name],), None)
    plain = name.strip().lower().removeprefix("chapter").removeprefix("appendix").strip(" -")
    chapter = tuple(study for study in STUDIES.values() if plain in study.chapter.lower().split())
    if chapter:
        return Asked(chapter, None)
    wanted = " ".join(name.replace("-", " ").split()).lower()
    for study in STUDIES.values():
        for covered in study.covers:
            if covered.lower() == wanted:
                return Asked((study,), covered)
    for table, reason in NOTHING_TO_COMPUTE.items():
        if table.lower() == wanted:
            raise RigtwinError(f"{table} {reason}")
    chapters = sorted({part for study in STUDIES.values() for part in study.chapter.split()})
    raise RigtwinError(
        f"nothing to reproduce under {name!r}; there are chapters "
        f"{', '.join(chapters)}, studies {', '.join([*STUDIES, *BENCHMARKS])}, "
        "and tables, figures and equations such as table-5.1, figure-6.26, equation-6.1"
    )


def matching(drawn: str, where: str) -> bool:
    """Whether a drawing that covers `Figure 3.11 to 3.14, B1.1` is of `Figure 3.12`."""
    kind, _, number = where.partition(" ")
    of = ""
    for part in drawn.replace(" and ", ", ").split(", "):
        named, _, rest = part.partition(" ")
        # A part without a kind is of the kind named last.
        of, places = (named, rest) if named in ("Figure", "Table") else (of, part)
        first, _, last = places.partition(" to ")
        if of == kind and (number == first or (last and _between(number, first, last))):
            return True
    return False


def _between(number: str, first: str, last: str) -> bool:
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
