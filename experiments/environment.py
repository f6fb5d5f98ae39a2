"""An experiment by its name as an environment to learn in."""

from __future__ import annotations

from experiments import find
from rigtwin.studies.environment import INTERVAL, Actions, Environment, Reward


def environment(
    experiment: str,
    seed: int = 0,
    actions: Actions | None = None,
    reward: Reward = Reward(),  # noqa: B008
    interval: int = INTERVAL,
) -> Environment:
    """An experiment as a dm_env environment.

    Parameters
    ----------
    experiment
        One of `rigtwin list`.
    seed, actions, reward, interval
        As `rigtwin.studies.environment.Environment` has them.

    Returns
    -------
    Environment
        Before its first episode.

    Raises
    ------
    RigtwinError
        For an experiment that there is not, or figures that make no sense.
    """
    found = find(experiment)
    return Environment(found.configuration, found.demands, seed, actions, reward, interval)
