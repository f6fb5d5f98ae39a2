"""Random tolerances, noise and defects of the referee's rig."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from referee.defect import (
    SENSORS,
    Change,
    Defect,
    DefectMaker,
    Random,
    either_sign,
    log_uniform,
    replace_fields,
    single_defect,
)
from referee.reference_rig import Law
from referee.reference_truth import CELL, LVDT, Array, Truth


def friction(component: str, random: Random) -> list[DefectMaker]:
    """Return functions that draw the friction defects of `rail` or `motor`."""
    # The motor has less friction and less force than the rail: its defects are scaled down.
    nominal, scale = (50.0, 1.0) if component == "rail" else (14.0, 0.3)

    def coulomb() -> float:
        if random.random() < 0.7:
            return nominal * (1.0 + log_uniform(random, 0.15, 1.5))
        return nominal * (1.0 - log_uniform(random, 0.2, 0.7))

    def stribeck() -> Defect:
        value, speed = scale * log_uniform(random, 10.0, 60.0), log_uniform(random, 0.004, 0.05)
        # Both common forms of the Stribeck curve: exponential and Gaussian.
        shape = float(random.choice([1.0, 2.0]))
        change = replace_fields(component, peak=value, peak_speed=speed, peak_shape=shape)
        return Defect("stribeck", component, value, 0.0, True, change)

    def single(kind: str, name: str, draw: Callable[[], float], at: float = 0.0) -> DefectMaker:
        return single_defect(kind, component, at, component, name, draw)

    return [
        single("coulomb", "coulomb", coulomb, nominal),
        single("viscous", "viscous", lambda: scale * log_uniform(random, 30.0, 500.0)),
        stribeck,
        single("asymmetry", "asymmetry", lambda: scale * either_sign(random, 8.0, 50.0)),
        single("backlash", "play", lambda: log_uniform(random, 3e-4, 5e-3)),
    ]


def _actuator(
    component: str, path: str, largest: float, fastest: float, random: Random
) -> list[DefectMaker]:
    """Return functions that draw the defects of an actuator.

    largest, fastest: largest command and command rate of the test without defects, in the
    command's unit. Limits are drawn below them: a limit that never acts would be invisible.
    """
    motor, hydraulic = component == "motor", f"{path}_hydraulic"

    def single(
        kind: str, name: str, draw: Callable[[], float], nominal: float = 0.0, part: str = path
    ) -> DefectMaker:
        return single_defect(kind, component, nominal, part, name, draw)

    band = (0.03, 0.3) if motor else (3e-4, 3e-3)
    defects = [
        single("gain", "gain", lambda: 1.0 + either_sign(random, 0.02, 0.15), 1.0),
        single("lag", "lag", lambda: log_uniform(random, 1e-3, 1.2e-2)),
        single("delay", "delay", lambda: log_uniform(random, 1e-3, 1.2e-2)),
        single("saturation", "limit", lambda: largest * random.uniform(0.5, 0.85), np.inf),
        single("deadband", "dead_zone", lambda: log_uniform(random, *band)),
    ]
    if motor:
        rate = single("rate_limit", "rate", lambda: fastest * random.uniform(0.05, 0.5), np.inf)
        return [*defects, rate, lambda: _cogging(component, random)]
    return [
        *defects,
        single(
            "rate_limit",
            "speed",
            lambda: min(fastest, 0.3) * random.uniform(0.2, 0.7),
            0.3,
            hydraulic,
        ),
        lambda: _compliance(component, hydraulic, random),
        single("backlash", "play", lambda: log_uniform(random, 6e-4, 6e-3), 0.0, hydraulic),
    ]


def _cogging(component: str, random: Random) -> Defect:
    value = log_uniform(random, 2.0, 15.0)
    change = replace_fields(
        "",
        ripple=value,
        ripple_pitch=log_uniform(random, 0.012, 0.05),
        ripple_phase=random.uniform(-3.0, 3.0),
    )
    return Defect("cogging", component, value, 0.0, True, change)


def _compliance(component: str, hydraulic: str, random: Random) -> Defect:
    value = log_uniform(random, 2e-7, 3e-6)
    immediate = random.random() < 0.5
    yielding = replace_fields(hydraulic, compliance=value)

    def change(truth: Truth, law: Law) -> tuple[Truth, Law]:
        # A stiff bristle between the carriage and a compliant plate would need much smaller steps,
        # so this rig has set-valued friction.
        load_lag = 0.0 if immediate else truth.load_lag
        return yielding(truth._replace(bristle=0.0, load_lag=load_lag), law)

    return Defect("compliance", component, value, 0.0, True, change)


def _sensor(component: str, random: Random) -> list[DefectMaker]:
    """Return functions that draw the defects of a sensor."""
    cell = component == "load_cell"
    nominal = CELL if cell else LVDT

    def single(kind: str, name: str, draw: Callable[[], float], at: float = 0.0) -> DefectMaker:
        return single_defect(kind, component, at, component, name, draw)

    offset, drift = ((2.0, 20.0), (0.3, 3.0)) if cell else ((2e-4, 3e-3), (3e-5, 3e-4))
    white, bit = nominal.white, nominal.bit
    return [
        single("gain", "gain", lambda: 1.0 + either_sign(random, 0.015, 0.1), 1.0),
        single("offset", "offset", lambda: either_sign(random, *offset)),
        single("drift", "drift", lambda: either_sign(random, *drift)),
        single("lag", "lag", lambda: log_uniform(random, 1e-3, 1e-2)),
        single("delay", "delay", lambda: log_uniform(random, 1e-3, 1e-2)),
        single(
            "hum", "mains", lambda: nominal.mains * log_uniform(random, 4.0, 10.0), nominal.mains
        ),
        single("noise", "white", lambda: white * log_uniform(random, 4.0, 10.0), white),
        single("quantisation", "bit", lambda: bit * log_uniform(random, 60.0, 400.0), bit),
    ]


def _rest(random: Random) -> list[DefectMaker]:
    """Return functions that draw the defects of carriage, tyre and controller."""

    def single(
        kind: str, component: str, nominal: float, name: str, draw: Callable[[], float]
    ) -> DefectMaker:
        return single_defect(kind, component, nominal, "", name, draw)

    def mass() -> float:
        return 34.0 * (1.0 + either_sign(random, 0.02, 0.25))

    def stiffness() -> float:
        return 50_000.0 * (1.0 + either_sign(random, 0.04, 0.25))

    def setting() -> Defect:
        # The recording stores the intended setting; the controller runs with another one.
        name = str(random.choice(["kp", "ki", "kff", "filter_force"]))
        nominal = Law()._asdict()[name]
        value = nominal * (1.0 + either_sign(random, 0.1, 0.5))
        change = lambda truth, law: (truth, law._replace(**{name: value}))  # noqa: E731
        return Defect(f"setting:{name}", "controller", value, nominal, True, change)

    computer, late = "controller", "computation_delay"
    return [
        single("mass", "carriage", 34.0, "mass", mass),
        single("stiffness", "tyre", 50_000.0, "tyre", stiffness),
        single("damping", "tyre", 0.0, "tyre_damping", lambda: log_uniform(random, 40.0, 1000.0)),
        single("hardening", "tyre", 0.0, "tyre_hardening", lambda: log_uniform(random, 6.0, 80.0)),
        single("delay", computer, 0.0, late, lambda: log_uniform(random, 1e-3, 8e-3)),
        single("missed_ticks", computer, 0.0, "missed", lambda: log_uniform(random, 0.01, 0.1)),
        setting,
    ]


def draw_unnamed(random: Random) -> list[DefectMaker]:
    """Return functions that draw defects without a name in the reports."""
    any_lvdt = str(random.choice(SENSORS[:3]))
    any_cylinder = str(random.choice(["ground", "structure"]))

    def unnamed(kind: str, component: str, value: float, change: Change) -> DefectMaker:
        return lambda: Defect(kind, component, value, 0.0, False, change)

    relaxing = log_uniform(random, 0.15, 0.6)
    wave = log_uniform(random, 0.25, 0.8)
    fading = either_sign(random, 0.15, 0.5)
    drag, curvature = log_uniform(random, 150.0, 1500.0), either_sign(random, 0.03, 0.15)
    slowdown = log_uniform(random, 0.04, 0.2)
    creep = either_sign(random, 3e-5, 2e-4)
    crosstalk = either_sign(random, 1.0, 6.0)
    return [
        unnamed(
            "viscoelastic",
            "tyre",
            relaxing,
            replace_fields("", relaxing=relaxing, relaxing_time=log_uniform(random, 0.02, 0.3)),
        ),
        unnamed(
            "uneven way",
            "rail",
            wave,
            replace_fields("rail", wave=wave, wave_length=log_uniform(random, 0.006, 0.03)),
        ),
        unnamed("heating", "motor", fading, replace_fields("voltage", fading=3.0 * fading)),
        unnamed("quadratic drag", "rail", drag, replace_fields("rail", drag=drag)),
        unnamed("bend", any_lvdt, curvature, replace_fields(any_lvdt, curvature=curvature)),
        unnamed(
            "slow valve",
            f"{any_cylinder}_cylinder",
            slowdown,
            replace_fields(f"{any_cylinder}_hydraulic", slowdown=slowdown),
        ),
        unnamed(
            "creep",
            f"{any_cylinder}_cylinder",
            creep,
            replace_fields(f"{any_cylinder}_hydraulic", creep=creep),
        ),
        unnamed(
            "crosstalk", "load_cell", crosstalk, replace_fields("load_cell", crosstalk=crosstalk)
        ),
    ]


def named_defects(commands: Array, random: Random) -> list[list[DefectMaker]]:
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
        load_lag=log_uniform(random, 2e-3, 1e-2),
        bristle=log_uniform(random, 1e8, 1e9) if random.random() < 0.3 else 0.0,
    )
    noise_factor, hum_factor = log_uniform(random, 0.5, 3.0), random.uniform(0.0, 2.0)
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
