"""Model of joints that act on each other and of which some are free, as a diagnosis asks for it.

`coupled_joints` computes the motion; here are predictions, and unmodelled disturbances.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.components.scales import Motion
from rigtwin.components.servo import push
from rigtwin.models.basis import Passage, forms
from rigtwin.models.coupled_joints import CoupledJoints
from rigtwin.models.joint import SEED, SMALL
from rigtwin.models.model import Form, Model
from rigtwin.models.windows import Window
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Inputs
from rigtwin.signals.motion import smooth
from rigtwin.signals.noise import white_noise

COMMANDED = "/command"
"""Topic of the signals that are held from tick to tick."""
COARSER = 2.0
"""Factor on the longest step of a search. Each step is checked against the exact prediction, so it
may be tried longer than in models without this check."""
THINNED = 5e-3
"""Largest change of a signal by longer steps in a search, as a share of its standard deviation."""
STEP_EFFORT = 1.5e-6
"""Estimated processor time of an integration step for each free coordinate, s."""
UNSTABLE = 0.3
"""Largest change of a signal by a search's approximations in an unstable machine, as a share of the
nominal residual."""


class ForwardDynamicsModel(CoupledJoints, Model[Plant]):
    """Forward-dynamics model of all coupled joints of one recording."""

    def halve_steps(self) -> ForwardDynamicsModel:
        return self._with_steps(max(1, self._steps // 2))

    def double_steps(self) -> ForwardDynamicsModel:
        return self._with_steps(2 * self._steps)

    def near(self, plant: Plant) -> ForwardDynamicsModel:
        if self._starts.linear:
            return self
        return self._with_windows(self._steps, self._starts.near(plant, self._sense_from(plant)))

    def _with_steps(self, steps: int) -> ForwardDynamicsModel:
        # How well the start is known hardly depends on the integration steps.
        return self._with_windows(steps, self._starts.windows)

    def _with_windows(self, steps: int, windows: tuple[Window, ...]) -> ForwardDynamicsModel:
        return ForwardDynamicsModel(
            self._machine,
            self._replay,
            self._signals,
            self._configuration,
            steps,
            self.every,
            self._starts.linear,
            windows,
        )

    @property
    def effort(self) -> float:
        return STEP_EFFORT * self._ticks * self._steps * self._loose

    @property
    def has_linear_starts(self) -> bool:
        return self._starts.linear

    def thin(self, longest: float) -> ForwardDynamicsModel:
        """Return a coarser model for a search.

        It has fewer ticks and longer integration steps, if both change next to nothing. Errors of
        the start are linear in any case: for a wrong model they differ much from fitted states, but
        for the right one both are small and agree.
        """
        plant, linear = self._configuration.plant, self._starts.may_be_linear
        # Only grids are compared: where the model is wrong, fitted starts differ from linear ones
        # by more than any grid does.
        whole = self._coarsen(1, self._steps, linear) if linear else self
        exact = whole.predict(plant)
        allowed = THINNED * np.std(exact, axis=1)
        if len(self._starts.windows) > 1:
            # Where small errors grow, what the model lacks moves the fitted states more than that.
            # Both shrink together in the course of a search.
            observed = np.stack([self._signals.column(*row.channel) for row in self.rows])
            allowed = np.maximum(allowed, UNSTABLE * np.std(exact - observed, axis=1))
        for every, steps in self._list_grids(longest):
            if (every, steps) == (1, self._steps):
                break
            coarser = self._coarsen(every, steps, linear)
            change = coarser.predict(plant) - exact[:, ::every]
            if bool(np.all(np.sqrt(np.mean(change**2, axis=1)) <= allowed)):
                return coarser
        return whole

    def _coarsen(self, every: int, steps: int, linear: bool) -> ForwardDynamicsModel:
        """Return the model with one tick in `every`, and `steps` integration steps in each."""
        return ForwardDynamicsModel(
            self._machine,
            self._replay,
            _average_commands(self._signals, every),
            self._configuration,
            steps,
            every,
            linear,
            # A window holds signals at its own ticks, so other ticks need windows of their own.
            self._starts.windows if every == 1 else None,
            self.cuts,
        )

    def _list_grids(self, longest: float) -> Iterator[tuple[int, int]]:
        """Yield ticks that make one, and integration steps per such tick, the cheapest first."""
        # What is prescribed is smoothed from all its samples.
        most = 1 if self._layout.leaders else max(int(COARSER * longest / self._period), 1)
        for every in range(most, 0, -1):
            # A record that is slow already has no ticks to spare: stiff servos need short steps.
            steps = math.ceil(every * self._period / (longest if every == 1 else COARSER * longest))
            # The exact model's steps may be longer than a search needs.
            steps = min(steps, self._steps * every)
            while steps <= self._steps * every:
                yield every, steps
                steps *= 2

    def predict_true(self, plant: Plant) -> Array:
        return self._true(self.move(plant))

    def predict(self, plant: Plant) -> Array:
        predicted = self._sense(plant, self.move(plant))
        return self._starts.correct(plant, self._key(plant), self._sense_from(plant), predicted)

    def predict_disturbed(self, plant: Plant, entry: str, amount: Array) -> Array:
        if entry in self._layout.guides:
            guide_disturbance = np.zeros((len(self._layout.guides), self._ticks))
            guide_disturbance[self._layout.guides.index(entry)] = amount
            return self._sense(plant, self.move(plant, guide_disturbance=guide_disturbance))
        if entry in self._layout.leaders:
            return self._sense(plant, self.move(plant, shifts={entry: amount}))
        if entry in self._layout.along and entry not in {row.name for row in self.rows}:
            disturbance = self._layout.along[entry][:, None] * amount
            return self._sense(plant, self.move(plant, disturbance=disturbance))
        predicted = self.predict(plant)
        predicted[[row.name for row in self.rows].index(entry)] += amount
        return predicted

    def notes(self) -> tuple[str, ...]:
        windows = self._starts.windows
        if len(windows) == 1:
            return ()
        longest = max(window.ticks for window in windows) * self._period
        return (
            f"this motion is unstable, so that small errors grow: it is predicted in "
            f"{len(windows)} windows of at most {longest:.2g} s, each from an initial state "
            "that is fitted to the sensors",
        )

    # Disturbances

    def components(self) -> tuple[str, ...]:
        return (
            *self._layout.guides,
            *self._layout.rotors,
            *self._replay.moved_by,
            *(row.name for row in self.rows),
        )

    def _passage(self, component: str, plant: Plant) -> tuple[Array, Array, Array]:
        """Return position, speed and force along a component's coordinate, shape (ticks,) each."""
        moved, along = self.move(plant), self._layout.along[component]
        if not along.any():
            along = self._layout.along[self.rows[0].name]
        position, speed = along @ moved[0], along @ moved[1]
        if component in self._layout.pushers:
            # The joints' force is that of all actuators together: take this actuator's alone.
            law = self._layout.push_law(plant, component)
            command = self._drives.condition(plant, [component])[0, :: self._steps]
            at = position + self._layout.zero[component]
            passed = [push(law, *each) for each in zip(command, at, speed, strict=True)]
            return position, speed, np.array(passed)
        force = along @ moved[2] / float(along @ along)
        if not force.any():
            # No actuator acts: the force is inertia times acceleration.
            force = self._drives.inertia_along(along) * np.gradient(speed, self._period)
        return position, speed, force

    def forms(self, component: str, plant: Plant) -> list[Form]:
        position, speed, force = self._passage(component, plant)
        names = [row.name for row in self.rows]
        # A component's role decides which shapes of a disturbance are plausible there.
        signal, role = force, "guide"
        if component in names:
            signal, role = self.predict(plant)[names.index(component)], "sensor"
        elif component in self._layout.pushers:
            role = "force"
        elif component in self._layout.leaders:
            signal, role = position, "position"
        elif component in self._layout.rotors:
            role = "mass"
        return forms(role, component, Passage(signal, position, speed, force, self._period))

    def disturbance_size(self, entry: str) -> float:
        plant, names = self._machine.plant, [row.name for row in self.rows]
        if entry in names:
            size = float(np.std(self.predict(plant)[names.index(entry)]))
        else:
            position, _, force = self._passage(entry, plant)
            size = float(np.std(position if entry in self._layout.leaders else force))
        return SMALL * max(size, 1e-9)

    def motion(self, component: str, plant: Plant) -> Motion:
        known = component if component in self._layout.along else self.rows[0].name
        return Motion(*self._passage(known, plant))

    def propagated_noise(self, plant: Plant) -> Array | None:
        """Return the change of the predictions by one draw of the measured motions' noise."""
        random = np.random.default_rng(SEED)
        shifts = {}
        for name in self._layout.leaders:
            if name in self._read and self._read[name][1] > 0.0:
                level = white_noise(self._column(name))
                signal = self._read[name][0]
                noise = level * random.standard_normal(self._ticks)
                shifts[name] = smooth(signal + noise, self._period).motion - signal
        if not shifts:
            return None
        return self._true(self.move(plant, shifts=shifts)) - self.predict_true(plant)


def _average_commands(inputs: Inputs, every: int) -> Inputs:
    """Return every n-th tick of the readings, and the means of the commands in between.

    A held command acts over the whole interval, so its mean keeps the impulse on the joint.
    """
    if every == 1:
        return inputs
    starts = np.arange(0, inputs.ticks, every)
    counts = np.diff(np.append(starts, inputs.ticks))
    columns = {
        topic: {
            name: np.add.reduceat(signal, starts) / counts if topic == COMMANDED else signal[starts]
            for name, signal in names.items()
        }
        for topic, names in inputs.columns.items()
    }
    return replace(inputs, period=every * inputs.period, columns=columns)
