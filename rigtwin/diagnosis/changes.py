"""What several recordings of one machine say together: whether each parameter has one value in all
of them, and where it has not, what the change goes with."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.by_recording import BLOCKS
from rigtwin.diagnosis.change import Changes, Parameter
from rigtwin.diagnosis.change_columns import sensors_of
from rigtwin.diagnosis.change_search import ChangeSearch
from rigtwin.diagnosis.changes_text import change_sentence
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.homogeneity import fit_trends, name_trends
from rigtwin.diagnosis.thresholds import STANDARD, Thresholds
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording


def find_changes(
    machine: Machine,
    recordings: Sequence[Recording],
    base: Configuration | None = None,
    progress: Callable[[str, int], object] = lambda _stage, _steps: None,
    thresholds: Thresholds = STANDARD,
) -> Changes:
    """Says what changed between recordings of one machine.

    Parameters
    ----------
    machine
        Its description.
    recordings
        In the order of time.
    base
        The twin that they are compared with; by default the described one.
    progress
        Called with a stage's name and the steps done in it.
    thresholds
        What figures are held against.

    Returns
    -------
    Changes
        Each parameter in each recording, and which are not the same.

    Raises
    ------
    RigtwinError
        For fewer than two recordings, or data that cannot be diagnosed.
    """
    began = time.perf_counter()
    if len(recordings) < 2:
        raise RigtwinError("what changed is a question to two recordings or more; one was given")
    aligned = list(recordings)
    total = {name: np.zeros(len(recordings)) for name in sensors_of(machine)}

    def look(at: Sequence[Recording]) -> ChangeSearch:
        together = diagnose(machine, at, base, progress=progress, thresholds=thresholds)
        progress("comparing recordings", 1)
        return ChangeSearch(together, thresholds)

    with threadpool_limits(1):
        search = look(aligned)
        if zeros := search.differing_zeros():
            for name, values in zeros.items():
                total[name] += values
            aligned = [
                _shift(machine, recording, {name: values[n] for name, values in zeros.items()})
                for n, recording in enumerate(aligned)
            ]
            search = look(aligned)
        compared = search.compare()
        if search.together.verdict not in ("no gap", "explained") or any(
            each.verdict == "changed" for each in compared.parameters
        ):
            # What changed much leaves a model for all that is that of none: one recording's own
            # explanation is a better place to start from.
            for recording in (aligned[0], aligned[-1]):
                alone = diagnose(
                    machine, [recording], base, progress=progress, thresholds=thresholds
                )
                if alone.evidence is not None and alone.effects:
                    other = ChangeSearch(search.together, thresholds, start=alone).compare()
                    compared = min(
                        compared,
                        other,
                        key=lambda each: each.cost(
                            search.pieces, thresholds.rival_change_chi_square
                        ),
                    )
    covariates = _covariates(search.evidence)
    parameters = tuple(_with_trends(each, covariates, thresholds) for each in compared.parameters)
    return Changes(
        recordings=tuple(str(recording.path) for recording in recordings),
        sentence=change_sentence(parameters),
        parameters=parameters,
        unseen=compared.unseen,
        zeros={
            name: tuple((values - values.mean()).tolist())
            for name, values in total.items()
            if values.any()
        },
        covariates={name: tuple(values.tolist()) for name, values in covariates.items()},
        tested=compared.tested,
        seconds=time.perf_counter() - began,
        together=search.together,
    )


def _shift(machine: Machine, recording: Recording, zeros: dict[str, float]) -> Recording:
    """The recording with sensors' zeros taken off."""
    columns = {topic: dict(names) for topic, names in recording.columns.items()}
    for name, zero in zeros.items():
        channel = machine.components[name].channel
        if channel is not None:
            columns[channel[0]][channel[1]] = recording.column(*channel) - zero
    return replace(recording, columns=columns)


def _covariates(evidence: Evidence) -> dict[str, Array]:
    """What a change may go with: quantity → its value in each recording."""
    count = len(evidence.recordings)
    found = {"time (order of recording)": np.arange(1.0, count + 1.0)}
    shared = set.intersection(
        *(
            {(t, n) for t, names in recording.columns.items() for n in names}
            for recording in evidence.recordings
        )
    )
    for topic, name in sorted(shared):
        if "temp" in name.lower():
            found[f"temperature ({topic}.{name})"] = np.array(
                [float(np.mean(r.column(topic, name))) for r in evidence.recordings]
            )
    moved = next(iter(evidence.machine.replays)).guide if evidence.machine.replays else None
    component = moved or next(iter(evidence.models[0].components()), None)
    if component is not None:
        motions = [model.motion(component, evidence.plant) for model in evidence.models]
        found["amplitude (rms of motion)"] = np.array(
            [float(np.std(motion.position)) for motion in motions]
        )
        found["load (rms of force)"] = np.array(
            [float(np.sqrt(np.mean(motion.force**2))) for motion in motions]
        )
    return {name: values for name, values in found.items() if np.isfinite(values).all()}


def _with_trends(
    each: Parameter, covariates: dict[str, Array], thresholds: Thresholds
) -> Parameter:
    if each.verdict != "changed":
        return each
    values = np.array([interval.value for interval in each.values])
    widths = np.array([0.5 * (interval.high - interval.low) for interval in each.values])
    trends = fit_trends(
        values, widths / thresholds.interval_half_width, covariates, float(BLOCKS - 1)
    )
    rivals, named = name_trends(
        trends, len(values), thresholds.trend_share, thresholds.trend_margin
    )
    return replace(each, trends=rivals, named=named)
