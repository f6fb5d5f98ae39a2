"""Scenarios: the road, the noise and the rig of one run.

All candidates are simulated in the same scenarios.
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
"""Offset between the seeds of search and evaluation; larger than any study's number of roads."""


@dataclass(frozen=True)
class Scenario:
    """Road, noise and rig of one run.

    Parameters
    ----------
    seed : int
        Seed of road and noise.
    plant : Plant
        Parameters of the rig.
    """

    seed: int
    plant: Plant


@dataclass(frozen=True)
class UncertainRig:
    """Knowledge about a rig: a distribution of its parameters.

    Parameters
    ----------
    name : str
        Name in tables.
    draw : callable
        Function of a configuration and a random generator that returns the configuration with a
        rig drawn from the distribution.
    known : frozenset of str
        Parameters that `draw` sets, as `component.parameter`. Tolerances do not vary them.
    certain : mapping
        Component → parameter → value known with certainty.
    """

    name: str
    draw: Callable[[Configuration, np.random.Generator], Configuration]
    known: frozenset[str] = frozenset()
    certain: Changes = field(default_factory=dict)


NOMINAL = UncertainRig("nominal twin", lambda configuration, _: configuration)
"""The rig as the study describes it."""


def calibrated_rig(posterior: Posterior) -> UncertainRig:
    """Return the rig that a diagnosis found, with its remaining uncertainty."""
    return UncertainRig("calibrated twin", posterior.draw, frozenset(posterior.intervals))


def draw_scenarios(study: Study, rig: UncertainRig, count: int, first: int) -> list[Scenario]:
    """Draw scenarios, each from its own seed.

    A larger count therefore leaves the first scenarios unchanged. Tolerances and varied parameters
    are uniformly distributed about the rig's values and clipped to the parameters' bounds.

    Parameters
    ----------
    study : Study
        Study with the configuration and its variation.
    rig : UncertainRig
        Knowledge about the rig.
    count : int
        Number of scenarios.
    first : int
        Seed of the first scenario; the seeds are consecutive.
    """
    tolerances = study.machine.tolerances if study.variation.tolerances else ()

    def draw(seed: int) -> Scenario:
        # The 3 makes this stream independent of the twin's noise, which has the same seed.
        random = np.random.default_rng([seed, 3])
        configuration = rig.draw(study.configuration, random)

        # The amount is drawn even for a known parameter, so that a calibrated and a nominal rig
        # share the random numbers of all parameters after it.
        def shift(key: str, width: float) -> Configuration:
            amount = width * random.uniform(-1.0, 1.0)
            return configuration if key in rig.known else shift_within(configuration, key, amount)

        # Tolerances come first and in a fixed order, so that each seed always draws the same rig.
        for tolerance in tolerances:
            width = study.variation.tolerances * tolerance.width(configuration.plant)
            configuration = shift(f"{tolerance.group}.{tolerance.parameter}", width)
        for key, share in study.variation.shares.items():
            configuration = shift(key, value_of(configuration, key) * share)
        # Certain values come last, so that neither uncertainty nor tolerances change them.
        return Scenario(seed, override(configuration, rig.certain).plant)

    return [draw(seed) for seed in range(first, first + count)]
