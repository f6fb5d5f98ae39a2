"""What the referee does to its rig: draws tolerances, noise, and defects with their sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from referee.reference_plant import CELL, LVDT, Array, Truth
from referee.reference_rig import Law, run_quiet

Random = np.random.Generator
Change = Callable[[Truth, Law], tuple[Truth, Law]]
SENSORS = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
MATERIAL = 1.0
"""A defect that changes some sensor by less than this many times its white noise, rms, is a
trace."""


@dataclass(frozen=True)
class Defect:
    """One defect. kind, component: its name in the vocabulary of reports, or outside it; value: of
    the first parameter, as a report would give it; nominal: that parameter's; inside: whether
    reports know this kind; change: of the rig and of the controller's real settings."""

    kind: str
    component: str
    value: float
    nominal: float
    inside: bool
    change: Change = field(repr=False)


def _to(path: str, **values: float) -> Change:
    """A change of numbers of the rig, or of one of its parts."""

    def change(truth: Truth, law: Law) -> tuple[Truth, Law]:
        if not path:
            return truth._replace(**values), law
        return truth._replace(**{path: getattr(truth, path)._replace(**values)}), law

    return change


def _log(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _either(random: Random, low: float, high: float) -> float:
    return _log(random, low, high) * float(random.choice([-1.0, 1.0]))


def friction(component: str, random: Random) -> list[Callable[[], Defect]]:
    base, big = (50.0, 1.0) if component == "rail" else (14.0, 0.3)

    def coulomb() -> Defect:
        value = base * (
            1.0 + (_log(random, 0.15, 1.5) if random.random() < 0.7 else -_log(random, 0.2, 0.7))
        )
        return Defect("coulomb", component, value, base, True, _to(component, coulomb=value))

    def viscous() -> Defect:
        value = big * _log(random, 30.0, 500.0)
        return Defect("viscous", component, value, 0.0, True, _to(component, viscous=value))

    def stribeck() -> Defect:
        value, speed = big * _log(random, 10.0, 60.0), _log(random, 0.004, 0.05)
        shape = float(random.choice([1.0, 2.0]))
        change = _to(component, peak=value, peak_speed=speed, peak_shape=shape)
        return Defect("stribeck", component, value, 0.0, True, change)

    def asymmetry() -> Defect:
        value = big * _either(random, 8.0, 50.0)
        return Defect("asymmetry", component, value, 0.0, True, _to(component, uneven=value))

    def backlash() -> Defect:
        value = _log(random, 3e-4, 5e-3)
        return Defect("backlash", component, value, 0.0, True, _to(component, lost=value))

    return [coulomb, viscous, stribeck, asymmetry, backlash]


def _actuator(
    component: str, path: str, largest: float, fastest: float, random: Random
) -> list[Callable[[], Defect]]:
    """largest, fastest: what its command reaches, in its unit and in its unit a second."""
    motor = component == "motor"

    def gain() -> Defect:
        value = 1.0 + _either(random, 0.02, 0.15)
        return Defect("gain", component, value, 1.0, True, _to(path, gain=value))

    def lag() -> Defect:
        value = _log(random, 1e-3, 1.2e-2)
        return Defect("lag", component, value, 0.0, True, _to(path, lag=value))

    def delay() -> Defect:
        value = _log(random, 1e-3, 1.2e-2)
        return Defect("delay", component, value, 0.0, True, _to(path, delay=value))

    def saturation() -> Defect:
        value = largest * random.uniform(0.5, 0.85)
        return Defect("saturation", component, value, np.inf, True, _to(path, limit=value))

    def deadband() -> Defect:
        value = _log(random, 0.03, 0.3) if motor else _log(random, 3e-4, 3e-3)
        return Defect("deadband", component, value, 0.0, True, _to(path, dead=value))

    def rate_limit() -> Defect:
        if motor:
            value = fastest * random.uniform(0.05, 0.5)
            return Defect("rate_limit", component, value, np.inf, True, _to(path, rate=value))
        value = min(fastest, 0.3) * random.uniform(0.2, 0.7)
        return Defect(
            "rate_limit", component, value, 0.3, True, _to(f"{path}_hydraulic", speed=value)
        )

    def compliance() -> Defect:
        value = _log(random, 2e-7, 3e-6)
        at_once = random.random() < 0.5
        hydraulic = _to(f"{path}_hydraulic", yields=value)

        def change(truth: Truth, law: Law) -> tuple[Truth, Law]:
            # A stiff bristle between carriage and a plate that yields needs steps far smaller.
            yielding = 0.0 if at_once else truth.yielding
            return hydraulic(truth._replace(bristle=0.0, yielding=yielding), law)

        return Defect("compliance", component, value, 0.0, True, change)

    def play() -> Defect:
        value = _log(random, 6e-4, 6e-3)
        return Defect("backlash", component, value, 0.0, True, _to(f"{path}_hydraulic", lost=value))

    def cogging() -> Defect:
        value = _log(random, 2.0, 15.0)
        change = _to(
            "",
            ripple=value,
            ripple_pitch=_log(random, 0.012, 0.05),
            ripple_phase=random.uniform(-3.0, 3.0),
        )
        return Defect("cogging", component, value, 0.0, True, change)

    own = [cogging] if motor else [compliance, play]
    return [gain, lag, delay, saturation, deadband, rate_limit, *own]


def _sensor(component: str, random: Random) -> list[Callable[[], Defect]]:
    cell = component == "load_cell"
    plain = CELL if cell else LVDT

    def gain() -> Defect:
        value = 1.0 + _either(random, 0.015, 0.1)
        return Defect("gain", component, value, 1.0, True, _to(component, gain=value))

    def offset() -> Defect:
        value = _either(random, 2.0, 20.0) if cell else _either(random, 2e-4, 3e-3)
        return Defect("offset", component, value, 0.0, True, _to(component, zero=value))

    def drift() -> Defect:
        value = _either(random, 0.3, 3.0) if cell else _either(random, 3e-5, 3e-4)
        return Defect("drift", component, value, 0.0, True, _to(component, drift=value))

    def lag() -> Defect:
        value = _log(random, 1e-3, 1e-2)
        return Defect("lag", component, value, 0.0, True, _to(component, lag=value))

    def delay() -> Defect:
        value = _log(random, 1e-3, 1e-2)
        return Defect("delay", component, value, 0.0, True, _to(component, delay=value))

    def hum() -> Defect:
        value = plain.mains * _log(random, 4.0, 10.0)
        return Defect("hum", component, value, plain.mains, True, _to(component, mains=value))

    def noise() -> Defect:
        value = plain.white * _log(random, 4.0, 10.0)
        return Defect("noise", component, value, plain.white, True, _to(component, white=value))

    def quantisation() -> Defect:
        value = plain.bit * _log(random, 60.0, 400.0)
        return Defect("quantisation", component, value, plain.bit, True, _to(component, bit=value))

    return [gain, offset, drift, lag, delay, hum, noise, quantisation]


def _others(random: Random) -> list[Callable[[], Defect]]:
    """Carriage, tyre and controller."""

    def mass() -> Defect:
        value = 34.0 * (1.0 + _either(random, 0.02, 0.25))
        return Defect("mass", "carriage", value, 34.0, True, _to("", mass=value))

    def stiffness() -> Defect:
        value = 50_000.0 * (1.0 + _either(random, 0.04, 0.25))
        return Defect("stiffness", "tyre", value, 50_000.0, True, _to("", tyre=value))

    def damping() -> Defect:
        value = _log(random, 40.0, 1000.0)
        return Defect("damping", "tyre", value, 0.0, True, _to("", tyre_damping=value))

    def hardening() -> Defect:
        value = _log(random, 6.0, 80.0)
        return Defect("hardening", "tyre", value, 0.0, True, _to("", tyre_hardening=value))

    def late() -> Defect:
        value = _log(random, 1e-3, 8e-3)
        return Defect("delay", "controller", value, 0.0, True, _to("", late=value))

    def missed() -> Defect:
        value = _log(random, 0.01, 0.1)
        return Defect("missed_ticks", "controller", value, 0.0, True, _to("", missed=value))

    def setting() -> Defect:
        name = str(random.choice(["kp", "ki", "kff", "filter_force"]))
        told = getattr(Law(), name)
        value = told * (1.0 + _either(random, 0.1, 0.5))
        change = lambda truth, law: (truth, law._replace(**{name: value}))  # noqa: E731
        return Defect(f"setting:{name}", "controller", value, told, True, change)

    return [mass, stiffness, damping, hardening, late, missed, setting]


def draw_unnamed(random: Random) -> list[Callable[[], Defect]]:
    """Defects that no report has a name for."""
    any_lvdt = str(random.choice(SENSORS[:3]))
    any_cylinder = str(random.choice(["ground", "structure"]))

    def unnamed(kind: str, component: str, value: float, change: Change) -> Callable[[], Defect]:
        return lambda: Defect(kind, component, value, 0.0, False, change)

    relaxing, wave, fading = (
        _log(random, 0.15, 0.6),
        _log(random, 0.25, 0.8),
        _either(random, 0.15, 0.5),
    )
    drag, bend = _log(random, 150.0, 1500.0), _either(random, 0.03, 0.15)
    slower, creep, pick = (
        _log(random, 0.04, 0.2),
        _either(random, 3e-5, 2e-4),
        _either(random, 1.0, 6.0),
    )
    return [
        unnamed(
            "viscoelastic",
            "tyre",
            relaxing,
            _to("", relaxing=relaxing, relaxing_time=_log(random, 0.02, 0.3)),
        ),
        unnamed(
            "uneven way",
            "rail",
            wave,
            _to("rail", wave=wave, wave_length=_log(random, 0.006, 0.03)),
        ),
        unnamed("heating", "motor", fading, _to("voltage", fading=3.0 * fading)),
        unnamed("quadratic drag", "rail", drag, _to("rail", drag=drag)),
        unnamed("bend", any_lvdt, bend, _to(any_lvdt, bend=bend)),
        unnamed(
            "slow valve",
            f"{any_cylinder}_cylinder",
            slower,
            _to(f"{any_cylinder}_hydraulic", slower=slower),
        ),
        unnamed(
            "creep",
            f"{any_cylinder}_cylinder",
            creep,
            _to(f"{any_cylinder}_hydraulic", creep=creep),
        ),
        unnamed("crosstalk", "load_cell", pick, _to("load_cell", picks_up=pick)),
    ]


def library(commands: Array, random: Random) -> list[list[Callable[[], Defect]]]:
    """Every defect that reports have a name for, by component. commands: of the test without
    defects, shape (ticks, 4)."""

    def reach(column: int) -> tuple[float, float]:
        rates = np.abs(np.diff(commands[:, column])) / 1e-3
        return float(np.max(np.abs(commands[:, column]))), float(np.quantile(rates, 0.999))

    carriage_and_tyre, controller = _others(random)[:4], _others(random)[4:]
    return [
        friction("rail", random),
        friction("motor", random) + _actuator("motor", "voltage", *reach(3), random),
        carriage_and_tyre,
        _actuator("ground_cylinder", "ground", *reach(0), random),
        _actuator("structure_cylinder", "structure", *reach(1), random),
        *(_sensor(name, random) for name in SENSORS),
        controller,
    ]


def draw_tolerated(random: Random) -> Truth:
    """A rig within its tolerances, in a laboratory with noise of its own, its friction set-valued
    or a stiff bristle."""

    def near(value: float, share: float) -> float:
        return value * (1.0 + random.uniform(-share, share))

    truth = Truth(
        mass=near(34.0, 0.005),
        tyre=near(50_000.0, 0.01),
        constant=near(186.0, 0.005),
        yielding=_log(random, 2e-3, 1e-2),
        bristle=_log(random, 1e8, 1e9) if random.random() < 0.3 else 0.0,
    )
    louder, hummier = _log(random, 0.5, 3.0), random.uniform(0.0, 2.0)
    for name in SENSORS:
        plain = CELL if name == "load_cell" else LVDT
        half = 0.5 if name == "load_cell" else 5e-5
        sensor = plain._replace(
            gain=near(1.0, 0.002),
            zero=random.uniform(-half, half),
            white=near(plain.white * louder, 0.2),
            mains=near(plain.mains * hummier, 0.2),
            delay=random.uniform(0.0, 1e-4),
        )
        truth = truth._replace(**{name: sensor})
    return truth._replace(
        rail=truth.rail._replace(coulomb=near(50.0, 0.03)),
        motor=truth.motor._replace(coulomb=near(14.0, 0.03)),
        voltage=truth.voltage._replace(delay=random.uniform(0.0, 1e-4)),
        ground=truth.ground._replace(delay=random.uniform(0.0, 1e-4)),
        structure=truth.structure._replace(delay=random.uniform(0.0, 1e-4)),
    )


def effect_size(rig: Truth, law: Law, defect: Defect, commands: Array) -> float:
    """By how many times its white noise a defect changes the sensor that it changes most, under the
    same commands."""
    if defect.kind in ("hum", "noise", "quantisation", "missed_ticks") or defect.kind.startswith(
        "setting"
    ):
        return float("inf")
    with_it, real = defect.change(rig, law)
    change = run_quiet(with_it, real, commands) - run_quiet(rig, law, commands)
    noise = np.array([getattr(rig, name).white for name in SENSORS])
    return float(np.max(np.sqrt(np.mean(change**2, axis=0)) / noise))


def summary(defect: Defect, size: float) -> dict[str, Any]:
    """What the key says of a defect."""
    return {
        "kind": defect.kind,
        "component": defect.component,
        "value": defect.value,
        "nominal": defect.nominal if np.isfinite(defect.nominal) else None,
        "inside": defect.inside,
        "size": size if np.isfinite(size) else None,
        "material": bool(size >= MATERIAL),
    }
