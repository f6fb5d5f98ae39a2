"""A diagnosis in words."""

from __future__ import annotations

import pytest

from rigtwin.diagnosis.text import tell_apart


@pytest.mark.parametrize(
    ("one", "other", "texts"),
    [
        (24.012, 14.0, ("24.01", "14")),
        (7.4003, 7.4, ("7.4003", "7.4")),
        (-0.003972, -0.003974, ("-0.003972", "-0.003974")),
        (1e5 + 0.25, 1e5, ("100000.2", "100000")),
        (7.4, 7.4, ("7.4", "7.4")),
    ],
)
def test_numbers_are_told_apart(one, other, texts):
    assert tell_apart(one, other) == texts
