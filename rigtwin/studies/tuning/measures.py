"""Measures of a test: the objectives of tuning, defined in one place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import FunctionType
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from controllers import Commands, Measurements
from rigtwin.components.tyre import tyre_force
from rigtwin.description.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import rms
from rigtwin.simulation.ideal import Ideal, simulate_ideal
from rigtwin.simulation.metrics import Tracking, compute_tracking
from rigtwin.studies.stability.sampled_loop import decay

HEAVE = 3.0
"""Upper limit of the body's heave on this suspension, in Hz. From 3.4 Hz on, the plate's motion
contains the limit cycle that friction causes."""


@dataclass(frozen=True)
class Trial:
    """Test that ran to its end.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the test.
    columns : mapping
        Topic → field → signal, shape (ticks,).
    first : int
        First tick that is measured.
    """

    configuration: Configuration
    columns: Mapping[str, Mapping[str, Array]]
    first: int = 0

    @property
    def period(self) -> float:
        """Period of a tick, in s."""
        return self.configuration.timing.period


@dataclass(frozen=True)
class RigTrial(Trial):
    """Test of the suspension rig. On a twin the sensors are taken without noise."""

    @cached_property
    def commands(self) -> Array:
        """Commands, shape (ticks, 4), in the order of `controllers.Commands`."""
        return np.column_stack([self.columns["/command"][name] for name in Commands._fields])

    @cached_property
    def sensed(self) -> Array:
        """Sensors, shape (ticks, 4), in the order of `controllers.Measurements`."""
        return np.column_stack([self.columns["/sensor"][name] for name in Measurements._fields])

    @property
    def plate(self) -> Array:
        """Position of the plate, in m."""
        return self.sensed[self.first :, 1]

    @property
    def travel(self) -> Array:
        """Travel of the suspension, in m."""
        return self.sensed[self.first :, 2]

    @property
    def tyre(self) -> Array:
        """Force of the tyre, in N."""
        # Ground minus wheel, where the wheel stands at plate minus travel.
        deflection = self.sensed[:, 0] - self.sensed[:, 1] + self.sensed[:, 2]
        rate = np.gradient(deflection, self.period)
        return tyre_force(self.configuration.plant.tyre, deflection, rate)[self.first :]

    @cached_property
    def tracking(self) -> Tracking:
        """Errors against the ideal vehicle (thesis Eq. 3.1 and 3.2)."""
        # Simulated from the start, so that the ideal vehicle is settled when measuring begins.
        target = simulate_ideal(self.configuration, self.commands[:, 0])
        # The transient before `first` is no property of the settings.
        late = slice(self.first, None)
        motions = (target.structure[late], target.velocity[late], target.wheel[late])
        shown = Ideal(*motions, target.force[late], None)
        return compute_tracking(shown, self.commands[late], self.plate, self.sensed[late, 3])


@dataclass(frozen=True)
class Measure:
    """Definition of one figure of a test.

    Parameters
    ----------
    name, title, unit : str
        Name in studies, title in words, and SI unit.
    compute : callable
        Function from a trial to the figure. It must be picklable, because workers receive it.
    more : bool, optional
        Whether larger values are better.
    """

    name: str
    title: str
    unit: str
    compute: Callable[[Any], float]
    more: bool = False

    @property
    def definition(self) -> str:
        """Text that defines the measure, where a study does; empty for functions."""
        return "" if isinstance(self.compute, FunctionType) else repr(self.compute)


def _ride(trial: RigTrial) -> float:
    return rms(np.diff(trial.plate, 2) / trial.period**2)


def _heave(trial: RigTrial) -> float:
    # Filtering forwards and backwards leaves no phase lag.
    low_pass = butter(2, HEAVE, fs=1.0 / trial.period, output="sos")
    return rms(np.diff(sosfiltfilt(low_pass, trial.plate), 2) / trial.period**2)


def _road_holding(trial: RigTrial) -> float:
    return float(np.std(trial.tyre))


def _travel(trial: RigTrial) -> float:
    return float(np.std(trial.travel))


def _force_error(trial: RigTrial) -> float:
    return trial.tracking.force_e1 + trial.tracking.force_e2


def _position_error(trial: RigTrial) -> float:
    return trial.tracking.position_e1 + trial.tracking.position_e2


def _tracking(trial: RigTrial) -> float:
    return trial.tracking.force_e2


def _model_error(trial: RigTrial) -> float:
    return trial.tracking.force_e1


def _position_tracking(trial: RigTrial) -> float:
    return trial.tracking.position_e2


def _effort(trial: RigTrial) -> float:
    return float(np.std(trial.commands[trial.first :, 3]))


def _margin(trial: RigTrial) -> float:
    return decay(trial.configuration)


_ALL = (
    Measure("ride", "rms body acceleration", "m/s²", _ride),
    Measure("heave", f"rms body acceleration up to {HEAVE:g} Hz", "m/s²", _heave),
    Measure("road_holding", "rms dynamic tyre force", "N", _road_holding),
    Measure("travel", "rms suspension travel about its mean", "m", _travel),
    Measure("tracking", "rms force tracking error e2", "N", _tracking),
    Measure("model_error", "rms force model error e1", "N", _model_error),
    Measure("force_error", "force error, rms e1 + rms e2", "N", _force_error),
    Measure("position_tracking", "rms position tracking error e2", "m", _position_tracking),
    Measure("position_error", "position error, rms e1 + rms e2", "m", _position_error),
    Measure("effort", "rms motor voltage about its mean", "V", _effort),
    Measure(
        name="stability_margin",
        title="decay of the linear loop's slowest motion",
        unit="1/s",
        compute=_margin,
        more=True,
    ),
)
MEASURES = {measure.name: measure for measure in _ALL}
"""Measures by their names in studies. Errors are defined by thesis Eq. 3.1, 3.2 and Table 4.2."""
