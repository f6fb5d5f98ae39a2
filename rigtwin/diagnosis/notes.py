"""Notes of an answer."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.description.machine import Machine
from rigtwin.diagnosis.contacts import find_contacts
from rigtwin.diagnosis.data_checks import SHORTEST_PART, find_faults
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import (
    Tolerated,
)
from rigtwin.diagnosis.judgement import (
    Judgement,
)
from rigtwin.diagnosis.readings import SignalReadings
from rigtwin.diagnosis.signal_findings import (
    describe_negligible,
)
from rigtwin.diagnosis.stops import find_cut_commands, find_stops
from rigtwin.diagnosis.thresholds import Thresholds
from rigtwin.diagnosis.tolerated import describe_used_up
from rigtwin.diagnosis.unused_channels import describe_unused
from rigtwin.diagnosis.usable_data import (
    recording_notes,
)
from rigtwin.recording import RecordedTest


def contact_notes(machine: Machine, recordings: Sequence[RecordedTest]) -> list[str]:
    """Return a note for each pair of geoms that touch along a recording.

    Parameters
    ----------
    machine
        Machine that was recorded.
    recordings
        Its recordings.
    """
    return [
        f"{recording.path.name}: {line}"
        for recording in recordings
        for line in find_contacts(machine, recording)
    ]


def collect_notes(
    evidence: Evidence,
    judged: Judgement,
    readings: SignalReadings,
    tolerated: Sequence[Tolerated],
    thresholds: Thresholds,
) -> list[str]:
    """Return the notes of an answer.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    judged
        Named effects and what remains.
    readings
        Properties of controller and sensors that were read off signals.
    tolerated
        Deviations that the declared tolerances absorb.
    thresholds
        Thresholds, of which the effort of the search is stated.
    """
    cut = (
        f"the search ended after about {thresholds.effort:.0f} s of processor time, before all "
        f"hypotheses were tried: an effect may be missing, or named in the place of another; "
        f"--effort {5 * thresholds.effort:.0f} searches longer"
    )
    return [
        *([cut] if judged.explanation.ended_early else []),
        *recording_notes(evidence.recordings),
        *_prediction_notes(evidence),
        *_clipping_notes(evidence),
        *find_stops(evidence.machine, evidence.recordings),
        *find_cut_commands(evidence.machine, evidence.recordings),
        *judged.notes,
        *describe_unused(evidence, judged.plant),
        *map(describe_negligible, readings.negligible),
        *describe_used_up(tolerated),
    ]


def _prediction_notes(evidence: Evidence) -> list[str]:
    return [
        f"{recording.path.name}: {note}"
        for recording, model in zip(evidence.recordings, evidence.models, strict=True)
        for note in model.notes()
    ]


def _clipping_notes(evidence: Evidence) -> list[str]:
    return [
        f"{recording.path.name}: {fault.message}; those ticks are left out"
        for recording, configuration in zip(
            evidence.recordings, evidence.configurations, strict=True
        )
        # The length was judged before, by the rules for the whole set.
        for fault in find_faults(evidence.machine, recording, configuration, SHORTEST_PART)
        if not fault.fatal
    ]
