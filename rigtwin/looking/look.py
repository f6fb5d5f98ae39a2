"""One recording beside its twin, while candidate effects are moved."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis import calibrated
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, clashes, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.errors import RigtwinError
from rigtwin.files import keep_apart, write_whole
from rigtwin.looking.motions import find_positions, predicts_motion
from rigtwin.looking.prediction import Prediction, judge
from rigtwin.looking.slider import Slider, sliders_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording


class Look:
    """A recording, its twin, and the effects that the twin may lack.

    effects: candidates by name; sliders: of each, one a parameter; time: s, shape (ticks,);
    measured: as the model predicts them (in its band, mains line taken out), shape (sensors,
    ticks); nominal: what the twin predicts as it is. Values of effects are one number a parameter,
    in the order of the sliders.
    """

    def __init__(
        self, machine: Machine, recording: Recording, base: Configuration | None = None
    ) -> None:
        """base: the twin, by default the described one. Raises RigtwinError naming every fault of
        the data that makes a comparison meaningless."""
        configuration = machine.configuration_of(recording, base)
        require_fit(machine, recording, configuration)
        self.machine, self.recording = machine, recording
        self._evidence = Evidence(machine, [recording], [configuration])
        self._fitter = Fitter(self._evidence)
        self.effects = {effect.name: effect for effect in machine.effects() if effect.searched}
        self.sliders = {name: self._sliders(effect) for name, effect in self.effects.items()}
        lines = self._evidence.lines[0]
        self.measured = lines.measured
        self.time: Array = recording.time[0] + lines.period * np.arange(lines.measured.shape[1])
        self.nominal = self.predict({})

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the observed signals, in the order of their rows."""
        return tuple(self._evidence.names)

    @property
    def units(self) -> tuple[str, ...]:
        """Of the observed signals."""
        return tuple(row.unit for row in self.machine.rows)

    @property
    def predicts_motion(self) -> bool:
        """Whether any of the observed signals is a motion; else what moves the twin is what was
        measured."""
        return predicts_motion(self.machine)

    def positions(self, prediction: Prediction | None = None) -> dict[str, Array]:
        """Where the joints stand.

        Parameters
        ----------
        prediction
            Of the twin that is meant; by default the machine itself, as measured.

        Returns
        -------
        dict of Array
            Joint → position, m or rad, shape (ticks,). Of joints that no signal speaks of, nothing.
        """
        signals = None if prediction is None else prediction.signals
        return find_positions(self.machine, self.recording, self._evidence.lines[0].period, signals)

    def clashing(self, name: str, others: Iterable[str]) -> tuple[str, ...]:
        """Of other effects, those that set a parameter that this one sets too.

        Parameters
        ----------
        name
            Of the one.
        others
            Names.

        Returns
        -------
        tuple of str
            Names.

        Raises
        ------
        RigtwinError
            For an unknown effect.
        """
        effect = self._find(name)
        return tuple(each for each in others if clashes(effect, [self._find(each)]))

    def _sliders(self, effect: Effect) -> tuple[Slider, ...]:
        low, high = self._fitter.bounds((effect,))
        return sliders_of(
            effect,
            self._evidence.plant,
            self._fitter.starts(effect).values,
            list(zip(low.tolist(), high.tolist(), strict=True)),
            [self.machine.unit(effect.group, each) for each in effect.quantities().values()],
        )

    def _find(self, name: str) -> Effect:
        if name not in self.effects:
            raise RigtwinError(f"unknown effect {name!r}; there are {', '.join(self.effects)}")
        return self.effects[name]

    def _compatible(self, names: Sequence[str]) -> tuple[Effect, ...]:
        found: list[Effect] = []
        for name in names:
            effect = self._find(name)
            if clashes(effect, found):
                raise RigtwinError(
                    f"{name} sets a parameter that another effect of {', '.join(names)} sets too"
                )
            found.append(effect)
        return tuple(found)

    def plant(self, values: Mapping[str, Sequence[float]]) -> Plant:
        """The twin's plant with effects.

        Parameters
        ----------
        values
            Of the effects, by name.

        Returns
        -------
        Plant
            With them.

        Raises
        ------
        RigtwinError
            For an unknown effect, two that set the same parameter, or values that are too many, too
            few or out of bounds.
        """
        effects = self._compatible(tuple(values))
        for effect, numbers in zip(effects, values.values(), strict=True):
            _check(effect, numbers)
        return with_values(self._evidence.plant, effects, list(values.values()))

    def predict(self, values: Mapping[str, Sequence[float]]) -> Prediction:
        """What the twin with these effects predicts, and how far off it is.

        Parameters
        ----------
        values
            As `plant` takes them.

        Returns
        -------
        Prediction
            Of the whole recording.

        Raises
        ------
        RigtwinError
            As `plant` does.
        """
        signals = self._evidence.predict(self.plant(values))[0]
        return judge(self.sensors, self._evidence.lines[0], signals)

    def fit(self, names: Sequence[str]) -> Fit:
        """The values of effects that explain the recording best, as a diagnosis fits them.

        Parameters
        ----------
        names
            Of the effects that are fitted together, one or more.

        Returns
        -------
        Fit
            Effects, values and their standard deviations.

        Raises
        ------
        RigtwinError
            For none, an unknown effect, or two that set the same parameter.
        """
        effects = self._compatible(names)
        if not effects:
            raise RigtwinError(f"no effect to fit; there are {', '.join(self.effects)}")
        alone = [self._fitter.fit_one(self._fitter.screen(effect)) for effect in effects]
        start = [each.values[0] for each in alone]
        together = alone[0] if len(alone) == 1 else self._fitter.refine(effects, start)
        return self._fitter.refit_with_tolerances(together)

    def save(self, path: str | Path, values: Mapping[str, Sequence[float]]) -> Path:
        """Writes the twin with these effects as TOML, for `--config`.

        Parameters
        ----------
        path
            Of the new file.
        values
            As `plant` takes them.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RigtwinError
            As `plant` does, or if the file cannot be written.
        """
        tables = calibrated.format_changes(self.machine.plant, self.plant(values))
        head = [f"# from {self.recording.path}, effects as set by hand or fitted"]
        out = keep_apart(path, self.recording.path, *self.machine.files)
        write_whole(out, "\n".join([*head, *tables]) + "\n")
        return Path(path)


def _check(effect: Effect, numbers: Sequence[float]) -> None:
    quantities = effect.quantities()
    if len(numbers) != len(quantities):
        raise RigtwinError(
            f"{effect.name}: expected {len(quantities)} values ({', '.join(quantities)}), "
            f"got {len(numbers)}"
        )
    for (name, quantity), value in zip(quantities.items(), numbers, strict=True):
        if not quantity.low <= value <= quantity.high:
            raise RigtwinError(
                f"{effect.name}: {name} = {value:g}; expected {quantity.low:g} to "
                f"{quantity.high:g} {quantity.unit}"
            )
