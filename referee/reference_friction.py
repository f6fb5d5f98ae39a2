"""Friction of the referee's rig.

Dry friction is set-valued, solved by projection, or a bristle that yields before it slides.
"""

from __future__ import annotations

import math

import numba

from referee.reference_truth import STEP, ReferenceSlider, Truth

Bounds = tuple[float, float, float, float]
"""Bounds of dry friction: of the rail in positive and in negative direction, then of the rod."""


@numba.njit(cache=True, nogil=True)
def dry_bounds(slider: ReferenceSlider, speed: float, position: float) -> tuple[float, float]:
    """Return the bounds of dry friction in positive and in negative direction, N.

    The size is F_c + F_p exp(−(|v|/v_s)^n), times the variation along the way.
    """
    size = slider.coulomb + slider.peak * math.exp(
        -((abs(speed) / slider.peak_speed) ** slider.peak_shape)
    )
    size *= 1.0 + slider.wave * math.sin(2.0 * math.pi * position / slider.wave_length)
    return max(size + 0.5 * slider.asymmetry, 0.0), max(size - 0.5 * slider.asymmetry, 0.0)


@numba.njit(cache=True, nogil=True)
def solve(rhs: float, mass: float, bounds: Bounds, plate: float) -> float:
    """Return the velocity of the carriage after a step, m/s.

    Solves m v + F_rail(v) − F_rod(plate − v) = rhs, with rhs and bounds as impulses in Ns. The left
    side rises monotonically with v, with jumps where rail or rod stick, so bisection always
    converges.
    """
    rail_up, rail_down, rod_up, rod_down = bounds
    # No friction can move the carriage beyond these bounds: they bracket the root.
    low = min(0.0, plate, rhs / mass) - (rail_up + rail_down + rod_up + rod_down) / mass - 1e-12
    high = max(0.0, plate, rhs / mass) + (rail_up + rail_down + rod_up + rod_down) / mass + 1e-12
    for guess in (0.0, plate):
        # Sticking is a solution if zero lies within the jump of the balance there.
        least = mass * guess - rhs
        most = least
        least += -rail_down if guess <= 0.0 else rail_up
        most += rail_up if guess >= 0.0 else -rail_down
        least -= rod_up if guess <= plate else -rod_down
        most += rod_down if guess >= plate else -rod_up
        if least <= 0.0 <= most:
            return guess
    # 60 halvings of a bracket of some m/s end at the resolution of a double.
    for _ in range(60):
        middle = 0.5 * (low + high)
        value = mass * middle - rhs + (rail_up if middle > 0.0 else -rail_down)
        value -= rod_up if plate > middle else -rod_down
        if value > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@numba.njit(cache=True, nogil=True)
def slide(
    truth: Truth, v: float, plate: float, push: float, bounds: Bounds
) -> tuple[float, float, float]:
    """Return the next velocity of the carriage, m/s, and the rod's viscous and dry friction, N.

    v, plate: velocities of carriage and plate, m/s; push: all other forces on the carriage, N;
    bounds: of dry friction, N.
    """
    rail_up, rail_down, rod_up, rod_down = bounds
    sliding = plate - v
    viscous = truth.motor.viscous * sliding + truth.motor.drag * sliding * abs(sliding)
    impulses = (STEP * rail_up, STEP * rail_down, STEP * rod_up, STEP * rod_down)
    next_velocity = solve(truth.mass * v + STEP * (push + viscous), truth.mass, impulses, plate)
    if next_velocity > plate:
        return next_velocity, viscous, -rod_down
    if next_velocity < plate:
        return next_velocity, viscous, rod_up
    rail = rail_up if next_velocity > 0.0 else (-rail_down if next_velocity < 0.0 else 0.0)
    dry_force = truth.mass * (next_velocity - v) / STEP - push - viscous + rail
    if next_velocity == 0.0:
        # Both stick: the division between them is undetermined. The rail takes what it can.
        dry_force = dry_force - max(-rail_up, min(rail_down, dry_force))
    return next_velocity, viscous, max(-rod_down, min(rod_up, dry_force))


@numba.njit(cache=True, nogil=True)
def plate_under_load(
    truth: Truth,
    v: float,
    unloaded: float,
    deflection: float,
    pull: float,
    push: float,
    bounds: Bounds,
) -> float:
    """Return the load of a compliant structure plate, N, by bisection; pull: motor force, N.

    A greater load lets the plate run ahead, which reduces the load, so the balance is monotone.
    """
    lag = truth.load_lag + STEP
    reach = bounds[2] + bounds[3] + 1.0 + abs(pull)
    low, high = pull - reach, pull + reach
    for _ in range(45):
        load = 0.5 * (low + high)
        plate = unloaded + (truth.structure_hydraulic.compliance * load - deflection) / lag
        _, viscous, dry_force = slide(truth, v, plate, push, bounds)
        if load > pull - viscous - dry_force:
            high = load
        else:
            low = load
    return 0.5 * (low + high)


@numba.njit(cache=True, nogil=True)
def end_of_play(play: float, position: float, end: float) -> tuple[float, bool, bool]:
    """Return the trailing end of a play, m, and whether friction is felt upwards and downwards."""
    end = max(min(end, position + 0.5 * play), position - 0.5 * play)
    return end, position - end >= 0.5 * play - 1e-12, end - position >= 0.5 * play - 1e-12


@numba.njit(cache=True, nogil=True)
def bristle_force(
    stiffness: float, mass: float, bristle: float, speed: float, bound: float
) -> tuple[float, float]:
    """Return the friction of a bristle, N, and its deflection after a step, m; bound: N.

    LuGre bristle (Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419):
    ż = v − σ |v| z / F, stepped implicitly, because σ is stiff; damping ratio 0.3 of mass on σ.
    """
    bent = (bristle + STEP * speed) / (1.0 + STEP * abs(speed) * stiffness / max(bound, 1e-3))
    rate = (bent - bristle) / STEP
    return stiffness * bent + 2.0 * math.sqrt(stiffness * mass) * 0.3 * rate, bent
