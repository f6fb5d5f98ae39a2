"""Suggestions, by the data, of columns that may be the forces at the joints."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import permutations

from rigtwin.describing.force_signals import NEAR_GEAR, SHOWN, slope_of
from rigtwin.describing.log import Log
from rigtwin.describing.match import UNNAMED
from rigtwin.describing.quantity import SI, JointQuantity
from rigtwin.describing.question import enumerate_names, option
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.units import actuator_constant
from rigtwin.description.joint_elements import actuator_on
from rigtwin.numerics.arrays import Array

SUGGESTED = 3
"""Columns of one joint that a question offers."""
SHOWN_OF_SUM = 0.2
"""Share of a force that the model must explain for a sum of columns to be suggested: less than of a
single column, as the unit must fit as well."""


def suggest_forces(
    log: Log, joints: Sequence[str], positions: Mapping[str, Array], forces: Mapping[str, LogSignal]
) -> None:
    """Ask whether currents, or columns without a meaning, are the forces that are missing.

    Parameters
    ----------
    log
        The log. Questions are added to it.
    joints
        Joints that take part.
    positions
        Joint → position, SI, shape (rows,).
    forces
        Forces that are known.
    """
    # Nothing pushes a joint without an actuator, unless the model, as a URDF, has none at all.
    lacking = [
        joint
        for joint in joints
        if joint not in forces
        and (actuator_on(log.mechanism, joint) or not log.mechanism.model.nactuator)
    ]
    currents = {joint: log.slots.columns(joint, JointQuantity.CURRENT) for joint in lacking}
    offers = {joint: names for joint, names in currents.items() if names}
    # With one joint, any column without a meaning could be its force; with several, the offers
    # would be too many to judge.
    if len(joints) == 1 and lacking and not offers:
        offers = {joints[0]: [name for name, why in log.unused.items() if why == UNNAMED]}
    if len(joints) == 1 and lacking and _suggest_sum(log, joints[0], positions):
        return
    unclear: list[tuple[str, str]] = []
    for joint, names in offers.items():
        for name in names[:SUGGESTED]:
            slope = slope_of(log, joint, positions, log.columns.values[name])
            # The slope is the number of units per newton, so its inverse converts the column.
            if slope is not None and slope.explained > SHOWN:
                factor = f"{1.0 / slope.slope:.4g}"
                unit = SI[JointQuantity.FORCE][log.mechanism.turns(joint)]
                log.questions.append(
                    f"column {name!r} explains {100.0 * slope.explained:.0f} % of the force that "
                    f"the model needs at {joint}, with {factor} {unit} a unit: is it that force? "
                    f"then say {option(f'{joint}.force', f'{factor} * {name}')}, with the factor "
                    "that you know"
                )
            elif currents[joint]:
                unclear.append((joint, name))
    if unclear:
        joint, name = unclear[0]
        names = enumerate_names([column for _, column in unclear])
        log.questions.append(
            f"{names} are currents; what force at the joint does one ampere make, behind the gear? "
            f"say {option(f'{joint}.force', f'FACTOR * {name}')}"
            + (", and the same of the others" if len(unclear) > 1 else "")
        )


def _suggest_sum(log: Log, joint: str, positions: Mapping[str, Array]) -> bool:
    """Suggest the sum of several columns, such as the pressures in the chambers of a cylinder.

    The joint has as many actuators as there are columns without a meaning. Each column is the
    control of one of them, in a unit that is a power of ten of the model's. Returns whether there
    is a suggestion.
    """
    mechanism = log.mechanism
    acting = [
        name
        for name in mechanism.names("actuator")
        if mechanism.joint_of("actuator", name) == joint
        and not mechanism.positions(name)
        and not mechanism.falls_with_speed(name)
    ]
    columns = [name for name, why in log.unused.items() if why == UNNAMED]
    if not 1 < len(acting) == len(columns) <= SUGGESTED:
        return False
    sums: list[tuple[float, str]] = []
    for order in permutations(columns):
        weights = [actuator_constant(mechanism, name) for name in acting]
        terms = [w * log.columns.values[c] for w, c in zip(weights, order, strict=True)]
        slope = slope_of(log, joint, positions, sum(terms[1:], terms[0]))
        if slope is None or slope.slope <= 0.0 or slope.explained < SHOWN_OF_SUM:
            continue
        unit = 10.0 ** round(-math.log10(slope.slope))
        if 1.0 / NEAR_GEAR < unit * slope.slope < NEAR_GEAR:
            parts = [f"{unit * w:.6g} * {c}" for w, c in zip(weights, order, strict=True)]
            sums.append((slope.explained, " + ".join(parts).replace("+ -", "- ")))
    if not sums:
        return False
    explained, formula = max(sums)
    log.questions.append(
        f"with {enumerate_names(columns)} as the controls of {enumerate_names(acting)}, the model "
        f"explains {100.0 * explained:.0f} % of their force: is that so? then say "
        f"{option(f'{joint}.force', formula)}"
    )
    return True
