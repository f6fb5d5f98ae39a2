"""The circumstances of one run: a road and noise of its own, a rig as it may be. Every candidate meets the same ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.components import RigPlant
from rigtwin.machine.configuration import Configuration, overridden
from rigtwin.machine.library import find
from rigtwin.machine.posterior import Changes, Posterior, shifted_within
from rigtwin.recording.channels import SUSPENSION_RIG
from rigtwin.studies.tuning.study import Study

NONE: Changes = {}
APART = 1_000_000
"""Between the seeds of search and judgement: no study has as many roads."""


@dataclass(frozen=True)
class Scenario:
    """seed: of road and noise; plant: of the rig."""

    seed: int
    plant: RigPlant


@dataclass(frozen=True)
class Rig:
    """What is known of a rig. draw: of a configuration and random numbers, the configuration with a rig as it may be; known:
    `component.parameter` of what that has drawn, which is not varied again."""

    draw: Callable[[Configuration, np.random.Generator], Configuration]
    known: frozenset[str] = frozenset()


nominal = Rig(lambda configuration, _: configuration)
"""The rig as the study has it."""


def diagnosed(posterior: Posterior) -> Rig:
    """The rig of a diagnosis, each value as uncertain as that left it."""
    return Rig(posterior.drawn, frozenset(posterior.intervals))


def drawn(study: Study, rig: Rig, count: int, first: int, certain: Changes = NONE) -> list[Scenario]:
    """Scenarios with seeds from `first` on, each drawn from its seed alone, so that more of them leave the others as they are.

    Tolerances and varied parameters are uniform about the rig, cut off at the parameters' bounds; certain: what has a value for
    certain.
    """
    tolerances = find(SUSPENSION_RIG).tolerances if study.tolerances else ()
    found = []
    for seed in range(first, first + count):
        random = np.random.default_rng([seed, 3])
        configuration = rig.draw(study.configuration, random)
        for tolerance in tolerances:
            width = study.tolerances * tolerance.width(configuration.plant)
            key = f"{tolerance.group}.{tolerance.parameter}"
            amount = width * random.uniform(-1.0, 1.0)
            if key not in rig.known:
                configuration = shifted_within(configuration, key, amount)
        for key, share in study.vary.items():
            group, _, name = key.partition(".")
            value = float(getattr(getattr(configuration.plant, group), name))
            amount = value * share * random.uniform(-1.0, 1.0)
            if key not in rig.known:
                configuration = shifted_within(configuration, key, amount)
        found.append(Scenario(seed, overridden(configuration, certain).plant))
    return found
