"""Stability map over two parameters of a vehicle and its loop, computed and drawn."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write
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
"""Parameters that can be an axis of a map, and their units. `tau` is the common lag of the model's
paths."""
SPAN = 10.0
"""Ratio between an end of an axis and the vehicle's own value."""
POINTS = 60
"""Number of points per axis."""
SPARSE = 24
"""Number of points per axis for models of the sampled loop, whose poles take longer to compute."""
DRAWABLE = (*MODELS, *AS_RUN)
KINDS = (".png", ".svg", ".pdf")


TITLES = {
    "sampled": "the rig as it runs, without compensation",
    "compensated": "the rig as it runs, the plate's delay compensated",
}


class Axis(NamedTuple):
    """Parameter of a map and its values, ascending."""

    name: str
    values: Array


@dataclass(frozen=True)
class StabilityMap:
    """Stability over two parameters.

    Attributes
    ----------
    model
        Name of the model.
    car, lag
        Vehicle, and lag in s, wherever they are not swept.
    across, up
        Horizontal and vertical axis.
    rightmost
        Real part of the rightmost pole, in 1/s, shape (up, across); stable below 0.
    critical
        Critical lag, in s, for each value of the second axis, NaN where every lag is stable. None
        unless `tau` is an axis.
    """

    model: str
    car: QuarterCar
    lag: float
    across: Axis
    up: Axis
    rightmost: Array
    critical: Array | None


def around(name: str, car: QuarterCar, lag: float, points: int = POINTS) -> Axis:
    """Return an axis around the vehicle's own value, in equal ratios.

    Where the vehicle's damping is 0, the axis reaches from 0 to critical damping.
    """
    if name not in UNITS:
        raise RigtwinError(f"unknown parameter {name!r}; expected one of {', '.join(UNITS)}")
    nominal = lag if name == LAG else getattr(car, name)
    if nominal > 0.0:
        ends = np.log10(nominal / SPAN), np.log10(nominal * SPAN)
        return Axis(name, np.logspace(*ends, points))
    # Critical damping is 2 sqrt(k m) of the mass that the damper acts on.
    mass = car.unsprung if name == "tyre_damping" else car.sprung
    return Axis(name, np.linspace(0.0, 2.0 * np.sqrt(mass.stiffness * mass.mass), points))


def stability_map(model: str, car: QuarterCar, lag: float, across: Axis, up: Axis) -> StabilityMap:
    """Return the stability map of a model.

    Parameters
    ----------
    model
        Name in `MODELS`, or in `AS_RUN` for the sampled loop with the rig's own lags.
    car
        The vehicle.
    lag
        Lag of every path, in s, unless `tau` is an axis. Unused by models in `AS_RUN`.
    across, up
        Horizontal and vertical axis.
    """
    check_model(model)
    if model in AS_RUN and LAG in (across.name, up.name):
        hint = "expected parameters of the vehicle"
        raise RigtwinError(f"a map of {model} over {LAG}: the model has the rig's own lags; {hint}")
    if across.name == up.name:
        raise RigtwinError(
            f"a map over {across.name} and {up.name}: expected two different parameters"
        )
    rows = [_change((validate(car), lag), up.name, float(value)) for value in up.values]
    settings = [_change(row, across.name, float(value)) for row in rows for value in across.values]
    if model in AS_RUN:
        # A rate of decay is minus the real part of the slowest mode.
        rightmost = np.array([-AS_RUN[model](vehicle) for vehicle, _ in settings])
    else:
        dynamics = np.array([MODELS[model](*setting).A for setting in settings])
        rightmost = np.linalg.eigvals(dynamics).real.max(axis=1)
    rightmost = rightmost.reshape(len(up.values), len(across.values))
    critical = None
    if LAG in (across.name, up.name):
        varied = up if across.name == LAG else across
        cars = [_change((car, lag), varied.name, float(value))[0] for value in varied.values]
        limits = [critical_lag(LOOPS[model](vehicle)) for vehicle in cars]
        critical = np.array([np.nan if limit is None else limit.time for limit in limits])
    return StabilityMap(
        model=model, car=car, lag=lag, across=across, up=up, rightmost=rightmost, critical=critical
    )


def check_model(model: str) -> None:
    """Raise RigtwinError unless a map can be drawn of the named model."""
    if model not in DRAWABLE:
        raise RigtwinError(f"unknown model {model!r}; expected one of {', '.join(DRAWABLE)}")


def check_image_format(out: Path) -> None:
    """Raise RigtwinError unless the file name ends in a supported image format."""
    if out.suffix.lower() not in KINDS:
        raise RigtwinError(
            f"cannot draw {out.name!r}: expected a file name that ends in {', '.join(KINDS)}"
        )


def draw(stability: StabilityMap, out: Path) -> None:
    """Draw a map into a png, svg or pdf file.

    Raises
    ------
    RigtwinError
        If the file name has another ending, or the file cannot be written.
    """
    check_image_format(out)
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    # Rates of decay span decades on both sides of zero: logarithmic, but linear near zero.
    largest = float(np.abs(stability.rightmost).max())
    # Equal ends on both sides put the limit of stability at the colour map's neutral middle.
    norm = SymLogNorm(1e-2 * largest, vmin=-largest, vmax=largest)
    across, up = stability.across, stability.up
    shades = axes.pcolormesh(
        across.values, up.values, stability.rightmost, cmap="RdBu_r", norm=norm, shading="nearest"
    )
    figure.colorbar(shades, ax=axes, label="real part of the rightmost pole, 1/s (stable below 0)")
    _draw_limit(axes, stability)
    vehicle = stability.car._asdict() | {LAG: stability.lag}
    axes.plot(
        *(vehicle[axis.name] for axis in (across, up)),
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
    lag = "" if stability.critical is not None else f", lags of {1e3 * stability.lag:g} ms"
    axes.set_title(TITLES.get(stability.model, f"stability of the {stability.model} model{lag}"))
    axes.legend(loc="upper right", fontsize=9)
    image = BytesIO()
    figure.savefig(image, dpi=120, format=out.suffix[1:].lower())
    atomic_write(out, image.getvalue())


def _draw_limit(axes: Axes, stability: StabilityMap) -> None:
    """Draw the limit of stability: the exact critical lag, or the contour at zero."""
    across, up, critical = stability.across, stability.up, stability.critical
    if critical is not None:
        over_lag = across.name == LAG
        curve = (critical, up.values) if over_lag else (across.values, critical)
        axes.plot(*curve, color="black", linewidth=1.5, label="critical lag, exact")
    elif stability.rightmost.min() < 0.0 < stability.rightmost.max():
        axes.contour(
            across.values,
            up.values,
            stability.rightmost,
            levels=[0.0],
            colors="black",
            linewidths=1.5,
        )
        # A contour has no legend entry; an empty line provides one.
        axes.plot(
            [],
            [],
            color="black",
            linewidth=1.5,
            label="limit of stability"
            if stability.model in AS_RUN
            else f"critical lag {1e3 * stability.lag:g} ms",
        )


def _change(setting: tuple[QuarterCar, float], name: str, value: float) -> tuple[QuarterCar, float]:
    """Return a vehicle and its lag with one parameter replaced."""
    car, lag = setting
    return (car, value) if name == LAG else (car._replace(**{name: value}), lag)
