"""A diagnosis in words."""

from __future__ import annotations

import pytest

from rigtwin.diagnosis.text import format_distinct


@pytest.mark.parametrize(
    ("first", "second", "texts"),
    [
        (24.012, 14.0, ("24.01", "14")),
        (7.4003, 7.4, ("7.4003", "7.4")),
        (-0.003972, -0.003974, ("-0.003972", "-0.003974")),
        (1e5 + 0.25, 1e5, ("100000.2", "100000")),
        (7.4, 7.4, ("7.4", "7.4")),
    ],
)
def test_two_numbers_get_as_many_digits_as_distinguish_them(first, second, texts):
    assert format_distinct(first, second) == texts
