"""MuJoCo's system identification toolbox, `mujoco.sysid`, on the machines of this project.

The toolbox is part of `mujoco`; what it imports besides comes with `pip install 'rigtwin[peers]'`.
It fits what an MJCF can say: friction loss, damping, stiffness, inertias. Two kinds of test are
posed to it:

- a *rollout*: MuJoCo integrates the model under the recorded commands (the toolbox's default);
- *inverse dynamics*: the joints move as measured, and `mj_inverse` gives the forces. The toolbox
  has no such residual, but accepts any function as one.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import mujoco
import numpy as np

from rigtwin.components import Guide
from rigtwin.description.machine import Machine
from rigtwin.numerics.arrays import Array
from rigtwin.signals.band import limit_band

UNCERTAIN_ENDS = 0.3
"""Time at both ends of a record in which the filtered motion is uncertain, s."""
Optimizer = Literal["mujoco", "scipy"]
"""Optimisers of the toolbox; the first is its default."""
Residual = Callable[..., tuple[list[Array], Any, Any]]
"""Residual as `mujoco.sysid.optimize` calls it: of a vector or of columns, and of parameters."""


@dataclass(frozen=True)
class ToolboxParameter:
    """Parameter that the toolbox fits.

    Attributes
    ----------
    effect : str
        Name of the same effect in rigtwin, such as `coulomb@elbow`.
    nominal, low, high : float
        Start and bounds, in SI.
    modify : callable
        Function that writes the value into an `MjSpec`. None for a parameter of a sensor.
    """

    effect: str
    nominal: float
    low: float
    high: float
    modify: Callable[[mujoco.MjSpec, float], object] | None


def find_missing() -> str:
    """Return the name of the package that the toolbox lacks, or an empty string."""
    try:
        import mujoco.sysid._src.parameter
        import mujoco.sysid._src.residual  # noqa: F401
        from mujoco import sysid
    except ModuleNotFoundError as error:
        return str(error.name)
    # The toolbox's own __init__ hides what it failed to import.
    return "" if hasattr(sysid, "optimize") else "plotly"


def set_joint(joint: str, attribute: str) -> Callable[[mujoco.MjSpec, float], object]:
    """Return a modifier that sets an attribute of a joint, such as `damping`."""

    def modify(spec: mujoco.MjSpec, value: float) -> None:
        element = spec.joint(joint)
        # Damping and stiffness are polynomials of three coefficients.
        present = np.atleast_1d(getattr(element, attribute)).astype(float)
        present[0] = value
        setattr(element, attribute, present if len(present) > 1 else float(value))

    return modify


def set_mass(body: str) -> Callable[[mujoco.MjSpec, float], object]:
    """Return a modifier that sets the mass of a body, whose inertia scales as in rigtwin."""

    def modify(spec: mujoco.MjSpec, value: float) -> None:
        element = spec.body(body)
        element.inertia = np.asarray(element.inertia) * value / element.mass
        element.mass = value

    return modify


def set_constant_force(joint: str) -> Callable[[mujoco.MjSpec, float], object]:
    """Return a modifier that lets a constant force resist a joint's positive direction."""
    soft = 1e-3

    def modify(spec: mujoco.MjSpec, value: float) -> None:
        # MJCF has no constant joint force: a very soft spring, deflected far, gives one.
        set_joint(joint, "stiffness")(spec, soft)
        spec.joint(joint).springref = -value / soft

    return modify


def harden_friction(spec: mujoco.MjSpec) -> None:
    """Let dry friction act at once.

    MuJoCo's friction loss follows v + T·a, with T = 9 ms by default, so that by inverse dynamics it
    reverses too early or too late. A short time constant removes that.
    """
    spec.option.timestep = 1e-5
    for element in (*spec.joints, *spec.tendons):
        element.solref_friction = np.array([2e-5, 1.0])


def list_parameters(parameters: Sequence[ToolboxParameter]) -> Any:
    """Return the toolbox's own dictionary of parameters, away from their bounds as it advises."""
    from mujoco import sysid

    result = sysid.ParameterDict()
    for parameter in parameters:
        result.add(
            sysid.Parameter(
                parameter.effect,
                parameter.nominal,
                parameter.low,
                parameter.high,
                modifier=None
                if parameter.modify is None
                else (lambda spec, p, set_to=parameter.modify: set_to(spec, float(p.value[0]))),
            )
        )
    # "Optimization can stall in that corner; consider calling move_off_bounds()."
    return result.move_off_bounds(fraction=0.01)


def fit_toolbox(
    parameters: Sequence[ToolboxParameter], residual: Residual, optimizer: Optimizer = "mujoco"
) -> dict[str, float]:
    """Fit parameters with one of the toolbox's optimisers, and return their values by effect."""
    from mujoco import sysid

    start = list_parameters(parameters)
    # Its optimiser prints each iteration whatever `verbose` says, and divides by a step's predicted
    # gain, which may be 0 at the optimum.
    with contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore"):
        fitted, _ = sysid.optimize(start, residual, optimizer, verbose=False)
    return {p.effect: float(fitted[p.effect].value[0]) for p in parameters}


def residual_error(
    parameters: Sequence[ToolboxParameter], residual: Residual, values: Mapping[str, float]
) -> float:
    """Return the rms of predicted less measured signals, as a share of the signals' swing."""
    dictionary = list_parameters(parameters)
    vector = np.array([values[p.effect] for p in parameters])
    parts, predicted, measured = residual(vector, dictionary)
    if not predicted:
        return float(np.sqrt(np.mean(np.concatenate([np.ravel(part) for part in parts]) ** 2)))
    # The toolbox's own residual is normalised otherwise; its signals are given beside it.
    shares = [
        (p.data - m.data) / np.std(m.data, axis=0)
        for first, second in zip(predicted, measured, strict=True)
        for p, m in zip(first, second, strict=True)
    ]
    return float(np.sqrt(np.mean(np.concatenate([np.ravel(share) for share in shares]) ** 2)))


@dataclass(frozen=True)
class RolloutTest:
    """One record for a rollout.

    Attributes
    ----------
    time : ndarray
        Times of the commands, s, shape (ticks,).
    commands : ndarray
        Values of the model's actuators, shape (ticks, actuators).
    measured_time : ndarray
        Times of the measured signals, s, shape (ticks,).
    measured : ndarray
        Measured signals, shape (ticks, signals).
    signals : tuple of str
        Sensor or state of each signal as the toolbox names it, such as `elbow_qpos`.
    position, velocity : ndarray
        State at the first tick, shape (joints,).
    """

    time: Array
    commands: Array
    measured_time: Array
    measured: Array
    signals: tuple[str, ...]
    position: Array
    velocity: Array


def pose_rollout(spec: mujoco.MjSpec, tests: Sequence[RolloutTest]) -> Residual:
    """Return the toolbox's own residual of records that MuJoCo integrates."""
    from mujoco import sysid

    model = spec.compile()
    sequences = [
        sysid.ModelSequences(
            model.names.split(b"\0", 1)[0].decode() or "machine",
            spec,
            f"test {number}",
            sysid.create_initial_state(model, test.position, test.velocity),
            sysid.TimeSeries(test.time, test.commands),
            sysid.TimeSeries.from_names(
                test.measured_time, test.measured, model, list(test.signals)
            ),
            allow_missing_sensors=True,
        )
        for number, test in enumerate(tests)
    ]
    return sysid.build_residual_fn(models_sequences=sequences)


@dataclass(frozen=True)
class InverseTest:
    """One record of joints that move as measured, filtered without delay.

    Attributes
    ----------
    motion : ndarray
        Positions, velocities and accelerations, shape (3, joints, ticks).
    force : ndarray
        Measured forces, N or Nm, shape (joints, ticks).
    period : float
        Time from tick to tick, s.
    band : float
        Band of the zero-phase filter, Hz.
    """

    motion: Array
    force: Array
    period: float
    band: float

    @property
    def compared(self) -> slice:
        """Ticks that are compared: without the uncertain ends."""
        ends = round(UNCERTAIN_ENDS / self.period)
        return slice(ends, self.motion.shape[2] - ends)


def measure_inverse(positions: Array, forces: Array, period: float, band: float) -> InverseTest:
    """Filter and differentiate measured positions, shape (joints, ticks), as is usual for robots.

    A fourth-order Butterworth filter forwards and backwards, then central differences [Gautier,
    Khalil, IEEE Trans. Robot. Autom. 8 (1992) 368].
    """
    position = limit_band(positions, band, period)
    velocity = np.gradient(position, period, axis=1)
    acceleration = np.gradient(velocity, period, axis=1)
    motion = np.stack([position, velocity, acceleration])
    return InverseTest(motion, limit_band(forces, band, period), period, band)


def invert(model: mujoco.MjModel, motion: Array) -> Array:
    """Return the joints' forces by `mj_inverse`, N or Nm, shape (joints, ticks)."""
    data = mujoco.MjData(model)
    position, velocity, acceleration = np.ascontiguousarray(motion.transpose(0, 2, 1))
    forces = np.empty_like(position)
    for tick in range(len(position)):
        data.qpos = position[tick]
        data.qvel = velocity[tick]
        data.qacc = acceleration[tick]
        mujoco.mj_inverse(model, data)
        forces[tick] = data.qfrc_inverse
    return forces.T


@dataclass(frozen=True)
class InverseProblem:
    """Residual of records of joints that move as measured.

    Attributes
    ----------
    spec : MjSpec
        Model.
    tests : tuple of InverseTest
        Records.
    sense : callable
        Function of the predicted forces and the parameters' values that returns what the sensors
        show.
    displace : callable
        Function of the motion and the parameters' values that returns the true motion.
    added : tuple of ndarray
        Force that the nominal machine has and an MJCF cannot say, for each record.
    """

    spec: mujoco.MjSpec
    tests: tuple[InverseTest, ...]
    sense: Callable[[Array, Mapping[str, float]], Array] = field(default=lambda force, _: force)
    displace: Callable[[Array, Mapping[str, float]], Array] = field(
        default=lambda motion, _: motion
    )
    added: tuple[Array, ...] = ()

    def predict(self, parameters: Any, number: int) -> Array:
        """Return predicted forces of a record at the compared ticks, shape (joints, ticks)."""
        from mujoco import sysid

        values = {name: float(parameters[name].value[0]) for name in parameters.keys()}  # noqa: SIM118
        test = self.tests[number]
        model = sysid.apply_param_modifiers(parameters, self.spec)
        force = invert(model, self.displace(test.motion, values))
        if self.added:
            force = force + self.added[number]
        force = limit_band(force, test.band, test.period)
        return self.sense(force, values)[:, test.compared]

    def measured(self, number: int) -> Array:
        """Return measured forces of a record at the compared ticks, shape (joints, ticks)."""
        test = self.tests[number]
        return test.force[:, test.compared]

    def __call__(
        self, x: Array, parameters: Any, **_: object
    ) -> tuple[list[Array], list[Array], list[Array]]:
        """Return the residual, normalised by the signals' standard deviations."""
        columns = np.atleast_2d(x.T).T if x.ndim > 1 else x[:, None]
        residuals: list[list[Array]] = []
        for number in range(columns.shape[1]):
            parameters.update_from_vector(columns[:, number])
            column = []
            for test in range(len(self.tests)):
                measured = self.measured(test)
                scale = np.std(measured, axis=1, keepdims=True)
                column.append(((self.predict(parameters, test) - measured) / scale).ravel())
            residuals.append(column)
        stacked = [
            np.stack(parts, axis=1) if x.ndim > 1 else parts[0]
            for parts in zip(*residuals, strict=True)
        ]
        return stacked, [], []


def list_stribeck(machine: Machine, motion: Array) -> Array:
    """Return the force of the guides' nominal Stribeck peaks, which an MJCF cannot say.

    The peak is s·exp(−|v/v_s|^n)·sign(v); shape of the result: (joints, ticks), in the order of the
    measured motions.
    """
    movers = [machine.components[name].joint for name in machine.replays[0].moved_by]
    forces = np.zeros(motion.shape[1:])
    for name, component in machine.components.items():
        guide = getattr(machine.plant, name)
        if not isinstance(guide, Guide) or guide.stribeck == 0.0:
            continue
        along = np.zeros(len(movers))
        for joint, coefficient in component.acts_on:
            along[movers.index(joint)] = coefficient
        speed = along @ motion[1]
        peak = np.exp(-(np.abs(speed / guide.stribeck_velocity) ** guide.stribeck_exponent))
        forces += along[:, None] * (guide.stribeck * peak * np.sign(speed))
    return forces
