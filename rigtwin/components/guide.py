"""Guide between a moving part and the frame: its parameters.

The law of its friction is Coulomb, Stribeck and viscous friction (Armstrong-Hélouvry, Dupont and
Canudas de Wit, Automatica 30(7), 1994); `Guide` states its equations. `docs/theory.md` says which
load counts.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.quantity import MJCF, NONE, STRIBECK_EXPONENT, Quantity

ONE_WAY = 0.05
"""Smallest friction of the weaker direction, as a share of the mean. No guide slides freely one way
and rubs the other way."""
CURVE = ("curve_2", "curve_3", "curve_4", "curve_5")
"""Coefficients of the curve of a position-dependent force."""
FRAME = ("curve_middle", "curve_half_range")
"""Range of positions to which the coefficients refer."""


class Rail(NamedTuple):
    """Friction of the suspension rig's rail guide, with true stiction.

    `Motor` has the same friction parameters. The law is that of `Guide`.
    """

    coulomb: Annotated[float, Quantity("N", 0.0, 1000.0, "breakaway, thesis §6.1.3")] = 50.0
    viscous: Annotated[float, Quantity("Ns/m", 0.0, 1e4, NONE)] = 0.0
    stribeck: Annotated[float, Quantity("N", -500.0, 1000.0, NONE)] = 0.0
    stribeck_velocity: Annotated[
        float, Quantity("m/s", 1e-4, 0.1, "of the order seen in rail guides, assumed")
    ] = 0.01
    stribeck_exponent: Annotated[float, STRIBECK_EXPONENT] = 2.0
    asymmetry: Annotated[float, Quantity("N", -500.0, 500.0, NONE)] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 0.05, NONE)] = 0.0


class Guide(NamedTuple):
    """Force between a moving part and the frame: friction, a damper, a spring.

    With position x, velocity v and transmitted force F_t:

        force        = F_viscous + drag·v·|v| + F_position + F_stop + F_dry
        F_viscous    = (viscous ± ½·viscous_asymmetry)·v, through a first-order lag `relaxation`
        F_position   = stiffness·t(x − x_rest) + cubic_stiffness·t(x − x_rest)³ + offset
                       + cogging·sin(2π·x/cogging_pitch + cogging_phase)
                       + Σ_n curve_n·T_n(ξ),  n = 2 … 5
                       + stop_stiffness·s(x)
        F_stop       = stop_damping·v  where s(x) ≠ 0
        |F_dry|      ≤ coulomb + load_coefficient·|F_t|
                       + stribeck·exp(−|v/stribeck_velocity|^stribeck_exponent) ± ½·asymmetry

    The upper sign is for positive v. Dry friction acts through a backlash and a spring of
    `compliance` in series. All of it acts through a spring of `mount_compliance` in series.
    Units are those of a sliding joint; for a turning joint, read rad for m and Nm for N.

    T_n is the Chebyshev polynomial of degree n, and ξ = (x − curve_middle)/curve_half_range, held
    within ±1: beyond the range in which a curve was identified, its force stays as at the end.

    Where the motion is given, F_dry may be replaced by the friction that MuJoCo simulates, with
    F_max the limit of |F_dry|:

        F_soft = (v + soft_time·v') / soft_speed, held within ± F_max
        F      = F_dry + softness·(F_soft − F_dry)

    Its sign is that of the motion to come, so that it reverses early (docs/theory.md, "Dry
    friction").

    t(d) is how far d lies beyond ±½·slack, and 0 between them: a spring bears no force while its
    gap is crossed.

    s(x) is how far x lies beyond `stop_high`, or below `stop_low` (negative), and 0 between them.

    The transmitted force is what reaches the guide from the body and the guide's own spring where
    the motion is given, and the actuator's force where the motion follows from a force
    (docs/theory.md, "Load friction").
    """

    # Coulomb friction, viscous friction and spring: the MJCF has values for these.
    coulomb: Annotated[float, Quantity("N", 0.0, 1e7, MJCF)] = 0.0
    viscous: Annotated[float, Quantity("Ns/m", 0.0, 1e9, MJCF)] = 0.0
    stiffness: Annotated[float, Quantity("N/m", -1e12, 1e12, MJCF)] = 0.0
    slack: Annotated[float, Quantity("m", 0.0, 10.0, MJCF)] = 0.0
    stribeck: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    stribeck_velocity: Annotated[
        float, Quantity("m/s", 1e-6, 100.0, "of the order seen in guides, assumed")
    ] = 0.01
    stribeck_exponent: Annotated[float, STRIBECK_EXPONENT] = 2.0
    asymmetry: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    load_coefficient: Annotated[float, Quantity("1", 0.0, 2.0, NONE)] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 10.0, NONE)] = 0.0
    compliance: Annotated[float, Quantity("m/N", 0.0, 1.0, NONE)] = 0.0
    mount_compliance: Annotated[float, Quantity("m/N", 0.0, 1.0, NONE)] = 0.0
    offset: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    viscous_asymmetry: Annotated[float, Quantity("Ns/m", -1e9, 1e9, NONE)] = 0.0
    cubic_stiffness: Annotated[float, Quantity("N/m^3", -1e12, 1e12, NONE)] = 0.0
    drag: Annotated[float, Quantity("Ns^2/m^2", -1e9, 1e9, NONE)] = 0.0
    relaxation: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    cogging: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0
    cogging_pitch: Annotated[float, Quantity("m", 1e-6, 100.0, NONE)] = 0.03
    cogging_phase: Annotated[float, Quantity("rad", -6.3, 6.3, NONE)] = 0.0
    curve_2: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    curve_3: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    curve_4: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    curve_5: Annotated[float, Quantity("N", -1e7, 1e7, NONE)] = 0.0
    curve_middle: Annotated[float, Quantity("m", -1e3, 1e3, NONE)] = 0.0
    curve_half_range: Annotated[float, Quantity("m", 1e-9, 1e3, NONE)] = 1.0
    softness: Annotated[float, Quantity("1", -2.0, 2.0, NONE)] = 0.0
    soft_time: Annotated[float, Quantity("s", 0.0, 10.0, MJCF)] = 0.0
    soft_speed: Annotated[float, Quantity("m/s/N", 0.0, 1e9, MJCF)] = 0.0
    stop_stiffness: Annotated[float, Quantity("N/m", 0.0, 1e12, NONE)] = 0.0
    stop_damping: Annotated[float, Quantity("Ns/m", 0.0, 1e9, NONE)] = 0.0
    stop_low: Annotated[float, Quantity("m", -1e3, 1e3, NONE)] = -1.0
    stop_high: Annotated[float, Quantity("m", -1e3, 1e3, NONE)] = 1.0


STOPS = ("stop_low", "stop_high")
"""Positions of the end stops."""
SHAPES = (
    "slack",
    "stribeck_velocity",
    "stribeck_exponent",
    "cogging_pitch",
    "cogging_phase",
    "softness",
    "soft_time",
    "soft_speed",
    *FRAME,
    *STOPS,
)
"""Parameters of a guide that exert no force by themselves."""


def acts(guide: Guide) -> bool:
    """Return whether any parameter of a guide exerts a force."""
    return any(value for name, value in guide._asdict().items() if name not in SHAPES)


def may_be_soft(guide: Guide) -> bool:
    """Return whether a guide has dry friction of which the soft form is known.

    Friction behind a play or a spring follows the recent motion and not its direction.
    """
    behind = guide.backlash or guide.compliance or guide.mount_compliance
    dry = guide.coulomb or guide.stribeck or guide.asymmetry or guide.load_coefficient
    return guide.soft_speed > 0.0 and bool(dry) and not behind


def resists(guide: Guide) -> bool:
    """Return whether friction resists both directions by at least `ONE_WAY` of the mean.

    Otherwise it is a force of one direction and not the friction of a guide.
    """
    most = 2.0 * (1.0 - ONE_WAY)
    dry = guide.coulomb + abs(guide.stribeck)
    if guide.load_coefficient == 0.0 and abs(guide.asymmetry) > most * dry:
        return False
    return abs(guide.viscous_asymmetry) <= most * guide.viscous
