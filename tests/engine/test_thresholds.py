"""The numbers that decide what a diagnosis says, written out a second time."""

from __future__ import annotations

from dataclasses import asdict

from rigtwin.diagnosis.thresholds import STANDARD, Thresholds

SEARCH = {
    "promising_share": 0.1,
    "precise_fit_shortfall": 0.2,
    "leaders": 3,
    "additions": 6,
    "effort": 300.0,
    "last_effort_share": 0.3,
    "negligible_share": 0.02,
}
SCORE = {
    "occam_quiet": 15.0,
    "occam_discrepant": 5.0,
    "materiality": 0.0075,
    "discrepancy_price": 0.06,
    "shape_price": 4.0,
    "rare_odds": 5.0,
    "setting_odds": 1.0,
    "rare_price": 0.06,
    "rare_amplitude_share": 0.11,
    "rare_immaterial_price": 0.3,
    "material_model_errors": 2.0,
    "steady_standard_errors": 4.0,
    "unsteady_price": 20.0,
    "mass_log_error": 0.25,
    "prohibitive_price": 50.0,
    "within_noise_weight": 0.3,
    "chance_deviations": 2.0,
    "cancelling_share": 0.3,
    "tolerance_half_widths": 2.0,
    "temper": 4.0,
    "discrepancy_temper": 0.02,
}
WORDS = {
    "rival_weight": 0.05,
    "rival_count": 3.5,
    "naming_confidence": 0.5,
    "residual_excess": 0.15,
    "explained_share": 0.8,
    "removed_share": 0.106,
    "mimicry_share": 0.17,
    "clean_ratio": 8.0,
    "worsening_factor": 1.05,
    "controller_consequence": 1e-3,
    "highest_confidence": 0.98,
    "unfinished_confidence": 0.7,
    "retest_confidence": 0.9,
    "interval_half_width": 2.5,
    "rest_correlation": 0.3,
    "alternative_weight": 0.01,
    "localisation_ratio": 1.3,
}
CHANGES = {
    "change_probability": 0.01,
    "rival_change_chi_square": 24.0,
    "observable_share": 1e-3,
    "trend_share": 0.8,
    "trend_margin": 3.0,
    "most_changes": 6,
    "change_log_error": 0.03,
}


def test_no_threshold_changes_by_accident():
    """A change of one of them is made here too, where its reviewer sees it."""
    assert asdict(Thresholds()) == {**SEARCH, **SCORE, **WORDS, **CHANGES}
    assert Thresholds() == STANDARD
