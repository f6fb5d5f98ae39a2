"""Which test to run next, where explanations remain: the one whose outcome they predict most
differently."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.description.machine import Machine
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import NextTest
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.space import Space
from rigtwin.simulation.experiment import Experiment

SEED = 1
"""Of the tests that are tried on the twin, and of the one proposed."""
LONGEST = 20.0
"""s, to which a test is cut when it is tried."""
WORTH = 25.0
"""χ² below which a test would separate nothing."""


def propose_test(
    machine: Machine, fits: Sequence[Fit], tests: Sequence[Experiment]
) -> NextTest | None:
    """The test of a menu that separates explanations best; None if none would. fits: the likeliest
    first."""
    if len(fits) < 2:
        return None
    best: NextTest | None = None
    for test in tests:
        name, configuration = test.name, test.configuration
        timing = configuration.timing._replace(duration=min(configuration.timing.duration, LONGEST))
        twin = configuration._replace(plant=fits[0].plant, timing=timing)
        recording = machine.physics.simulate(machine, name, twin, test.demands(twin, SEED), SEED)
        evidence = Evidence(
            machine, [recording], [configuration._replace(plant=fits[0].plant, timing=timing)]
        )
        space = Space(evidence, fits[0].plant)
        own = evidence.predict(fits[0].plant)
        apart = []
        for other in fits[1:]:
            difference = [a - b for a, b in zip(own, evidence.predict(other.plant), strict=True)]
            apart.append(space.misfit(evidence.whiten(difference)))
        least = min(apart)
        if least > WORTH and (best is None or least > best.separates):
            best = NextTest(
                name, f"rigtwin run {name} --seed {SEED}", least, tuple(fit.name for fit in fits)
            )
    return best
