"""Proposal of the next test: the one whose outcome the remaining explanations predict differently.

Every test of a menu is simulated with the likeliest explanation. The distance between two
explanations is χ² of the difference of their predictions, after the tolerances have made up for
what they can.
"""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.description.machine import Machine
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import NextTest
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.space import Space
from rigtwin.simulation.experiment import Experiment

SEED = 1
"""Seed of the simulated tests, and of the proposed one."""
LONGEST = 20.0
"""Duration to which a simulated test is cut, s."""
WORTH = 25.0
"""χ² below which a test does not separate two explanations."""


def propose_test(
    machine: Machine, fits: Sequence[Fit], tests: Sequence[Experiment]
) -> NextTest | None:
    """Choose the test that separates the likeliest explanation best from every other one.

    Parameters
    ----------
    machine
        Machine to be tested.
    fits
        Explanations, the likeliest first.
    tests
        Menu of experiments.

    Returns
    -------
    NextTest or None
        The test with the largest of the smallest χ² between two predictions. None for fewer than
        two explanations, or where no test reaches `WORTH`.
    """
    if len(fits) < 2:
        return None
    best: NextTest | None = None
    for test in tests:
        distance = _smallest_distance(machine, fits, test)
        if distance > WORTH and (best is None or distance > best.separates):
            best = NextTest(
                test.name,
                f"rigtwin run {test.name} --seed {SEED}",
                distance,
                tuple(fit.name for fit in fits),
            )
    return best


def _smallest_distance(machine: Machine, fits: Sequence[Fit], test: Experiment) -> float:
    """Smallest χ² between the prediction of the first explanation and that of another."""
    configuration = test.configuration
    # Every test of the menu is simulated, so long ones are cut.
    timing = configuration.timing._replace(duration=min(configuration.timing.duration, LONGEST))
    twin = configuration._replace(plant=fits[0].plant, timing=timing)
    demands = test.demands(twin, SEED)
    recording = machine.physics.simulate(machine, test.name, twin, demands, SEED)
    # Tests are weighed like real recordings, so a difference that drowns in noise or declared error
    # separates nothing.
    evidence = Evidence(machine, [recording], [twin])
    space = Space(evidence, fits[0].plant)
    reference = evidence.predict(fits[0].plant)
    distances = []
    for fit in fits[1:]:
        predicted = evidence.predict(fit.plant)
        difference = [a - b for a, b in zip(reference, predicted, strict=True)]
        # What the tolerances can make up for is no difference that a test could show.
        distances.append(space.misfit(evidence.whiten(difference)))
    return min(distances)
