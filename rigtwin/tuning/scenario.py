"""The circumstances of one run: a road and noise of its own, a rig as it may be. Every candidate meets the same ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigtwin.channels import SUSPENSION_RIG
from rigtwin.configuration import Configuration, overridden
from rigtwin.machine.library import find
from rigtwin.parameters import Plant
from rigtwin.posterior import Changes, Posterior, shifted_within
from rigtwin.tuning.study import Study

NONE: Changes = {}
APART = 1_000_000
"""Between the seeds of search and judgement: no study has as many roads."""


@dataclass(frozen=True)
class Scenario:
    """seed: of road and noise; plant: of the rig."""

    seed: int
    plant: Plant


Rig = Callable[[Configuration, np.random.Generator], Configuration]
"""Draws a rig: of a configuration and random numbers, the configuration with what is known of this rig."""


def nominal(configuration: Configuration, _: np.random.Generator) -> Configuration:
    """The rig as the study has it."""
    return configuration


def diagnosed(posterior: Posterior) -> Rig:
    """The rig of a diagnosis, each value as uncertain as that left it."""
    return posterior.drawn


def drawn(study: Study, rig: Rig, count: int, first: int, certain: Changes = NONE) -> list[Scenario]:
    """Scenarios with seeds from `first` on, each drawn from its seed alone, so that more of them leave the others as they are.

    Tolerances and varied parameters are uniform within their bounds, about what is known of the rig; certain: what has a value
    for certain.
    """
    tolerances = find(SUSPENSION_RIG).tolerances if study.tolerances else ()
    found = []
    for seed in range(first, first + count):
        random = np.random.default_rng([seed, 3])
        configuration = rig(study.configuration, random)
        for tolerance in tolerances:
            width = study.tolerances * tolerance.width(configuration.plant)
            key = f"{tolerance.group}.{tolerance.parameter}"
            configuration = shifted_within(configuration, key, width * random.uniform(-1.0, 1.0))
        for key, share in study.vary.items():
            group, _, name = key.partition(".")
            value = float(getattr(getattr(configuration.plant, group), name))
            configuration = shifted_within(configuration, key, value * share * random.uniform(-1.0, 1.0))
        found.append(Scenario(seed, overridden(configuration, certain).plant))
    return found
