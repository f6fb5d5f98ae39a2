"""What to do next."""

from __future__ import annotations

import pytest

from rigtwin.diagnosis.advice import advise
from rigtwin.diagnosis.answer import Answer
from rigtwin.diagnosis.finding import (
    Estimate,
    Finding,
    Name,
    NextTest,
    Place,
    Tolerated,
    Unobservable,
)
from rigtwin.diagnosis.gap import Gap, Interval
from rigtwin.diagnosis.text import describe, sentence


def finding(component: str, kind: str, confidence: float, *rivals: str, share=1.0) -> Finding:
    name = Name(component, kind)
    return Finding(
        name,
        {kind: Estimate(3.0, 2.0, 4.0, 0.0, "N")},
        confidence,
        (name, *(Name(component, rival) for rival in rivals)),
        share,
        f"{kind} friction",
    )


def gap(held_out: str) -> Gap:
    return Gap(5.0, 1.0, 1.0, 0.9, Interval(0.9, 0.8, 1.0), held_out, {}, None)


def answer(verdict, **fields) -> Answer:
    given = {"sentence": "", "recordings": ("a.mcap",), "seconds": 1.0, "machine": "any"}
    return Answer(verdict=verdict, **(given | fields))


LEFT = Place("load_cell", 1.0, (0.1, 2.0), "throughout", "the residual correlates with time")


@pytest.mark.parametrize("verdict", ["explained", "partly explained", "unknown", "no gap"])
@pytest.mark.parametrize("places", [(), (LEFT,)])
def test_there_is_always_something_to_do_and_the_terminal_says_it_too(verdict, places):
    effects = (finding("rail", "coulomb", 0.97),) if "explained" in verdict else ()
    found = answer(verdict, effects=effects, where=places)
    said = advise(found)
    assert said
    assert all(each.endswith(".") for each in said)
    for each in said:
        assert f"  next: {each.replace('`', '')}" in describe(found)


def test_unusable_data_are_mended_first():
    (said,) = advise(answer("unusable"))
    assert "Repair" in said


def test_without_a_gap_nothing_is_corrected_but_what_was_not_seen_is_said():
    assert "as it is." in advise(answer("no gap"))[0]
    blind = answer("no gap", not_observable=(Unobservable("rail", "stribeck", "too fast"),))
    assert "could not have shown" in advise(blind)[0]


def test_what_fits_alike_is_told_apart_by_the_test_that_does_it():
    alike = finding("guide", "compliance", 0.5, "mount")
    (hint,) = [
        s for s in advise(answer("explained", effects=(alike,))) if "cannot distinguish" in s
    ]
    assert "compliance@guide from mount@guide" in hint
    test = NextTest("sweep", "rigtwin run any sweep", 20.0, ("compliance@guide", "mount@guide"))
    said = advise(answer("explained", effects=(alike,), next_test=test))
    assert any("`rigtwin run any sweep`" in each for each in said)
    assert not any("cannot distinguish" in each for each in said)


def test_only_the_less_sure_effects_are_looked_at_again():
    both = (finding("rail", "coulomb", 0.97), finding("motor", "viscous", 0.7))
    (hint,) = [s for s in advise(answer("explained", effects=both)) if "below 90 %" in s]
    assert "viscous@motor (70 %)" in hint
    assert "coulomb@rail" not in hint


def test_other_data_are_asked_for_only_where_none_were_held_out():
    sure = (finding("rail", "coulomb", 0.97),)
    asked = advise(answer("explained", effects=sure, gap=gap("the last third of it")))
    assert any("--held-out" in each for each in asked)
    given = advise(answer("explained", effects=sure, gap=gap("2 held-out recordings")))
    assert not any("--held-out" in each for each in given)


def test_what_has_no_name_is_looked_for_where_it_lies():
    said = advise(answer("unknown", where=(LEFT,)))
    assert any("load cell" in each and "correlates with time" in each for each in said)


def test_one_part_is_named_once_and_joints_have_no_article():
    effects = [finding("joint_2", kind, 0.97) for kind in ("coulomb", "viscous", "stribeck")]
    said = sentence("explained", [*effects, finding("rail", "coulomb", 0.9)], (), gap("it"))
    assert said.startswith("Joint 2 has a coulomb friction of 3 N instead of 0 N (confidence 97 %)")
    assert said.count("oint 2 has") == 1
    assert "and a stribeck friction" in said
    assert "; the rail has a coulomb" in said


def test_a_sentence_asserts_only_what_is_likely():
    effects = [
        finding("rail", kind, confidence)
        for kind, confidence in (("coulomb", 0.97), ("viscous", 0.7), ("stribeck", 0.3))
    ]
    said = sentence("explained", effects, (), gap("it"))
    assert said.startswith("The rail has a coulomb")
    assert "; the rail probably has a viscous" in said
    assert "; the rail may have a stribeck" in said


def test_a_sentence_tells_the_greatest_of_many_effects():
    effects = [finding(f"joint_{n}", "coulomb", 0.97, share=n / 100.0) for n in range(1, 10)]
    said = sentence("explained", effects, (), gap("it"))
    assert said.startswith("Joint 9 has")
    assert "and 4 more effects that are smaller" in said
    assert "joint 4" not in said


def test_a_tolerance_that_is_used_up_is_measured_instead_of_looking_for_an_effect():
    tolerated = Tolerated("elbow", "coulomb", Estimate(0.95, 0.85, 0.94, 0.9, "Nm"))
    effects = (finding("rail", "coulomb", 0.97),)
    advice = advise(answer("partly explained", effects=effects, tolerated=(tolerated,)))
    assert any("Measure coulomb@elbow" in step for step in advice)
    assert not any("residual" in step for step in advice)
