"""Tests on the twin with effects, made once a process, and what a diagnosis begins with."""

from __future__ import annotations

from functools import cache

from experiments import EXPERIMENTS
from rigtwin.components import Effect, find
from rigtwin.description.catalogue import find as machine_of
from rigtwin.description.configuration import Configuration
from rigtwin.description.effects import apply_effects
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.recording import RecordedTest
from rigtwin.rig.simulated import simulate_recording

RIG = machine_of("suspension-rig")


def rig_effect(name: str) -> Effect:
    """An effect of the suspension rig."""
    return find(name, RIG.plant)


@cache
def recorded(
    name: str, effects: tuple[str, ...] = (), seconds: float = 8.0, seed: int = 5
) -> RecordedTest:
    """A test on the twin with effects."""
    configuration = EXPERIMENTS[name].configuration
    configuration = configuration._replace(timing=configuration.timing._replace(duration=seconds))
    demands = EXPERIMENTS[name].demands(configuration, seed)
    return simulate_recording(
        RIG.name, name, apply_effects(configuration, list(effects)), demands, 1
    )


def evidence_of(*recordings: RecordedTest) -> Evidence:
    return Evidence(RIG, recordings, [RIG.configuration_of(recording) for recording in recordings])


def answer(
    *recordings: RecordedTest,
    base: Configuration | None = None,
    held_out: tuple[RecordedTest, ...] = (),
) -> Diagnosis:
    """What the diagnosis of the suspension rig says of them."""
    return diagnose(RIG, recordings, base, held_out)
