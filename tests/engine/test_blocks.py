"""Bands of frequency and blocks of time: what they hold is what the whole holds."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rigtwin.diagnosis.blocks import (
    align,
    block_products,
    count_independent,
    count_samples,
    excess_by_band,
    find_bands,
    split_transforms,
)
from tests.engine.linear import PLANT, LinearEvidence

RANDOM = np.random.default_rng(6)
LONG, SHORT = RANDOM.standard_normal((2, 2400)), RANDOM.standard_normal((2, 800))
NONE = np.zeros((2, 2400)), np.zeros((2, 800))


def evidence_of(even: float = 1.0) -> Any:
    empty = [(part, part) for part in NONE]
    return LinearEvidence([LONG, SHORT], empty, even)


def test_every_band_is_twice_as_wide_as_the_one_below_it():
    """The lowest has 40 lines; the last one has what does not fill another band."""
    assert find_bands(119, 0.0) == [slice(0, 119)]
    assert find_bands(120, 0.0) == [slice(0, 40), slice(40, 120)]
    assert find_bands(279, 0.5) == [slice(0, 40), slice(40, 279)]
    assert find_bands(280, 0.0) == [slice(0, 40), slice(40, 120), slice(120, 280)]
    assert find_bands(280, 1.0) == [slice(0, 280)]


def test_a_whitened_vector_is_split_into_the_spectra_it_was_made_of():
    evidence = evidence_of()
    spectra = split_transforms(evidence, evidence.whiten([LONG, SHORT]))
    for spectrum, signals in zip(spectra, (LONG, SHORT), strict=True):
        ticks = signals.shape[1]
        expected = np.fft.rfft(signals, axis=1)[:, 1 : ticks // 2] * np.sqrt(2.0 / ticks)
        np.testing.assert_allclose(spectrum, expected, atol=1e-12)


def test_a_line_that_counts_has_two_real_numbers():
    evidence = evidence_of(0.0)
    evidence.lines[0].weight[1, 10:30] = 0.0
    counted = count_samples(evidence)
    assert counted.shape == (2, 2, 4)
    assert counted[0, 0].tolist() == [80.0, 160.0, 320.0, 1838.0]
    assert counted[0, 1, 0] == 40.0
    assert counted[1, 0].tolist() == [80.0, 160.0, 558.0, 0.0]


def test_the_independent_samples_of_white_noise_are_all_of_them():
    """4 (Σ p)²/Σ p² is 2 N for exponentially distributed powers p of N lines."""
    evidence = evidence_of()
    found = count_independent(evidence, evidence.whiten([LONG, SHORT]))
    for number, signals in enumerate((LONG, SHORT)):
        ticks = signals.shape[1]
        power = np.abs(np.fft.rfft(signals, axis=1)[:, 1 : ticks // 2]) ** 2
        expected = 4.0 * power.sum(axis=1) ** 2 / (power**2).sum(axis=1)
        most = 2.0 * power.shape[1]
        np.testing.assert_allclose(found[number, :, 0], np.minimum(expected, most))
        assert np.all(expected > 0.8 * most)
    uneven = LONG + 3.0 * np.sin(2.0 * np.pi * np.arange(2400) / 40.0)
    power = np.abs(np.fft.rfft(uneven, axis=1)[:, 1:1200]) ** 2
    expected = 4.0 * power.sum(axis=1) ** 2 / (power**2).sum(axis=1)
    few = count_independent(evidence, evidence.whiten([uneven, SHORT]))
    np.testing.assert_allclose(few[0, :, 0], np.maximum(expected, 60.0))


def test_a_few_lines_count_as_three_samples_a_block_and_equal_ones_as_two_each():
    evidence = evidence_of()
    time = np.arange(2400) / 2400.0
    lines = np.stack([np.sin(2.0 * np.pi * 7.0 * time), np.zeros(2400)])
    lines[1, 0] = 1.0
    found = count_independent(evidence, evidence.whiten([lines, NONE[1]]))
    assert found[0, :, 0] == pytest.approx([60.0, 2.0 * 1199.0])
    assert np.all(found[1] == 60.0)


def test_recordings_with_fewer_bands_are_filled_with_zeros():
    found = align([np.ones((2, 3, 4)), 2.0 * np.ones((2, 1, 4))])
    assert found.shape == (2, 2, 3, 4)
    assert np.all(found[0] == 1.0)
    assert np.all(found[1, :, 0] == 2.0)
    assert not np.any(found[1, :, 1:])


def test_excess_noise_is_averaged_over_the_lines_that_count():
    evidence = evidence_of(0.0)
    plant = PLANT._replace(rail=PLANT.rail._replace(asymmetry=3.0))
    fit: Any = SimpleNamespace(plant=plant)
    found, _ = excess_by_band(evidence, fit)
    assert found.shape == (2, 2, 4)
    np.testing.assert_allclose(found[0], 0.3)
    np.testing.assert_allclose(found[1], np.tile([0.3, 0.3, 0.3, 0.0], (2, 1)))
    # Half the lines of a band do not count: they carry none, and are no part of the average.
    excess = np.full((2, 1199), 0.3)
    excess[:, 40:80] = 0.0
    evidence.lines[0].weight[:, 40:80] = 0.0
    evidence.excess_noise = lambda plant: [excess, None]
    half, _ = excess_by_band(evidence, fit)
    np.testing.assert_allclose(half[0], 0.3)
    assert not np.any(half[1])
    evidence.lines[0].weight[:, :40] = 0.0
    excess[:, :40] = 0.0
    assert excess_by_band(evidence, fit)[0][0, 0, 0] == 0.0
    excess[:, 0] = 0.5
    assert excess_by_band(evidence, fit)[0][0, 0, 0] == 0.5


@pytest.mark.parametrize("even", [0.0, 1.0])
def test_products_of_all_blocks_add_up_to_those_of_the_whole_by_parseval(even):
    evidence = evidence_of(even)
    first = evidence.whiten([LONG, SHORT])
    second = evidence.whiten([np.roll(LONG, 3, axis=1), SHORT[::-1].copy()])
    products, expected = block_products(evidence, np.stack([first, second], axis=1))
    assert products.shape[-3:] == (20, 2, 2)
    whole = products.sum(axis=(0, 1, 2, 3))
    stack = np.stack([first, second])
    np.testing.assert_allclose(whole, stack @ stack.T, rtol=1e-9)
    spectra = split_transforms(evidence, first)
    bands = find_bands(1199, even)
    for number, band in enumerate(bands):
        power = np.sum(np.abs(spectra[0][:, band]) ** 2, axis=1)
        np.testing.assert_allclose(products[0, :, number, :, 0, 0].sum(axis=1), power)
        lines = band.stop - band.start
        np.testing.assert_allclose(expected[0, :, number].sum(axis=1), 2.0 * lines)
        np.testing.assert_allclose(expected[0, :, number], 2.0 * lines / 20.0, rtol=1e-9)


def test_a_burst_is_found_in_the_block_of_its_time():
    burst = np.zeros((2, 2400))
    burst[0, 1205:1235] = np.sin(2.0 * np.pi * np.arange(30) / 10.0)
    evidence = LinearEvidence([burst], [(NONE[0], NONE[0])], 1.0)
    vector = evidence.whiten([burst])[:, None]
    products, _ = block_products(evidence, vector)  # type: ignore[arg-type]
    power = products[0, 0, 0, :, 0, 0]
    assert power[10] > 0.9 * power.sum()


def test_what_is_faded_out_is_expected_to_have_no_noise():
    evidence = evidence_of()
    evidence.lines[0].fade[:, :600] = 0.0
    evidence.lines[0].fade[:, 600:1200] = 0.5
    evidence.lines[0].weight[:, :200] = 0.0
    _, expected = block_products(evidence, evidence.whiten([LONG, SHORT])[:, None])
    total = 2.0 * 999.0
    power = np.repeat([0.0, 0.25, 1.0, 1.0], 5)
    np.testing.assert_allclose(expected[0, 0, 0], total * power / power.sum(), rtol=1e-9)


def test_a_recording_that_fills_half_its_transform_fills_all_its_blocks():
    """Signals are padded to twice their length; blocks cut what the recording fills."""
    half = np.zeros((2, 2400))
    half[:, :1200] = RANDOM.standard_normal((2, 1200))
    evidence = evidence_of()
    filled = replace(evidence.lines[0], measured=half[:, :1200], fade=np.ones((2, 1200)))
    evidence.lines[0] = filled
    vector = np.concatenate([
        part.ravel()
        for signals in (half, SHORT)
        for part in (
            np.fft.rfft(signals, axis=1)[:, 1 : signals.shape[1] // 2].real,
            np.fft.rfft(signals, axis=1)[:, 1 : signals.shape[1] // 2].imag,
        )
    ])  # fmt: skip
    products, _ = block_products(evidence, vector[:, None])
    power = products[0, 0, 0, :, 0, 0]
    assert np.min(power) > 0.3 * np.mean(power)
    whole = np.sum(np.abs(np.fft.rfft(half[0])[1:1200]) ** 2)
    assert power.sum() == pytest.approx(whole, rel=0.01)
