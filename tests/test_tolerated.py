"""A part of the gap that lies within a declared tolerance is no unmodelled residual."""

from __future__ import annotations

import pytest

from referee.arm_cases import MACHINES, draw_arm
from referee.arm_recordings import record_arm
from referee.wild_recordings import WildData
from referee.withheld import answer_question


@pytest.mark.slow
def test_a_deviation_at_the_end_of_its_tolerance_is_said_and_is_no_residual() -> None:
    # Coulomb friction at both joints: the elbow's is 6.6 % too large, and declared to 5 %.
    case = draw_arm(2, 901)
    tests = [record_arm(case, again) for again in (0, 1)]
    shown = [WildData(test.columns, test.period, {}) for test in tests]
    answer = answer_question((MACHINES[case.machine], shown))
    assert [effect["component"] for effect in answer["effects"]] == ["shoulder"]
    (part,) = answer["tolerated"]
    assert (part["component"], part["parameter"]) == ("elbow", "coulomb")
    assert part["estimate"]["value"] == pytest.approx(0.959, rel=0.01)
    assert (part["estimate"]["low"], part["estimate"]["high"]) == pytest.approx((0.855, 0.945))
    assert answer["sentence"].endswith("the remaining gap lies within the declared tolerances.")
    assert any("coulomb@elbow 0.954 Nm" in note for note in answer["notes"])
