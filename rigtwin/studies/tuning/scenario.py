"""The circumstances of one run: a road and noise of its own, a rig as it may be.

Every candidate meets the same ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration
from rigtwin.description.posterior import Changes, Posterior, shift_within, value_of
from rigtwin.studies.tuning.study import Study

APART = 1_000_000
"""Between the seeds of search and evaluation: no study has as many roads."""


@dataclass(frozen=True)
class Scenario:
    """One road, its noise, and one rig.

    Parameters
    ----------
    seed : int
        Of road and noise.
    plant : Plant
        The rig.
    """

    seed: int
    plant: Plant


@dataclass(frozen=True)
class Rig:
    """What is known of a rig.

    Parameters
    ----------
    name : str
        What it is called in tables.
    draw : callable
        Of a configuration and random numbers, the configuration with the rig as it may be.
    known : frozenset of str
        `component.parameter` of what that draws, which is not varied again.
    certain : mapping
        Component → parameter → a value that it has for certain.
    """

    name: str
    draw: Callable[[Configuration, np.random.Generator], Configuration]
    known: frozenset[str] = frozenset()
    certain: Changes = field(default_factory=dict)


NOMINAL = Rig("nominal twin", lambda configuration, _: configuration)
"""The rig as the study has it."""


def calibrated_rig(posterior: Posterior) -> Rig:
    """The rig of a diagnosis, each value as uncertain as that left it."""
    return Rig("calibrated twin", posterior.draw, frozenset(posterior.intervals))


def draw_scenarios(study: Study, rig: Rig, count: int, first: int) -> list[Scenario]:
    """Draw scenarios, each from its seed alone, so that more of them leave the others as they are.

    Tolerances and varied parameters are uniform about the rig, cut off at the parameters' bounds.

    Parameters
    ----------
    study : Study
        Whose configuration and variation.
    rig : Rig
        What is known of the rig.
    count : int
        How many.
    first : int
        The first one's seed; the others follow.
    """
    tolerances = study.machine.tolerances if study.variation.tolerances else ()

    def draw(seed: int) -> Scenario:
        random = np.random.default_rng([seed, 3])
        configuration = rig.draw(study.configuration, random)

        def shift(key: str, width: float) -> Configuration:
            amount = width * random.uniform(-1.0, 1.0)
            return configuration if key in rig.known else shift_within(configuration, key, amount)

        for tolerance in tolerances:
            width = study.variation.tolerances * tolerance.width(configuration.plant)
            configuration = shift(f"{tolerance.group}.{tolerance.parameter}", width)
        for key, share in study.variation.shares.items():
            configuration = shift(key, value_of(configuration, key) * share)
        return Scenario(seed, override(configuration, rig.certain).plant)

    return [draw(seed) for seed in range(first, first + count)]
