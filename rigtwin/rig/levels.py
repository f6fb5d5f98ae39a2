"""The gap as people feel it: each component's replay, and the closed loop's spectra, before and
after a correction."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from controllers import Measurements
from rigtwin.components import RigPlant, with_parameters
from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import OWN
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Level
from rigtwin.diagnosis.residual import Residual
from rigtwin.diagnosis.threads import Threads
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.rig.component_replays import REPLAYS, ComponentReplays, Undetermined
from rigtwin.signals.noise import spectrum
from rigtwin.simulation.runner import simulate, without_limits

COMPONENTS = ("motor", "carriage", "mechanics", "structure_cylinder", "ground_cylinder")
"""Replays whose levels are reported."""
LOWEST, HIGHEST = 0.4, 40.0
"""Hz, between which spectra are compared."""
BANDS_PER_OCTAVE = 2
SEEDS = (2**31 - 1, 2**31 - 2)
"""Of the twin's noise: runs that differ in nothing else show how far spectra differ by chance."""
SHORTEST = 5.0
"""s; spectra of shorter tests are chance."""


def replay_residuals(
    evidence: Evidence, progress: Callable[[str], object]
) -> tuple[dict[str, Residual], dict[str, str]]:
    """Replay each component of the first recording.

    Parameters
    ----------
    evidence
        Recordings, about their nominal plant.
    progress
        Called with the name of each replay.

    Returns
    -------
    tuple
        Residual of each replay, and why others are missing.
    """
    recording = evidence.recordings[0]
    replays = ComponentReplays(recording, evidence.configurations[0])
    left_out: dict[str, str] = {}
    if not recording.controller or OWN in recording.controller:
        left_out = dict.fromkeys(
            ("controller", "closed_loop"),
            "the recording does not say what the controller was told to do",
        )
    results: dict[str, Residual] = {}
    for name, replay in REPLAYS.items():
        if name not in left_out:
            progress(name)
            try:
                results[name] = replay(replays)
            except Undetermined as reason:
                left_out[name] = str(reason)
    return results, left_out


def compute_levels(
    evidence: Evidence, plant: Plant, corrected: Configuration
) -> tuple[dict[str, Level], Level | None]:
    """The gaps of the first recording before and after a correction.

    Parameters
    ----------
    evidence
        The recordings, about their nominal plant.
    plant
        The corrected plant.
    corrected
        The corrected twin: with it, and with what the signals say of their sensors.

    Returns
    -------
    tuple
        Level of each component's replay, and of the closed loop's spectra, None where the test
        is too short.
    """
    recording, nominal = evidence.recordings[0], evidence.configurations[0]
    noisy: Any = corrected.plant
    for name, noise in zip(evidence.names, evidence.lines[0].noise, strict=True):
        noisy = with_parameters(noisy, name, {"white": float(noise)})
    with Threads() as threads:
        replays = _component_levels(recording, nominal, nominal._replace(plant=plant), threads)
        loop = _closed_loop(recording, nominal, corrected, noisy, threads)
        return replays(), loop()


def _component_levels(
    recording: Recording, before: Configuration, after: Configuration, threads: Threads
) -> Callable[[], dict[str, Level]]:
    """Each component's replay, in units of its noise floor; worked out until it is asked for."""

    def ratios(configuration: Configuration) -> dict[str, float]:
        replays = ComponentReplays(recording, configuration)
        found = {}
        for name in COMPONENTS:
            try:
                found[name] = REPLAYS[name](replays).ratio
            except Undetermined:
                continue
        return found

    found = threads.begin(ratios, dict.fromkeys((before, after)))

    def finish() -> dict[str, Level]:
        one, *others = found
        other = others[0] if others else one
        return {name: Level(ratio, other.get(name, ratio), 1.0) for name, ratio in one.items()}

    return finish


def _closed_loop(
    recording: Recording,
    before: Configuration,
    after: Configuration,
    own: RigPlant,
    threads: Threads,
) -> Callable[[], Level | None]:
    """How far the twin's own run of the test is from the recording, in dB of its sensors' spectra;
    None if the test is too short. own: the corrected plant with the noise that the recording has.
    Worked out until it is asked for."""
    if recording.ticks * recording.period < SHORTEST:
        return lambda: None
    demands = np.column_stack(
        [recording.column("/command", name) for name in ("ground", "structure", "force")]
    )
    measured = _bands(
        np.stack([recording.column("/sensor", name) for name in Measurements._fields]),
        recording.period,
    )
    nominal = before._replace(plant=_with_noise_of(own, before.plant))
    corrected = after._replace(plant=own)
    runs = dict.fromkeys(((nominal, SEEDS[0]), (corrected, SEEDS[0]), (corrected, SEEDS[1])))
    results = threads.begin(
        lambda run: _bands(_run(run[0], run[1], demands), recording.period), runs
    )

    def finish() -> Level:
        found = dict(zip(runs, results, strict=True))
        one, other, again = (
            found[nominal, SEEDS[0]],
            found[corrected, SEEDS[0]],
            found[corrected, SEEDS[1]],
        )
        return Level(
            _spectral_distance(measured, one),
            _spectral_distance(measured, other),
            _spectral_distance(other, again),
        )

    return finish


def _with_noise_of(noisy: RigPlant, plant: RigPlant) -> RigPlant:
    """The plant with the white noise and hum of another's sensors."""
    for name in Measurements._fields:
        like = getattr(noisy, name)
        plant = plant._replace(
            **{name: getattr(plant, name)._replace(white=like.white, hum=like.hum)}
        )
    return plant


def _run(configuration: Configuration, seed: int, demands: Array) -> Array:
    return simulate(without_limits(configuration), demands, seed).measurements.T


def _bands(signals: Array, period: float) -> Array:
    """Mean spectral density of each signal in bands of equal ratio, shape (4, bands)."""
    edges = LOWEST * 2.0 ** (
        np.arange(math.ceil(BANDS_PER_OCTAVE * math.log2(HIGHEST / LOWEST)) + 1) / BANDS_PER_OCTAVE
    )
    rows = []
    for signal in signals:
        frequency, density = spectrum(signal - np.mean(signal), period)
        bands = [(frequency >= low) & (frequency < high) for low, high in pairwise(edges)]
        rows.append([float(np.mean(density[band])) if band.any() else math.nan for band in bands])
    return np.array(rows)


def _spectral_distance(one: Array, other: Array) -> float:
    """rms difference in dB over all bands that both have."""
    with np.errstate(divide="ignore", invalid="ignore"):
        decibels = 10.0 * np.log10(one / other)
    return float(np.sqrt(np.nanmean(decibels[np.isfinite(decibels)] ** 2)))
