"""Stability over any two parameters of a vehicle and its loop, and the map drawn."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from rigtwin.errors import RigtwinError
from rigtwin.files import write_whole
from rigtwin.numerics.arrays import Array
from rigtwin.studies.stability.critical import critical_lag
from rigtwin.studies.stability.loop import LOOPS
from rigtwin.studies.stability.models import MODELS
from rigtwin.studies.stability.tested import AS_RUN
from rigtwin.studies.stability.vehicle import QuarterCar, validate

LAG = "tau"
UNITS = {
    "tyre_stiffness": "N/m",
    "tyre_damping": "Ns/m",
    "unsprung_mass": "kg",
    "suspension_stiffness": "N/m",
    "suspension_damping": "Ns/m",
    "sprung_mass": "kg",
    LAG: "s",
}
"""Every parameter that a map can be drawn over; tau is the lag that all of the model's paths
share."""
SPAN = 10.0
"""A map reaches from the vehicle's own value over this to that times this."""
POINTS = 60
SPARSE = 24
"""The same of a model of the whole sampled loop, whose poles take longer."""
DRAWABLE = (*MODELS, *AS_RUN)
KINDS = (".png", ".svg", ".pdf")


TITLES = {
    "sampled": "the rig as it runs, without compensation",
    "compensated": "the rig as it runs, the plate's delay compensated",
}


class Axis(NamedTuple):
    """A parameter and the values that it takes, rising."""

    name: str
    values: Array


@dataclass(frozen=True)
class StabilityMap:
    """rightmost: real part of the rightmost pole, 1/s, shape (up, across), stable below 0;
    critical: where `tau` is an axis, the critical lag for each value of the other, s, NaN where
    stable with every lag."""

    model: str
    car: QuarterCar
    lag: float
    across: Axis
    up: Axis
    rightmost: Array
    critical: Array | None


def around(name: str, car: QuarterCar, lag: float, points: int = POINTS) -> Axis:
    """Values about the vehicle's own, in equal ratios; from 0 to critical damping where its own
    damping is 0."""
    if name not in UNITS:
        raise RigtwinError(f"unknown parameter {name!r}; there are {', '.join(UNITS)}")
    own = lag if name == LAG else getattr(car, name)
    if own > 0.0:
        return Axis(name, np.logspace(np.log10(own / SPAN), np.log10(own * SPAN), points))
    mass = car.unsprung if name == "tyre_damping" else car.sprung
    return Axis(name, np.linspace(0.0, 2.0 * np.sqrt(mass.stiffness * mass.mass), points))


def stability_map(model: str, car: QuarterCar, lag: float, across: Axis, up: Axis) -> StabilityMap:
    """The map of a model of `MODELS`, every lag of it `lag` s unless `tau` is an axis, or of one of
    `AS_RUN`, which has the rig's own lags."""
    checked_model(model)
    if model in AS_RUN and LAG in (across.name, up.name):
        expected = "expected parameters of the vehicle"
        raise RigtwinError(f"a map of {model} over {LAG}: it has the rig's own lags; {expected}")
    if across.name == up.name:
        raise RigtwinError(
            f"a map over {across.name} and {up.name}: expected two different parameters",
        )
    rows = [_change((validate(car), lag), up.name, float(value)) for value in up.values]
    settings = [_change(row, across.name, float(value)) for row in rows for value in across.values]
    if model in AS_RUN:
        rightmost = np.array([-AS_RUN[model](each) for each, _ in settings])
    else:
        dynamics = np.array([MODELS[model](*setting).A for setting in settings])
        rightmost = np.linalg.eigvals(dynamics).real.max(axis=1)
    rightmost = rightmost.reshape(len(up.values), len(across.values))
    critical = None
    if LAG in (across.name, up.name):
        other = up if across.name == LAG else across
        cars = [_change((car, lag), other.name, float(value))[0] for value in other.values]
        times = [critical_lag(LOOPS[model](each)) for each in cars]
        critical = np.array([np.nan if each is None else each.time for each in times])
    return StabilityMap(
        model=model,
        car=car,
        lag=lag,
        across=across,
        up=up,
        rightmost=rightmost,
        critical=critical,
    )


def checked_model(model: str) -> None:
    """Raises RigtwinError unless there is a model of that name."""
    if model not in DRAWABLE:
        raise RigtwinError(f"unknown model {model!r}; there are {', '.join(DRAWABLE)}")


def checked_ending(out: Path) -> None:
    """Raises RigtwinError unless a map can be drawn to that name."""
    if out.suffix.lower() not in KINDS:
        raise RigtwinError(
            f"cannot draw {out.name!r}: expected a name that ends in {', '.join(KINDS)}",
        )


def draw(found: StabilityMap, out: Path) -> None:
    """Draws a map into a png, svg or pdf file. Raises RigtwinError for another ending or if it
    cannot be written."""
    checked_ending(out)
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    largest = float(np.abs(found.rightmost).max())
    norm = SymLogNorm(1e-2 * largest, vmin=-largest, vmax=largest)
    across, up = found.across, found.up
    shades = axes.pcolormesh(
        across.values,
        up.values,
        found.rightmost,
        cmap="RdBu_r",
        norm=norm,
        shading="nearest",
    )
    figure.colorbar(shades, ax=axes, label="real part of the rightmost pole, 1/s (stable below 0)")
    if found.critical is not None:
        over_lag = across.name == LAG
        curve = (found.critical, up.values) if over_lag else (across.values, found.critical)
        axes.plot(*curve, color="black", linewidth=1.5, label="critical lag, exact")
    elif found.rightmost.min() < 0.0 < found.rightmost.max():
        axes.contour(
            across.values,
            up.values,
            found.rightmost,
            levels=[0.0],
            colors="black",
            linewidths=1.5,
        )
        axes.plot(
            [],
            [],
            color="black",
            linewidth=1.5,
            label="limit of stability"
            if found.model in AS_RUN
            else f"critical lag {1e3 * found.lag:g} ms",
        )
    vehicle = found.car._asdict() | {LAG: found.lag}
    own = [vehicle[axis.name] for axis in (across, up)]
    axes.plot(
        *own,
        "o",
        color="black",
        markerfacecolor="white",
        markersize=8,
        clip_on=False,
        zorder=5,
        label="the vehicle",
    )
    for axis, scale, limits, label in (
        (across, axes.set_xscale, axes.set_xlim, axes.set_xlabel),
        (up, axes.set_yscale, axes.set_ylim, axes.set_ylabel),
    ):
        scale("log" if axis.values[0] > 0.0 else "linear")
        limits(float(axis.values[0]), float(axis.values[-1]))
        name = "lag τ" if axis.name == LAG else axis.name.replace("_", " ")
        label(f"{name}, {UNITS[axis.name]}")
    lag = "" if found.critical is not None else f", lags of {1e3 * found.lag:g} ms"
    axes.set_title(TITLES.get(found.model, f"stability of the {found.model} model{lag}"))
    axes.legend(loc="upper right", fontsize=9)
    drawn = BytesIO()
    figure.savefig(drawn, dpi=120, format=out.suffix[1:].lower())
    write_whole(out, drawn.getvalue())


def _change(setting: tuple[QuarterCar, float], name: str, value: float) -> tuple[QuarterCar, float]:
    car, lag = setting
    return (car, value) if name == LAG else (car._replace(**{name: value}), lag)
