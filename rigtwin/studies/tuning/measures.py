"""What a test is judged by: the objectives of tuning, each defined once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import butter, sosfiltfilt

from rigtwin.components.tyre import tyre_force
from rigtwin.machine.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import rms
from rigtwin.simulation.ideal import Ideal, ideal
from rigtwin.simulation.metrics import Tracking, tracked
from rigtwin.studies.stability.sampled_loop import decay

HEAVE = 3.0
"""Hz; up to which a body on this suspension heaves. Above, the plate carries the limit cycle by friction, from 3.4 Hz on."""


@dataclass(frozen=True)
class Trial:
    """A test that was run to its end, judged from tick `first` on. commands, sensed: shape (ticks, 4), columns of
    controllers.Commands and .Measurements; sensed: without noise where a twin knows it."""

    configuration: Configuration
    commands: Array
    sensed: Array
    first: int = 0

    @property
    def period(self) -> float:
        """s."""
        return self.configuration.timing.period

    @property
    def plate(self) -> Array:
        return self.sensed[self.first :, 1]

    @property
    def travel(self) -> Array:
        return self.sensed[self.first :, 2]

    @property
    def tyre(self) -> Array:
        """The tyre's force, N."""
        deflection = self.sensed[:, 0] - self.sensed[:, 1] + self.sensed[:, 2]
        return tyre_force(self.configuration.plant.tyre, deflection, np.gradient(deflection, self.period))[self.first :]

    @cached_property
    def tracking(self) -> Tracking:
        target = ideal(self.configuration, self.commands[:, 0])
        late = slice(self.first, None)
        shown = Ideal(target.structure[late], target.velocity[late], target.wheel[late], target.force[late], None)
        return tracked(shown, self.commands[late], self.plate, self.sensed[late, 3])


@dataclass(frozen=True)
class Measure:
    """One figure of a test. title: in words; unit; of: the figure; more: whether more of it is better."""

    name: str
    title: str
    unit: str
    of: Callable[[Trial], float]
    more: bool = False


def _acceleration(test: Trial) -> Array:
    return np.diff(test.plate, 2) / test.period**2


def _heave(test: Trial) -> float:
    smooth = sosfiltfilt(butter(2, HEAVE, fs=1.0 / test.period, output="sos"), test.plate)
    return rms(np.diff(smooth, 2) / test.period**2)


MEASURES = {
    measure.name: measure
    for measure in (
        Measure("ride", "rms body acceleration", "m/s²", lambda test: rms(_acceleration(test))),
        Measure("heave", f"rms body acceleration up to {HEAVE:g} Hz", "m/s²", _heave),
        Measure("road_holding", "rms dynamic tyre force", "N", lambda test: float(np.std(test.tyre))),
        Measure("travel", "rms suspension travel about its mean", "m", lambda test: float(np.std(test.travel))),
        Measure("tracking", "rms force tracking error e2", "N", lambda test: test.tracking.force_e2),
        Measure("model_error", "rms force model error e1", "N", lambda test: test.tracking.force_e1),
        Measure(
            "force_error", "force error, rms e1 + rms e2", "N", lambda test: test.tracking.force_e1 + test.tracking.force_e2
        ),
        Measure("position_tracking", "rms position tracking error e2", "m", lambda test: test.tracking.position_e2),
        Measure(
            "position_error",
            "position error, rms e1 + rms e2",
            "m",
            lambda test: test.tracking.position_e1 + test.tracking.position_e2,
        ),
        Measure("effort", "rms motor voltage about its mean", "V", lambda test: float(np.std(test.commands[test.first :, 3]))),
        Measure(
            "stability_margin", "decay of the linear loop's slowest motion", "1/s", lambda test: decay(test.configuration), True
        ),
    )
}
"""By the names that studies take. Errors as in thesis Eq. 3.1, 3.2 and Table 4.2."""
