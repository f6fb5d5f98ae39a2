"""Gap before and after a correction: replays of components, and spectra of the closed loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from controllers import Measurements
from rigtwin.components import RigPlant, with_parameters
from rigtwin.components.plant import Plant
from rigtwin.components.sensors import sensor_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import OWN
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.gap import Level
from rigtwin.diagnosis.residual import Residual
from rigtwin.diagnosis.threads import Threads
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.rig.component_replays import REPLAYS, ComponentReplays, Undetermined
from rigtwin.signals.noise import spectrum
from rigtwin.simulation.runner import simulate, without_limits

COMPONENTS = ("motor", "carriage", "mechanics", "structure_cylinder", "ground_cylinder")
"""Replays whose levels are reported."""
LOWEST, HIGHEST = 0.4, 40.0
"""Frequency range in which spectra are compared, Hz."""
BANDS_PER_OCTAVE = 2
SEEDS = (2**31 - 1, 2**31 - 2)
"""Seeds of the twin's noise. Runs that differ in the seed alone show the chance differences of
spectra."""
SHORTEST = 5.0
"""Shortest test whose spectra are compared, s."""


def replay_residuals(
    evidence: Evidence, progress: Callable[[str], object]
) -> tuple[dict[str, Residual], dict[str, str]]:
    """Replay each component of the first recording.

    Parameters
    ----------
    evidence
        Recordings, about their nominal plant.
    progress
        Function that is called with the name of each replay.

    Returns
    -------
    tuple
        Residual of each replay, and the reason for each missing one, by name.
    """
    recording = evidence.recordings[0]
    replays = ComponentReplays(recording, evidence.configurations[0])
    left_out: dict[str, str] = {}
    if not recording.controller or OWN in recording.controller:
        left_out = dict.fromkeys(
            ("controller", "closed_loop"),
            "the recording does not contain the controller's settings",
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
    """Compute the gaps of the first recording before and after a correction.

    Parameters
    ----------
    evidence
        Recordings, about their nominal plant.
    plant
        Corrected plant.
    corrected
        Settings of the corrected twin, with the sensors as estimated from the signals.

    Returns
    -------
    tuple
        Level of each component's replay, and of the closed loop's spectra; None for the latter if
        the test is too short.
    """
    recording, nominal = evidence.recordings[0], evidence.configurations[0]
    noisy: Any = corrected.plant
    for name, noise in zip(evidence.names, evidence.lines[0].noise, strict=True):
        # Noise as estimated from the recording: the spectra compare motions and not noise floors.
        noisy = with_parameters(noisy, name, {"white": float(noise)})
    # Replays and closed-loop runs are independent: start all, then wait.
    with Threads() as threads:
        replays = _component_levels(recording, nominal, nominal._replace(plant=plant), threads)
        loop = _closed_loop(recording, nominal, corrected, noisy, threads)
        return replays(), loop()


def _component_levels(
    recording: RecordedTest, before: Configuration, after: Configuration, threads: Threads
) -> Callable[[], dict[str, Level]]:
    """Start the replays of all components; return a function that waits for their levels.

    Levels are in units of each replay's noise floor.
    """

    def ratios(configuration: Configuration) -> dict[str, float]:
        replays = ComponentReplays(recording, configuration)
        computed = {}
        for name in COMPONENTS:
            try:
                computed[name] = REPLAYS[name](replays).ratio
            except Undetermined:
                continue  # A correction can make a replay undetermined; it then has no level.
        return computed

    # Without a correction both are equal, and are computed once.
    computed = threads.begin(ratios, dict.fromkeys((before, after)))

    def finish() -> dict[str, Level]:
        before_ratios, *remaining = computed
        after_ratios = remaining[0] if remaining else before_ratios
        return {
            name: Level(ratio, after_ratios.get(name, ratio), 1.0)
            for name, ratio in before_ratios.items()
        }

    return finish


def _closed_loop(
    recording: RecordedTest,
    before: Configuration,
    after: Configuration,
    noisy: RigPlant,
    threads: Threads,
) -> Callable[[], Level | None]:
    """Start the twin's runs of the test; return a function that waits for their level.

    The level is the difference of the sensors' spectra from the recording's, dB, or None if the
    test is too short. `noisy` is the corrected plant with the noise of the recording.
    """
    if recording.ticks * recording.period < SHORTEST:
        return lambda: None
    demands = np.column_stack(
        [recording.column("/command", name) for name in ("ground", "structure", "force")]
    )
    measured = _bands(
        np.stack([recording.column("/sensor", name) for name in Measurements._fields]),
        recording.period,
    )
    # The same noise before and after, or the correction of noise would count as a closed gap.
    nominal = before._replace(plant=_with_noise_of(noisy, before.plant))
    corrected = after._replace(plant=noisy)
    runs = dict.fromkeys(((nominal, SEEDS[0]), (corrected, SEEDS[0]), (corrected, SEEDS[1])))
    results = threads.begin(
        lambda run: _bands(_run(run[0], run[1], demands), recording.period), runs
    )

    def finish() -> Level:
        spectra = dict(zip(runs, results, strict=True))
        nominal_spectra = spectra[nominal, SEEDS[0]]
        corrected_spectra = spectra[corrected, SEEDS[0]]
        again = spectra[corrected, SEEDS[1]]
        # The third number is the floor: two runs of the same twin with different noise.
        return Level(
            _spectral_distance(measured, nominal_spectra),
            _spectral_distance(measured, corrected_spectra),
            _spectral_distance(corrected_spectra, again),
        )

    return finish


def _with_noise_of(noisy: RigPlant, plant: RigPlant) -> RigPlant:
    """Return a plant with the white noise and hum of another plant's sensors."""
    for name in Measurements._fields:
        like = sensor_of(noisy, name)
        plant = with_parameters(plant, name, {"white": like.white, "hum": like.hum})
    return plant


def _run(configuration: Configuration, seed: int, demands: Array) -> Array:
    return simulate(without_limits(configuration), demands, seed).measurements.T


def _bands(signals: Array, period: float) -> Array:
    """Return the mean spectral density of each signal in logarithmic bands, shape (4, bands)."""
    # Bands of equal width in octaves: each holds about as much of a broadband motion.
    edges = LOWEST * 2.0 ** (
        np.arange(math.ceil(BANDS_PER_OCTAVE * math.log2(HIGHEST / LOWEST)) + 1) / BANDS_PER_OCTAVE
    )
    rows = []
    for signal in signals:
        frequency, density = spectrum(signal - np.mean(signal), period)
        bands = [(frequency >= low) & (frequency < high) for low, high in pairwise(edges)]
        rows.append([float(np.mean(density[band])) if band.any() else math.nan for band in bands])
    return np.array(rows)


def _spectral_distance(first: Array, second: Array) -> float:
    """Return the rms difference of two spectra over all common bands, dB."""
    # Bands without a spectral line are NaN and left out.
    with np.errstate(divide="ignore", invalid="ignore"):
        decibels = 10.0 * np.log10(first / second)
    return float(np.sqrt(np.nanmean(decibels[np.isfinite(decibels)] ** 2)))
