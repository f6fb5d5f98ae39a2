"""The force law of an MJCF actuator: its delay, its filter, and the parts that no component can
express.

MuJoCo computes an actuator's force as gain · activation + bias, where the bias of an affine
actuator is bias₀ + bias₁ · length + bias₂ · velocity (MuJoCo documentation, "Actuation model"). A
component of `rigtwin` expresses a part of that law; `find_obstacle` reports the first thing that it
cannot express.
"""

from __future__ import annotations

import mujoco
import numpy as np

FIXED = int(mujoco.mjtGain.mjGAIN_FIXED)
AFFINE_GAIN = int(mujoco.mjtGain.mjGAIN_AFFINE)
DC_MOTOR = int(mujoco.mjtGain.mjGAIN_DCMOTOR)
NO_BIAS, AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
NO_DYNAMICS = int(mujoco.mjtDyn.mjDYN_NONE)
FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
"""Activation dynamics that are a first-order lag of the command."""
HISTORY_TOLERANCE = 1e-9
"""Rounding error allowed between a delay and the history that holds it, as a share of a
timestep."""
VELOCITY_SERVO = "velocity servo"
"""Type of component whose force falls with speed."""
EXPECTED_TYPE = f'expected type = "{VELOCITY_SERVO}"'
EXPECTED = "expected <motor>, <position>, <velocity>, or <general> with a fixed gain"


def lies_at_command(model: mujoco.MjModel, number: int) -> bool:
    """Return whether an actuator's force grows with its distance from a commanded position."""
    # An affine bias with bias₁ ≠ 0 is a spring; MuJoCo's <position> has bias₁ = −kp.
    affine = int(model.actuator_biastype[number]) == AFFINE
    return affine and float(model.actuator_biasprm[number, 1]) != 0.0


def read_timing(model: mujoco.MjModel, number: int) -> dict[str, float]:
    """Return the delay and the lag of an actuator's command.

    Parameters
    ----------
    model
        Compiled MJCF.
    number
        Index of the actuator.

    Returns
    -------
    dict of str to float
        `delay`, s, and `lag`, s, where the MJCF gives them; empty for an actuator without both.
    """
    timing: dict[str, float] = {}
    if model.actuator_delay[number] > 0.0:
        timing["delay"] = float(model.actuator_delay[number])
    if int(model.actuator_dyntype[number]) in FILTERS:
        # MuJoCo: act' = (ctrl − act)/τ with τ = dynprm₀.
        timing["lag"] = float(model.actuator_dynprm[number, 0])
    return timing


def rest_position(model: mujoco.MjModel, number: int) -> dict[str, float]:
    """Return gain and offset of the position at which a position actuator exerts no force.

    The force is zero where gear · position = (gain · command + bias₀) / −bias₁.

    Parameters
    ----------
    model
        Compiled MJCF.
    number
        Index of the actuator.

    Returns
    -------
    dict of str to float
        `gain`, 1, and `offset`, m or rad. A gain of 1 and an offset of 0 are omitted, so that the
        result is empty for a joint that rests at its command.
    """
    gain, bias = float(model.actuator_gainprm[number, 0]), model.actuator_biasprm[number]
    gear = float(model.actuator_gear[number, 0])
    if not lies_at_command(model, number) or gear == 0.0:
        return {}
    # Solved for the joint's position; bias₁ is negative, as −kp.
    share, offset = -gain / float(bias[1]) / gear, -float(bias[0]) / float(bias[1]) / gear
    parameters = {} if np.isclose(share, 1.0) else {"gain": share}
    return parameters | ({} if offset == 0.0 else {"offset": offset})


def is_dc_motor(model: mujoco.MjModel, number: int) -> bool:
    """Return whether an actuator is a DC motor, whose command is a voltage."""
    return int(model.actuator_gaintype[number]) == DC_MOTOR


def falls_with_speed(model: mujoco.MjModel, number: int) -> bool:
    """Return whether an actuator's force depends on its command and on velocity alone."""
    if is_dc_motor(model, number):
        return True
    affine = int(model.actuator_biastype[number]) == AFFINE
    return affine and model.actuator_biasprm[number, 1] == 0.0 < -model.actuator_biasprm[number, 2]


def velocity_law(model: mujoco.MjModel, number: int) -> tuple[float, float]:
    """Return gain and damping of an actuator whose force falls with speed.

    In steady state at the voltage u, MuJoCo's DC motor exerts
    force = gear · K/R · u − (gear · K)²/R · speed, with the resistance R = gainprm₀ and the motor
    constant K = gainprm₁. Any other such actuator exerts gear · gain · command + gear² · bias₂ ·
    speed, where a <velocity> has gain = −bias₂ = kv (MuJoCo documentation, "Actuation model").

    Parameters
    ----------
    model
        Compiled MJCF.
    number
        Index of the actuator.

    Returns
    -------
    tuple of two numbers
        Force per command, N or Nm, and force per speed, Ns/m or Nms/rad.
    """
    gain, gear = model.actuator_gainprm[number], float(model.actuator_gear[number, 0])
    if is_dc_motor(model, number):
        resistance, constant = float(gain[0]), gear * float(gain[1])
        return constant / resistance, constant**2 / resistance
    # The actuator's speed is gear · joint speed, and its force acts through the gear again.
    return gear * float(gain[0]), -float(model.actuator_biasprm[number, 2]) * gear**2


def find_obstacle(model: mujoco.MjModel, number: int, kind: str) -> str | None:
    """Return the first property of an actuator that a component of this type cannot express.

    Parameters
    ----------
    model
        Compiled MJCF.
    number
        Index of the actuator.
    kind
        Type of the component: force actuator, servo, velocity servo or position actuator.

    Returns
    -------
    str or None
        Sentence with the property and the expected value; None if the component expresses all.
    """
    # A channel of a recording holds one number.
    if model.actuator_ctrlnum[number] != 1:
        return f"it takes {model.actuator_ctrlnum[number]} commands; expected one"
    obstacle = _find_in_timing(model, number)
    if obstacle is not None:
        return obstacle
    # A position actuator prescribes its joint's position, so forces within it have no influence.
    if kind == "position actuator":
        return None
    # Such parameters act at the actuator's length, behind the gear; those of the joint are
    # components.
    for values, attribute in (
        (model.actuator_damping, "damping"),
        (model.actuator_armature, "armature"),
    ):
        if values[number] != 0.0:
            return (
                f"its {attribute} is {values[number]:g}; expected 0, and the {attribute} at the "
                "joint that it moves"
            )
    return _find_in_gain(model, number, kind) or _find_in_bias(model, number, kind)


def _find_in_timing(model: mujoco.MjModel, number: int) -> str | None:
    delay, samples = float(model.actuator_delay[number]), int(model.actuator_history[number, 0])
    # MuJoCo clips a delay to the length of the history silently: nsample · timestep ≥ delay.
    required = delay / float(model.opt.timestep)
    if samples < required - HISTORY_TOLERANCE:
        return (
            f"its nsample {samples} holds {samples * model.opt.timestep:g} s of its delay of "
            f"{delay:g} s; expected nsample at least {int(np.ceil(required - HISTORY_TOLERANCE))}"
        )
    dynamics = int(model.actuator_dyntype[number])
    if dynamics in FILTERS and model.actuator_actlimited[number]:
        low, high = model.actuator_actrange[number]
        return f"its actrange {low:g} {high:g} limits a filtered command; expected ctrlrange alone"
    if dynamics in (NO_DYNAMICS, *FILTERS) or int(model.actuator_gaintype[number]) == DC_MOTOR:
        return None
    name = mujoco.mjtDyn(dynamics).name.removeprefix("mjDYN_").lower()
    return f"its activation dynamics are dyntype {name}; expected none, filter or filterexact"


def _find_in_gain(model: mujoco.MjModel, number: int, kind: str) -> str | None:
    gain = int(model.actuator_gaintype[number])
    if gain == DC_MOTOR:
        return _find_in_dc_motor(model, number, kind)
    # Without its terms in length and velocity an affine gain is a fixed one.
    depends_on_motion = model.actuator_gainprm[number, 1:3].any()
    if gain == FIXED or (gain == AFFINE_GAIN and not depends_on_motion):
        return None
    name = mujoco.mjtGain(gain).name.removeprefix("mjGAIN_").lower()
    cause = "by position and speed" if gain == AFFINE_GAIN else "by a law of its own"
    return f"its gaintype is {name}, force per command {cause}; {EXPECTED}"


def _find_in_dc_motor(model: mujoco.MjModel, number: int, kind: str) -> str | None:
    # Inductance, cogging, thermal and current-limit parameters invalidate the steady-state law.
    plain = (
        model.actuator_gainprm[number, 0] > 0.0
        and not model.actuator_gainprm[number, 2:].any()
        and not model.actuator_biasprm[number].any()
        and not model.actuator_dynprm[number].any()
    )
    if not plain:
        return (
            "it is a <dcmotor> with more than a resistance and a motor constant; expected these "
            "two alone"
        )
    return None if kind == VELOCITY_SERVO else f"it is a <dcmotor>; {EXPECTED_TYPE}"


def _find_in_bias(model: mujoco.MjModel, number: int, kind: str) -> str | None:
    bias_type, bias = int(model.actuator_biastype[number]), model.actuator_biasprm[number]
    # The bias of a DC motor is its back-EMF, which belongs to its gain.
    if (
        is_dc_motor(model, number)
        or bias_type == NO_BIAS
        or (bias_type == AFFINE and not bias[:3].any())
    ):
        return None
    if bias_type != AFFINE:
        name = mujoco.mjtBias(bias_type).name.removeprefix("mjBIAS_").lower()
        return f"its biastype is {name}; {EXPECTED}"
    if bias[0] != 0.0:
        return f"its constant force is {bias[0]:g} (biasprm); expected 0"
    if kind == "servo":
        problem = f"its force by speed is {bias[2]:g} (biasprm); expected 0 or a negative number"
        return problem if bias[2] > 0.0 else None
    if bias[1] != 0.0:
        return f'its force depends on position, {bias[1]:g} (biasprm); expected type = "servo"'
    if bias[2] > 0.0:
        return f"its force grows with speed, {bias[2]:g} (biasprm); expected 0 or a negative number"
    if kind == VELOCITY_SERVO:
        return None
    return f"its force depends on speed, {bias[2]:g} (biasprm); {EXPECTED_TYPE}"
