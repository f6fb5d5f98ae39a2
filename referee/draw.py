"""Random tolerances, noise and defects of the referee's rig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from referee.reference_plant import CELL, LVDT, Array, Truth
from referee.reference_rig import Law, run_quiet

Random = np.random.Generator
Change = Callable[[Truth, Law], tuple[Truth, Law]]
"""Function that adds a defect to a rig and its controller."""
SENSORS = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
MATERIAL = 1.0
"""Smallest material defect: rms change of some sensor, in units of its white noise."""


@dataclass(frozen=True)
class Defect:
    """A defect.

    Attributes
    ----------
    kind, component : str
        Name in the vocabulary of the reports, or one outside it.
    value, nominal : float
        Defective and nominal value of the first parameter, as a report would give them.
    inside : bool
        Whether the reports know this kind.
    change : callable
        Function that adds the defect to a rig and to the controller's true settings.
    """

    kind: str
    component: str
    value: float
    nominal: float
    inside: bool
    change: Change = field(repr=False)


def _replace_fields(path: str, **values: float) -> Change:
    """Return a change of fields of the rig, or of its part `path`."""

    def change(truth: Truth, law: Law) -> tuple[Truth, Law]:
        if not path:
            return truth._replace(**values), law
        return truth._replace(**{path: getattr(truth, path)._replace(**values)}), law

    return change


def _log_uniform(random: Random, low: float, high: float) -> float:
    """Draw a number between two bounds, uniform in its logarithm."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _either_sign(random: Random, low: float, high: float) -> float:
    """Draw a magnitude as `_log_uniform`, with a random sign."""
    return _log_uniform(random, low, high) * float(random.choice([-1.0, 1.0]))


def friction(component: str, random: Random) -> list[Callable[[], Defect]]:
    """Return functions that draw the friction defects of `rail` or `motor`."""
    # The motor has less friction and less force than the rail: its defects are scaled down.
    nominal, scale = (50.0, 1.0) if component == "rail" else (14.0, 0.3)

    def coulomb() -> Defect:
        value = nominal * (
            1.0
            + (
                _log_uniform(random, 0.15, 1.5)
                if random.random() < 0.7
                else -_log_uniform(random, 0.2, 0.7)
            )
        )
        return Defect(
            "coulomb", component, value, nominal, True, _replace_fields(component, coulomb=value)
        )

    def viscous() -> Defect:
        value = scale * _log_uniform(random, 30.0, 500.0)
        return Defect(
            "viscous", component, value, 0.0, True, _replace_fields(component, viscous=value)
        )

    def stribeck() -> Defect:
        value, speed = scale * _log_uniform(random, 10.0, 60.0), _log_uniform(random, 0.004, 0.05)
        # Both common forms of the Stribeck curve: exponential and Gaussian.
        shape = float(random.choice([1.0, 2.0]))
        change = _replace_fields(component, peak=value, peak_speed=speed, peak_shape=shape)
        return Defect("stribeck", component, value, 0.0, True, change)

    def asymmetry() -> Defect:
        value = scale * _either_sign(random, 8.0, 50.0)
        return Defect(
            "asymmetry", component, value, 0.0, True, _replace_fields(component, asymmetry=value)
        )

    def backlash() -> Defect:
        value = _log_uniform(random, 3e-4, 5e-3)
        return Defect(
            "backlash", component, value, 0.0, True, _replace_fields(component, play=value)
        )

    return [coulomb, viscous, stribeck, asymmetry, backlash]


def _actuator(
    component: str, path: str, largest: float, fastest: float, random: Random
) -> list[Callable[[], Defect]]:
    """Return functions that draw the defects of an actuator.

    largest, fastest: largest command and command rate of the test without defects, in the
    command's unit. Limits are drawn below them, so they act.
    """
    motor = component == "motor"

    def gain() -> Defect:
        value = 1.0 + _either_sign(random, 0.02, 0.15)
        return Defect("gain", component, value, 1.0, True, _replace_fields(path, gain=value))

    def lag() -> Defect:
        value = _log_uniform(random, 1e-3, 1.2e-2)
        return Defect("lag", component, value, 0.0, True, _replace_fields(path, lag=value))

    def delay() -> Defect:
        value = _log_uniform(random, 1e-3, 1.2e-2)
        return Defect("delay", component, value, 0.0, True, _replace_fields(path, delay=value))

    def saturation() -> Defect:
        # A limit above the largest command would be invisible.
        value = largest * random.uniform(0.5, 0.85)
        return Defect(
            "saturation", component, value, np.inf, True, _replace_fields(path, limit=value)
        )

    def deadband() -> Defect:
        value = _log_uniform(random, 0.03, 0.3) if motor else _log_uniform(random, 3e-4, 3e-3)
        return Defect(
            "deadband", component, value, 0.0, True, _replace_fields(path, dead_zone=value)
        )

    def rate_limit() -> Defect:
        if motor:
            value = fastest * random.uniform(0.05, 0.5)
            return Defect(
                "rate_limit", component, value, np.inf, True, _replace_fields(path, rate=value)
            )
        value = min(fastest, 0.3) * random.uniform(0.2, 0.7)
        return Defect(
            "rate_limit",
            component,
            value,
            0.3,
            True,
            _replace_fields(f"{path}_hydraulic", speed=value),
        )

    def compliance() -> Defect:
        value = _log_uniform(random, 2e-7, 3e-6)
        immediate = random.random() < 0.5
        hydraulic = _replace_fields(f"{path}_hydraulic", compliance=value)

        def change(truth: Truth, law: Law) -> tuple[Truth, Law]:
            # A stiff bristle between the carriage and a compliant plate would need much smaller
            # steps, so this rig has set-valued friction.
            load_lag = 0.0 if immediate else truth.load_lag
            return hydraulic(truth._replace(bristle=0.0, load_lag=load_lag), law)

        return Defect("compliance", component, value, 0.0, True, change)

    def play() -> Defect:
        value = _log_uniform(random, 6e-4, 6e-3)
        return Defect(
            "backlash",
            component,
            value,
            0.0,
            True,
            _replace_fields(f"{path}_hydraulic", play=value),
        )

    def cogging() -> Defect:
        value = _log_uniform(random, 2.0, 15.0)
        change = _replace_fields(
            "",
            ripple=value,
            ripple_pitch=_log_uniform(random, 0.012, 0.05),
            ripple_phase=random.uniform(-3.0, 3.0),
        )
        return Defect("cogging", component, value, 0.0, True, change)

    specific = [cogging] if motor else [compliance, play]
    return [gain, lag, delay, saturation, deadband, rate_limit, *specific]


def _sensor(component: str, random: Random) -> list[Callable[[], Defect]]:
    """Return functions that draw the defects of a sensor."""
    cell = component == "load_cell"
    nominal = CELL if cell else LVDT

    def gain() -> Defect:
        value = 1.0 + _either_sign(random, 0.015, 0.1)
        return Defect("gain", component, value, 1.0, True, _replace_fields(component, gain=value))

    def offset() -> Defect:
        value = _either_sign(random, 2.0, 20.0) if cell else _either_sign(random, 2e-4, 3e-3)
        return Defect(
            "offset", component, value, 0.0, True, _replace_fields(component, offset=value)
        )

    def drift() -> Defect:
        value = _either_sign(random, 0.3, 3.0) if cell else _either_sign(random, 3e-5, 3e-4)
        return Defect("drift", component, value, 0.0, True, _replace_fields(component, drift=value))

    def lag() -> Defect:
        value = _log_uniform(random, 1e-3, 1e-2)
        return Defect("lag", component, value, 0.0, True, _replace_fields(component, lag=value))

    def delay() -> Defect:
        value = _log_uniform(random, 1e-3, 1e-2)
        return Defect("delay", component, value, 0.0, True, _replace_fields(component, delay=value))

    def hum() -> Defect:
        value = nominal.mains * _log_uniform(random, 4.0, 10.0)
        return Defect(
            "hum", component, value, nominal.mains, True, _replace_fields(component, mains=value)
        )

    def noise() -> Defect:
        value = nominal.white * _log_uniform(random, 4.0, 10.0)
        return Defect(
            "noise", component, value, nominal.white, True, _replace_fields(component, white=value)
        )

    def quantisation() -> Defect:
        value = nominal.bit * _log_uniform(random, 60.0, 400.0)
        return Defect(
            "quantisation",
            component,
            value,
            nominal.bit,
            True,
            _replace_fields(component, bit=value),
        )

    return [gain, offset, drift, lag, delay, hum, noise, quantisation]


def _rest(random: Random) -> list[Callable[[], Defect]]:
    """Return functions that draw the defects of carriage, tyre and controller."""

    def mass() -> Defect:
        value = 34.0 * (1.0 + _either_sign(random, 0.02, 0.25))
        return Defect("mass", "carriage", value, 34.0, True, _replace_fields("", mass=value))

    def stiffness() -> Defect:
        value = 50_000.0 * (1.0 + _either_sign(random, 0.04, 0.25))
        return Defect("stiffness", "tyre", value, 50_000.0, True, _replace_fields("", tyre=value))

    def damping() -> Defect:
        value = _log_uniform(random, 40.0, 1000.0)
        return Defect("damping", "tyre", value, 0.0, True, _replace_fields("", tyre_damping=value))

    def hardening() -> Defect:
        value = _log_uniform(random, 6.0, 80.0)
        return Defect(
            "hardening", "tyre", value, 0.0, True, _replace_fields("", tyre_hardening=value)
        )

    def late() -> Defect:
        value = _log_uniform(random, 1e-3, 8e-3)
        return Defect(
            "delay", "controller", value, 0.0, True, _replace_fields("", computation_delay=value)
        )

    def missed() -> Defect:
        value = _log_uniform(random, 0.01, 0.1)
        return Defect(
            "missed_ticks", "controller", value, 0.0, True, _replace_fields("", missed=value)
        )

    def setting() -> Defect:
        # The recording stores the intended setting; the controller runs with another one.
        name = str(random.choice(["kp", "ki", "kff", "filter_force"]))
        nominal = getattr(Law(), name)
        value = nominal * (1.0 + _either_sign(random, 0.1, 0.5))
        change = lambda truth, law: (truth, law._replace(**{name: value}))  # noqa: E731
        return Defect(f"setting:{name}", "controller", value, nominal, True, change)

    return [mass, stiffness, damping, hardening, late, missed, setting]


def draw_unnamed(random: Random) -> list[Callable[[], Defect]]:
    """Return functions that draw defects without a name in the reports."""
    any_lvdt = str(random.choice(SENSORS[:3]))
    any_cylinder = str(random.choice(["ground", "structure"]))

    def unnamed(kind: str, component: str, value: float, change: Change) -> Callable[[], Defect]:
        return lambda: Defect(kind, component, value, 0.0, False, change)

    relaxing, wave, fading = (
        _log_uniform(random, 0.15, 0.6),
        _log_uniform(random, 0.25, 0.8),
        _either_sign(random, 0.15, 0.5),
    )
    drag, curvature = _log_uniform(random, 150.0, 1500.0), _either_sign(random, 0.03, 0.15)
    slowdown, creep, crosstalk = (
        _log_uniform(random, 0.04, 0.2),
        _either_sign(random, 3e-5, 2e-4),
        _either_sign(random, 1.0, 6.0),
    )
    return [
        unnamed(
            "viscoelastic",
            "tyre",
            relaxing,
            _replace_fields("", relaxing=relaxing, relaxing_time=_log_uniform(random, 0.02, 0.3)),
        ),
        unnamed(
            "uneven way",
            "rail",
            wave,
            _replace_fields("rail", wave=wave, wave_length=_log_uniform(random, 0.006, 0.03)),
        ),
        unnamed("heating", "motor", fading, _replace_fields("voltage", fading=3.0 * fading)),
        unnamed("quadratic drag", "rail", drag, _replace_fields("rail", drag=drag)),
        unnamed("bend", any_lvdt, curvature, _replace_fields(any_lvdt, curvature=curvature)),
        unnamed(
            "slow valve",
            f"{any_cylinder}_cylinder",
            slowdown,
            _replace_fields(f"{any_cylinder}_hydraulic", slowdown=slowdown),
        ),
        unnamed(
            "creep",
            f"{any_cylinder}_cylinder",
            creep,
            _replace_fields(f"{any_cylinder}_hydraulic", creep=creep),
        ),
        unnamed(
            "crosstalk", "load_cell", crosstalk, _replace_fields("load_cell", crosstalk=crosstalk)
        ),
    ]


def named_defects(commands: Array, random: Random) -> list[list[Callable[[], Defect]]]:
    """Return functions that draw every named defect, grouped by component.

    commands: of the test without defects, shape (ticks, 4).
    """

    def command_range(column: int) -> tuple[float, float]:
        # The 99.9 % quantile of the rate: single steps must not set the limit.
        rates = np.abs(np.diff(commands[:, column])) / 1e-3
        return float(np.max(np.abs(commands[:, column]))), float(np.quantile(rates, 0.999))

    carriage_and_tyre, controller = _rest(random)[:4], _rest(random)[4:]
    return [
        friction("rail", random),
        friction("motor", random) + _actuator("motor", "voltage", *command_range(3), random),
        carriage_and_tyre,
        _actuator("ground_cylinder", "ground", *command_range(0), random),
        _actuator("structure_cylinder", "structure", *command_range(1), random),
        *(_sensor(name, random) for name in SENSORS),
        controller,
    ]


def draw_tolerated(random: Random) -> Truth:
    """Draw a rig within its tolerances.

    The noise varies from laboratory to laboratory. Friction is set-valued or a stiff bristle.
    """

    def vary(value: float, share: float) -> float:
        return value * (1.0 + random.uniform(-share, share))

    truth = Truth(
        mass=vary(34.0, 0.005),
        tyre=vary(50_000.0, 0.01),
        motor_constant=vary(186.0, 0.005),
        load_lag=_log_uniform(random, 2e-3, 1e-2),
        bristle=_log_uniform(random, 1e8, 1e9) if random.random() < 0.3 else 0.0,
    )
    noise_factor, hum_factor = _log_uniform(random, 0.5, 3.0), random.uniform(0.0, 2.0)
    for name in SENSORS:
        nominal = CELL if name == "load_cell" else LVDT
        offset_limit = 0.5 if name == "load_cell" else 5e-5
        sensor = nominal._replace(
            gain=vary(1.0, 0.002),
            offset=random.uniform(-offset_limit, offset_limit),
            white=vary(nominal.white * noise_factor, 0.2),
            mains=vary(nominal.mains * hum_factor, 0.2),
            delay=random.uniform(0.0, 1e-4),
        )
        truth = truth._replace(**{name: sensor})
    return truth._replace(
        rail=truth.rail._replace(coulomb=vary(50.0, 0.03)),
        motor=truth.motor._replace(coulomb=vary(14.0, 0.03)),
        voltage=truth.voltage._replace(delay=random.uniform(0.0, 1e-4)),
        ground=truth.ground._replace(delay=random.uniform(0.0, 1e-4)),
        structure=truth.structure._replace(delay=random.uniform(0.0, 1e-4)),
    )


def effect_size(rig: Truth, law: Law, defect: Defect, commands: Array) -> float:
    """Return the size of a defect: the largest rms change of a sensor, in units of its white noise.

    Both rigs run under the same commands. Defects without a signal of their own, such as noise,
    count as infinitely large.
    """
    if defect.kind in ("hum", "noise", "quantisation", "missed_ticks") or defect.kind.startswith(
        "setting"
    ):
        return float("inf")
    defective, true_law = defect.change(rig, law)
    change = run_quiet(defective, true_law, commands) - run_quiet(rig, law, commands)
    noise = np.array([getattr(rig, name).white for name in SENSORS])
    return float(np.max(np.sqrt(np.mean(change**2, axis=0)) / noise))


def summary(defect: Defect, size: float) -> dict[str, Any]:
    """Return the entry of a defect in the key."""
    return {
        "kind": defect.kind,
        "component": defect.component,
        "value": defect.value,
        "nominal": defect.nominal if np.isfinite(defect.nominal) else None,
        "inside": defect.inside,
        "size": size if np.isfinite(size) else None,
        "material": bool(size >= MATERIAL),
    }
