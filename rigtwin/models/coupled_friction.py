"""Dry friction of guides that act on each other, by projected Gauss-Seidel. Compiled.

The friction of one guide changes the velocity along all others. Let w_g be the velocity along guide
g without any dry friction, and C_gj the velocity that 1 N of friction at guide j takes from it over
a step. The friction forces F satisfy

    v_g = w_g − Σ_j C_gj·F_j,   F_g = clip(k_g·stretch(v_g), −backward_g, forward_g)

Each sweep solves one guide after another, with the others' friction at its latest value (Jourdan,
Alart and Jean, Computer Methods in Applied Mechanics and Engineering 155, 1998). The limits are a
projection. The iteration converges because the matrix C is positive semidefinite.
"""

from __future__ import annotations

import math

import numpy as np

from rigtwin.models.forward_arrays import GuideContacts, State, WorkSpace
from rigtwin.numerics.cholesky import solve
from rigtwin.numerics.compiling import kernel, part_kernel

SWEEPS = 200
"""Maximum number of Gauss-Seidel sweeps."""
CONVERGED = 1e-10
"""Largest change of a friction force at which the sweeps end, as a share of the largest friction
limit."""


@kernel
def bear(
    stretch: float,
    free: float,
    compliance: float,
    h: float,
    half: float,
    spring: float,
    forward: float,
    backward: float,
) -> float:
    """Return the dry friction of one guide over a step, with the friction of the others fixed.

    The friction is a spring of stiffness k behind a backlash b, limited to what the contact bears:
    F = k·(x⁺ − x_slider ∓ b/2) with x⁺ = x + h·(v_free − w·F), clipped to [−backward, forward].

    Parameters
    ----------
    stretch
        Distance from the friction element to the guide, m.
    free
        Velocity of the guide without this friction, m/s.
    compliance
        Velocity that 1 N of friction takes from the guide over the step (w), m/(s N).
    h
        Step, s.
    half
        Half the backlash, m.
    spring
        Stiffness in series with the friction, N/m.
    forward, backward
        Limits of the friction against positive and negative motion, N.

    Returns
    -------
    float
        Friction force, N.
    """
    unopposed = stretch + h * free
    if -half <= unopposed <= half:
        return 0.0
    stretched = unopposed - math.copysign(half, unopposed)
    # The friction slows the guide and so reduces its own spring's stretch: hence the denominator.
    force = spring * stretched / (1.0 + h * spring * compliance)
    return min(max(force, -backward), forward)


@part_kernel
def find_responses(contacts: GuideContacts, free: np.ndarray, h: float, work: WorkSpace) -> float:
    """Find velocities without dry friction, and their response to 1 N of friction at each guide.

    Returns the largest limit of any dry friction, N.
    """
    guides, loose, largest = len(contacts.springs), len(free), 0.0
    for g in range(guides):
        work.dry[g] = 0.0
        if work.mounted[g] or not contacts.rubs[g]:
            continue
        largest = max(largest, work.forward[g], work.backward[g])
        for a in range(loose):
            # Impulse of 1 N over the step h along the guide's direction a. The step's Cholesky
            # factor gives the response, M⁻¹·a·h.
            work.column[a] = h * contacts.along[g, free[a]]
            work.unrubbed[g] += contacts.along[g, free[a]] * work.right[a]
        solve(work.system, loose, work.column)
        for a in range(loose):
            work.response[g, a] = work.column[a]
        for second in range(guides):
            work.coupling[second, g] = 0.0
            for a in range(loose):
                work.coupling[second, g] += contacts.along[second, free[a]] * work.column[a]
    return largest


@part_kernel
def rub(contacts: GuideContacts, free: np.ndarray, state: State, h: float, work: WorkSpace) -> None:
    """Find the dry friction of all guides, and subtract its effect from the free velocities."""
    guides, loose = len(contacts.springs), len(free)
    largest = find_responses(contacts, free, h, work)
    for _ in range(SWEEPS):
        changed = 0.0
        for g in range(guides):
            if work.mounted[g] or not contacts.rubs[g]:
                continue
            speed = work.unrubbed[g]
            for second in range(guides):
                if second != g:
                    speed -= work.coupling[g, second] * work.dry[second]
            friction_force = bear(
                stretch=work.place[g] - state.slider[g],
                free=speed,
                compliance=work.coupling[g, g],
                h=h,
                half=0.5 * contacts.guides[g].backlash,
                spring=contacts.springs[g],
                forward=work.forward[g],
                backward=work.backward[g],
            )
            changed = max(changed, abs(friction_force - work.dry[g]))
            work.dry[g] = friction_force
        # With a single guide, the first sweep is exact and the second one ends the loop.
        if changed <= CONVERGED * largest:
            break
    for g in range(guides):
        if work.dry[g] != 0.0:
            for a in range(loose):
                work.right[a] -= work.response[g, a] * work.dry[g]
