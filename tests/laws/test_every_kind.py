"""Every kind of effect has a law that a test of this folder writes out."""

from __future__ import annotations

from collections.abc import Iterable

from rigtwin.components import KINDS, Guide, Kind, Servo
from tests.laws.written import Law, collect_laws


def laws_of(kinds: Iterable[Kind]) -> set[Law]:
    """List every kind at every component type that can have it."""
    return {(kind.name, component.__name__) for kind in kinds for component in kind.at}


def test_every_kind_of_effect_has_a_written_law():
    missing = laws_of(KINDS) - collect_laws()
    assert not missing, f"write out these laws in tests/laws: {sorted(missing)}"


def test_every_written_law_belongs_to_a_kind_of_effect():
    unknown = collect_laws() - laws_of(KINDS)
    assert not unknown, f"no kind of effect has these laws: {sorted(unknown)}"


def test_a_new_kind_of_effect_without_a_law_is_noticed():
    quintic = Kind(
        "quintic_stiffness", "quintic stiffness", ("quintic",), "a spring", {Guide: None}
    )
    assert laws_of([quintic]) - collect_laws() == {("quintic_stiffness", "Guide")}


def test_an_old_kind_at_a_new_component_type_is_noticed():
    lagging = Kind("relaxation", "relaxation", ("relaxation",), "it lags", {Servo: None})
    assert laws_of([lagging]) - collect_laws() == {("relaxation", "Servo")}
