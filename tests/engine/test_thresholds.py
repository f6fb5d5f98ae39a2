"""The numbers that decide what a diagnosis says, written out a second time."""

from __future__ import annotations

from dataclasses import asdict

from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

SEARCH = {"promising": 0.1, "near": 0.2, "leaders": 3, "additions": 6}
SCORE = {
    "occam_quiet": 15.0,
    "occam_discrepant": 5.0,
    "materiality": 0.0075,
    "discrepancy_price": 0.06,
    "shape_price": 4.0,
    "rare_odds": 5.0,
    "rare_price": 0.06,
    "rare_share": 0.11,
    "rare_doubt": 0.3,
    "material": 2.0,
    "steady": 4.0,
    "unsteady": 20.0,
    "forbidding": 50.0,
    "within": 0.3,
    "chance": 2.0,
    "undone": 0.3,
    "within_tolerance": 2.0,
    "temper": 4.0,
    "discrepancy_temper": 0.02,
}
WORDS = {
    "member": 0.05,
    "members": 3.5,
    "nameable": 0.5,
    "rest": 0.15,
    "explained": 0.8,
    "removes": 0.106,
    "mimicry": 0.17,
    "worse": 1.05,
    "consequence": 1e-3,
    "sure": 0.98,
    "unsure": 0.9,
    "wider": 2.5,
    "aligned": 0.3,
    "possible": 0.01,
    "left_over": 1.3,
}
CHANGES = {
    "changed": 0.01,
    "instead": 24.0,
    "seen": 1e-3,
    "trend_explains": 0.8,
    "trend_clear": 3.0,
    "changes": 6,
    "changed_share": 0.03,
}


def test_no_threshold_changes_by_accident():
    """A change of one of them is made here too, where its reviewer sees it."""
    assert asdict(Thresholds()) == {**SEARCH, **SCORE, **WORDS, **CHANGES}
    assert Thresholds() == STANDARD
