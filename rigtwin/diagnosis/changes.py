"""Compare several recordings of one machine: which parameters changed, and what the change follows.

joint diagnosis → zeros of sensors subtracted → search for parameters that differ → trends.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.change import Changes, ComparedParameter
from rigtwin.diagnosis.change_search import ChangeModel, ChangeSearch
from rigtwin.diagnosis.changes_text import change_sentence
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.homogeneity import fit_trends, name_trends
from rigtwin.diagnosis.recording_equations import BLOCKS
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest


def find_changes(
    machine: Machine,
    recordings: Sequence[RecordedTest],
    base: Configuration | None = None,
    progress: Callable[[str, int], object] = lambda _stage, _steps: None,
    thresholds: Thresholds = STANDARD,
) -> Changes:
    """Find what changed between recordings of one machine.

    Parameters
    ----------
    machine
        Machine that was recorded.
    recordings
        Recordings in the order of time, two or more.
    base
        Twin that they are compared with. Defaults to the described one.
    progress
        Called with the name of a stage and the number of steps done in it.
    thresholds
        Thresholds of the diagnosis and the comparison.

    Returns
    -------
    Changes
        Value of each parameter in each recording, and which parameters differ.

    Raises
    ------
    RigtwinError
        If there are fewer than two recordings, or they cannot be diagnosed.
    """
    started = time.perf_counter()
    if len(recordings) < 2:
        raise RigtwinError("what changed: expected at least two recordings, got one")

    diagnose_set = partial(diagnose, machine, base=base, progress=progress, thresholds=thresholds)

    # BLAS threads would compete with the threads of the search.
    with threadpool_limits(1):
        aligned, zeros, search = _align_zeros(
            machine, recordings, diagnose_set, progress, thresholds
        )
        model = _find_best_model(search, aligned, diagnose_set, thresholds)
    covariates = _covariates(search.evidence)
    # Trends are fitted last: they describe a change, and do not decide whether there is one.
    parameters = tuple(
        _with_trends(parameter, covariates, thresholds) for parameter in model.parameters
    )
    return Changes(
        recordings=tuple(str(recording.path) for recording in recordings),
        sentence=change_sentence(parameters),
        parameters=parameters,
        undetermined=model.undetermined,
        zeros=zeros,
        covariates={name: tuple(values.tolist()) for name, values in covariates.items()},
        tested=model.tested,
        seconds=time.perf_counter() - started,
        together=search.together,
    )


def _align_zeros(
    machine: Machine,
    recordings: Sequence[RecordedTest],
    diagnose_set: Callable[[Sequence[RecordedTest]], Diagnosis],
    progress: Callable[[str, int], object],
    thresholds: Thresholds,
) -> tuple[list[RecordedTest], dict[str, tuple[float, ...]], ChangeSearch]:
    """Subtract zeros of sensors that differ between recordings, and diagnose what results.

    Returns the recordings, the zeros about their mean by sensor, and the search prepared on the
    joint diagnosis.
    """
    aligned = list(recordings)
    search = ChangeSearch(diagnose_set(aligned), thresholds)
    progress("comparing recordings", 1)
    # A sensor may be zeroed anew between two tests. One plant for all recordings has one zero, so
    # the difference would bias every effect that the joint diagnosis fits.
    differing = search.differing_zeros()
    if differing:
        aligned = [
            _subtract_zeros(
                machine, recording, {name: values[n] for name, values in differing.items()}
            )
            for n, recording in enumerate(aligned)
        ]
        search = ChangeSearch(diagnose_set(aligned), thresholds)
        progress("comparing recordings", 1)
    zeros = {
        name: tuple((values - values.mean()).tolist())
        for name, values in differing.items()
        if values.any()
    }
    return aligned, zeros, search


def _find_best_model(
    search: ChangeSearch,
    aligned: Sequence[RecordedTest],
    diagnose_set: Callable[[Sequence[RecordedTest]], Diagnosis],
    thresholds: Thresholds,
) -> ChangeModel:
    """Search for changes, and once more from the first and the last recording if that may help."""
    model = search.compare()
    has_change = any(parameter.verdict == "changed" for parameter in model.parameters)
    # A restart costs two more diagnoses, so it is made only where there is something to explain.
    if has_change or search.together.verdict not in ("no gap", "explained"):
        return _restart(model, search, (aligned[0], aligned[-1]), diagnose_set, thresholds)
    return model


def _restart(
    model: ChangeModel,
    search: ChangeSearch,
    starts: Sequence[RecordedTest],
    diagnose_set: Callable[[Sequence[RecordedTest]], Diagnosis],
    thresholds: Thresholds,
) -> ChangeModel:
    """Search again from the diagnoses of single recordings, and return the best model.

    After a large change the joint model fits none of the recordings, so the linearisation about it
    is poor. The explanation of one recording alone is a better start.
    """
    for recording in starts:
        alone = diagnose_set([recording])
        if alone.evidence is None or not alone.effects:
            continue
        restarted = ChangeSearch(search.together, thresholds, start=alone).compare()
        model = min(
            model,
            restarted,
            key=lambda candidate: candidate.cost(search.pieces, thresholds.rival_change_chi_square),
        )
    return model


def _subtract_zeros(
    machine: Machine, recording: RecordedTest, zeros: dict[str, float]
) -> RecordedTest:
    """Recording with the zeros of sensors, SI, subtracted from their signals."""
    columns = {topic: dict(names) for topic, names in recording.columns.items()}
    for name, zero in zeros.items():
        channel = machine.components[name].channel
        if channel is not None:
            columns[channel[0]][channel[1]] = recording.column(*channel) - zero
    return replace(recording, columns=columns)


def _covariates(evidence: Evidence) -> dict[str, Array]:
    """Quantities that a change may follow, with their value in each recording.

    They are the order of recording, every channel with "temp" in its name, and the amplitude of
    motion and force of the first joint.
    """
    count = len(evidence.recordings)
    covariates = {"time (order of recording)": np.arange(1.0, count + 1.0)}
    shared = set.intersection(
        *(
            {(topic, name) for topic, names in recording.columns.items() for name in names}
            for recording in evidence.recordings
        )
    )
    for topic, name in sorted(shared):
        # Recordings have no type of channel for a temperature, so its name has to tell.
        if "temp" in name.lower():
            covariates[f"temperature ({topic}.{name})"] = np.array(
                [float(np.mean(r.column(topic, name))) for r in evidence.recordings]
            )
    first_joint = next(iter(evidence.machine.replays)).guide if evidence.machine.replays else None
    component = first_joint or next(iter(evidence.models[0].components()), None)
    if component is not None:
        motions = [model.motion(component, evidence.plant) for model in evidence.models]
        covariates["amplitude (rms of motion)"] = np.array(
            [float(np.std(motion.position)) for motion in motions]
        )
        covariates["load (rms of force)"] = np.array(
            [float(np.sqrt(np.mean(motion.force**2))) for motion in motions]
        )
    # A temperature that a recording lacks in part is NaN.
    return {name: values for name, values in covariates.items() if np.isfinite(values).all()}


def _with_trends(
    parameter: ComparedParameter, covariates: dict[str, Array], thresholds: Thresholds
) -> ComparedParameter:
    """Add the trends of a parameter that changed."""
    if parameter.verdict != "changed":
        return parameter
    values = np.array([interval.value for interval in parameter.values])
    half_widths = np.array([0.5 * (interval.high - interval.low) for interval in parameter.values])
    # The fit weighs by standard errors, `interval_half_width` to each side.
    trends = fit_trends(
        # The standard errors come from a jackknife, with one degree of freedom less than blocks.
        values,
        half_widths / thresholds.interval_half_width,
        covariates,
        float(BLOCKS - 1),
    )
    rivals, named = name_trends(
        trends, len(values), thresholds.trend_share, thresholds.trend_margin
    )
    return replace(parameter, trends=rivals, named=named)
