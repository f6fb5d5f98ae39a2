"""An active suspension, learned on the rig's environment by differential evolution.

    python examples/learn_suspension.py

A linear policy of four numbers sets the damping and preload of the suspension every 10 ms, from the
state of the controller. The result is a skyhook.
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
    """Return the action, damping, Ns/m, and preload, N, for an observation."""
    travel, velocity, _, _, structure_velocity = observed["controller"]
    damping, sky, relative, position = weights
    # Preload against the body's velocity is a skyhook; the other terms correct spring and damper.
    preload = 200.0 - sky * structure_velocity - relative * velocity - position * travel
    return np.array([damping, np.clip(preload, 100.0, 300.0)])


def episode(env: Environment, weights: np.ndarray) -> float:
    """Return the total reward of one episode."""
    step, total = env.reset(), 0.0
    for _ in range(SECONDS * 100):
        step = env.step(policy(weights, step.observation))
        total += step.reward
        if step.last():
            break
    return total


def main() -> None:
    """Learn a policy, and compare it with the passive suspension on new roads."""
    # An infinite scale removes the travel from the reward; ride and road holding remain.
    reward = Reward(travel=np.inf)
    roads = range(1)

    def cost(weights: np.ndarray) -> float:
        return -sum(episode(environment("passive", seed, reward=reward), weights) for seed in roads)

    passive = np.array([50.0, 0.0, 0.0, 0.0])
    optimum = differential_evolution(
        cost, BOUNDS, maxiter=4, popsize=2, x0=passive, rng=1, polish=False
    )
    print(
        "damping {:.0f} Ns/m; preload per structure velocity "
        "{:.0f}, per travel velocity {:.0f} N/(m/s)".format(*optimum.x[:3])
    )
    for name, weights in (("passive", passive), ("learned", optimum.x)):
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
