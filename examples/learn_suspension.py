"""An active suspension learned on the rig's environment: a linear policy of four numbers, by
differential evolution.

    python examples/learn_suspension.py

The agent sets the suspension's damping and preload every 10 ms from what the controller knows. What
it finds is a skyhook.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import differential_evolution

from experiments.environment import environment
from rigtwin.studies.environment import Environment, Reward

BOUNDS = [(10.0, 300.0), (0.0, 1500.0), (-300.0, 300.0), (-200.0, 200.0)]
"""Damping, Ns/m; preload per structure velocity, N/(m/s), per travel velocity, N/(m/s), per travel,
N/m."""
SECONDS = 6


def policy(weights: np.ndarray, observed: dict[str, np.ndarray]) -> np.ndarray:
    travel, velocity, _, _, structure_velocity = observed["controller"]
    damping, sky, relative, position = weights
    preload = 200.0 - sky * structure_velocity - relative * velocity - position * travel
    return np.array([damping, np.clip(preload, 100.0, 300.0)])


def episode(env: Environment, weights: np.ndarray) -> float:
    step, total = env.reset(), 0.0
    for _ in range(SECONDS * 100):
        step = env.step(policy(weights, step.observation))
        total += step.reward
        if step.last():
            break
    return total


def main() -> None:
    reward = Reward(travel=np.inf)
    roads = range(1)

    def cost(weights: np.ndarray) -> float:
        return -sum(episode(environment("passive", seed, reward=reward), weights) for seed in roads)

    passive = np.array([50.0, 0.0, 0.0, 0.0])
    found = differential_evolution(
        cost, BOUNDS, maxiter=4, popsize=2, x0=passive, rng=1, polish=False
    )
    print(
        "damping {:.0f} Ns/m; preload per structure velocity "
        "{:.0f}, per travel velocity {:.0f} N/(m/s)".format(*found.x[:3])
    )
    for name, weights in (("passive", passive), ("learned", found.x)):
        totals = [
            episode(environment("passive", seed, reward=reward), weights)
            for seed in range(100, 104)
        ]
        print(
            f"{name}: reward on four new roads {np.mean(totals):.0f}, "
            f"from {min(totals):.0f} to {max(totals):.0f}"
        )


if __name__ == "__main__":
    main()
