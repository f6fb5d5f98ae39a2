"""Values from which the search for an effect starts, scaled by the recorded motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigtwin.components import Effect, Scales, Starts
from rigtwin.components.plant import Plant
from rigtwin.components.scales import Swing
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Values
from rigtwin.diagnosis.spikes import JUMPS
from rigtwin.diagnosis.swing import swings
from rigtwin.diagnosis.waves import repeating_pitches
from rigtwin.numerics.arrays import Array

LIMITS = ("saturation", "rate_limit", "resonance", "force_limit", "end_stops")
"""Kinds whose response does not scale with their magnitude."""
PITCHES = 3
"""Number of pitches that are read off the unexplained force."""
SMALL_START_BESIDE = 0.2
"""Share of the smallest start at which an effect is simulated as well beside other effects."""


class EffectStarts:
    """Starts of effects on one body of evidence.

    Parameters
    ----------
    evidence
        Recordings, whose commands and motions give the scales.
    """

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence
        self._swings = swings(evidence.machine, evidence.recordings)
        self._scales: dict[str, Scales] = {}
        self._nominal: dict[Effect, Starts] = {}

    def nominal(self, effect: Effect) -> Starts:
        """Return the starts of an effect of the nominal plant."""
        if effect not in self._nominal:
            self._nominal[effect] = self.at(effect, self._evidence.plant)
        return self._nominal[effect]

    def at(self, effect: Effect, plant: Plant) -> Starts:
        """Return the starts of an effect beside those of a plant."""
        swing = self._swings.get(effect.component, Swing())
        return effect.starts(plant, swing, lambda: self._scale(effect.group))

    def few(self, effect: Effect, plant: Plant) -> list[tuple[float, ...]]:
        """Return a small and a middle magnitude of each shape and sign.

        A response scales with its magnitude only over a limited range: dry friction that exceeds
        the driving force, for example, stops the motion.

        Parameters
        ----------
        effect
            Effect whose starts are thinned.
        plant
            Plant beside whose effects it is simulated.

        Returns
        -------
        list of tuples
            Values of the effect's parameters.
        """
        starts = self.at(effect, plant)
        nominal = effect.nominal(plant)[effect.kind.parameters[0]]
        shapes: dict[tuple[float, ...], list[tuple[float, ...]]] = {}
        for values in starts.values:
            sign = 1.0 if values[0] >= nominal else -1.0
            shapes.setdefault((sign, *values[1:]), []).append(values)
        few = []
        for values in shapes.values():
            # Sorted by distance from nominal, the first is the smallest change and that in the
            # middle a typical one.
            values.sort(key=lambda start: abs(start[0] - nominal))
            few.append(values[len(values) // 2])
            is_linear = starts.is_linear or starts.quadrature
            if effect.kind.name not in LIMITS and not is_linear:
                small = nominal + SMALL_START_BESIDE * (values[0][0] - nominal)
                few.append((small, *values[0][1:]))
        return few

    def scale(self, effect: Effect, start: tuple[float, ...], share: float) -> Values:
        """Scale the magnitude of a start about its nominal value.

        Parameters
        ----------
        effect
            Effect of the start.
        start
            Values of the effect.
        share
            Factor of the magnitude's difference from nominal. Limits are not scaled.

        Returns
        -------
        tuple
            Values of this single effect.
        """
        nominal = tuple(effect.nominal(self._evidence.plant).values())
        if effect.kind.name in LIMITS:
            return (start,)
        count = effect.kind.magnitudes
        scaled = (
            value + share * (begun - value)
            for begun, value in zip(start[:count], nominal, strict=False)
        )
        return ((*scaled, *start[count:]),)

    def _scale(self, component: str) -> Scales:
        """Return the scales of a component's motion and force on the longest recording.

        The motion is simulated with the nominal plant; the force is the largest measured one.
        """
        if component not in self._scales:
            longest = max(
                range(len(self._evidence.models)), key=lambda n: self._evidence.recordings[n].ticks
            )
            measured = self._evidence.lines[longest].measured
            rows = self._evidence.machine.rows
            forces = [measured[n] for n, row in enumerate(rows) if row.kind in JUMPS]
            # A machine without a measured force or command has none to scale by.
            force = max((float(np.sqrt(np.mean(column**2))) for column in forces), default=0.0)
            motion = self._evidence.models[longest].motion(component, self._evidence.plant)
            period = self._evidence.lines[longest].period
            position = self._measured_position(component)
            scales = Scales.of(motion, force, period, position)
            pitches = self._pitches(component, longest, motion.position)
            self._scales[component] = replace(scales, pitches=pitches)
        return self._scales[component]

    def _pitches(self, component: str, recording: int, position: Array) -> tuple[float, ...]:
        """Return the pitches at which the unexplained force at a component's joint repeats, m.

        Empty where that force was not measured.
        """
        described = self._evidence.machine.components
        joint = described[component].joint if component in described else ""
        rows = [
            number
            for number, row in enumerate(self._evidence.machine.rows)
            if row.kind == "force" and row.name in described and described[row.name].joint == joint
        ]
        if not joint or not rows:
            return ()
        lines = self._evidence.lines[recording]
        predicted = self._evidence.models[recording].predict(self._evidence.plant)
        force = lines.measured[rows[0]] - predicted[rows[0]]
        return repeating_pitches(force, position, PITCHES)

    def _measured_position(self, component: str) -> Array | None:
        """Return the measured positions along a component in all recordings, if any.

        They are those of its joint, or the length of its tendon by all joints that it passes.
        """
        described = self._evidence.machine.components
        if component not in described:
            return None
        rows = {
            described[row.name].joint: number
            for number, row in reversed(list(enumerate(self._evidence.machine.rows)))
            if row.kind == "position" and row.name in described
        }
        joint = described[component].joint
        along = ((joint, 1.0),) if joint else described[component].acts_on
        if not along or not all(joint in rows for joint, _ in along):
            return None
        measured = np.concatenate([lines.measured for lines in self._evidence.lines], axis=1)
        return np.asarray(sum(share * measured[rows[joint]] for joint, share in along))
