"""A named experiment as a reinforcement-learning environment."""

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
    """Return a dm_env environment that runs a named experiment.

    Parameters
    ----------
    experiment : str
        Name of the experiment, as `rigtwin list` prints it.
    seed : int
        Seed of the first episode's excitation and sensor noise. Defaults to 0.
    actions, reward, interval
        Arguments of `rigtwin.studies.environment.Environment`.

    Returns
    -------
    Environment
        Environment before its first episode.

    Raises
    ------
    RigtwinError
        If the experiment does not exist or an argument is out of range.
    """
    chosen = find(experiment)
    return Environment(chosen.configuration, chosen.demands, seed, actions, reward, interval)
