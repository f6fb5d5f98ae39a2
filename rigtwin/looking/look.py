"""One recording beside its twin, whose candidate effects can be changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from rigtwin.components import Effect
from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis import calibrated
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.effect_fit import EffectFit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.first_look import FirstLook, look_first
from rigtwin.diagnosis.fit import clashes, with_values
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.known_effects import find_effects, fit_effects
from rigtwin.diagnosis.prices import Prices
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.diagnosis.thresholds import STANDARD
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write, forbid_overwriting
from rigtwin.looking.look_checks import check_look
from rigtwin.looking.motions import find_positions, predicts_motion
from rigtwin.looking.prediction import Prediction, judge
from rigtwin.looking.slider import Slider, sliders_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest


class Look:
    """A recording, its twin, and the effects that the twin may lack.

    Values of an effect are one number per parameter, in the order of its sliders.

    Attributes
    ----------
    effects
        Candidate effects by name.
    sliders
        Sliders of each effect, one per parameter.
    time
        Times in s, shape (ticks,).
    measured
        Measured signals in the model's band, without the mains line, shape (sensors, ticks).
    nominal
        Prediction of the twin without effects.
    """

    def __init__(
        self, machine: Machine, recording: RecordedTest, base: Configuration | None = None
    ) -> None:
        """Prepare the model of a recording.

        Parameters
        ----------
        machine
            Machine the recording belongs to.
        recording
            Recording to look at.
        base
            Configuration of the twin. Defaults to the described one.

        Raises
        ------
        RigtwinError
            If the data make a comparison meaningless; the message names every fault.
        """
        configuration = machine.configuration_of(recording, base)
        # Faults of the data are reported before the model is built, which takes seconds.
        require_fit(machine, recording, configuration)
        self.machine, self.recording, self._base = machine, recording, base
        # The same evidence as a diagnosis: its band, its weights and its noise.
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
        """Units of the observed signals."""
        return tuple(row.unit for row in self.machine.rows)

    @cached_property
    def first_look(self) -> FirstLook:
        """Gap of each sensor, and the effects that may cause it; takes a second or two."""
        return self._screening[0]

    @cached_property
    def suspects(self) -> dict[str, tuple[float, ...]]:
        """Effects that may cause the gap, the likeliest first, at the best values tried."""
        first, best = self._screening
        return {str(name): best[str(name)] for name, _ in first.suspects}

    @cached_property
    def _screening(self) -> tuple[FirstLook, dict[str, tuple[float, ...]]]:
        """First look, and the best value that was tried of each effect."""
        coarse = Fitter(self._evidence.thin().halve_steps())
        screened = [coarse.screen(effect) for effect in self.effects.values()]
        # As a diagnosis of data that noise and declared error explain: before any fit, no
        # discrepancy is known.
        samples = 0.5 * self._evidence.expected
        prices = Prices(coarse, STANDARD, len(screened), samples, len(self.sensors), 0.0)
        # Prices are in nats; a chi-square is twice as large.
        first = look_first(coarse, screened, 2.0 * prices.ordinary, STANDARD)
        return first, {each.effect.name: each.starts[0][1] for each in screened}

    @property
    def predicts_motion(self) -> bool:
        """Whether any observed signal is a motion; otherwise the twin moves as measured."""
        return predicts_motion(self.machine)

    def positions(self, prediction: Prediction | None = None) -> dict[str, Array]:
        """Return the positions of the joints.

        Parameters
        ----------
        prediction
            Prediction of a twin. Defaults to the machine itself, as measured.

        Returns
        -------
        dict of Array
            Joint → position, in m or rad, shape (ticks,). Joints without a signal are left out.
        """
        signals = None if prediction is None else prediction.signals
        return find_positions(self.machine, self.recording, self._evidence.lines[0].period, signals)

    def clashing(self, name: str, names: Iterable[str]) -> tuple[str, ...]:
        """Return the effects that set a parameter which this effect sets too.

        Parameters
        ----------
        name
            Name of the effect.
        names
            Names of the effects to compare with.

        Returns
        -------
        tuple of str
            Names of the effects that exclude this one.

        Raises
        ------
        RigtwinError
            If an effect is unknown.
        """
        effect = self._find(name)
        return tuple(rival for rival in names if clashes(effect, [self._find(rival)]))

    def _sliders(self, effect: Effect) -> tuple[Slider, ...]:
        # The slider has the bounds of the fit, so that a fitted value always has a position.
        low, high = self._fitter.bounds((effect,))
        return sliders_of(
            effect,
            self._evidence.plant,
            self._fitter.starts(effect).values,
            list(zip(low.tolist(), high.tolist(), strict=True)),
            [
                self.machine.unit(effect.group, quantity)
                for quantity in effect.quantities().values()
            ],
        )

    def _find(self, name: str) -> Effect:
        if name not in self.effects:
            raise RigtwinError(f"unknown effect {name!r}; expected {', '.join(self.effects)}")
        return self.effects[name]

    def plant(self, values: Mapping[str, Sequence[float]]) -> Plant:
        """Return the twin's plant with effects.

        Parameters
        ----------
        values
            Values of the effects by name.

        Returns
        -------
        Plant
            Parameters of the twin with these effects.

        Raises
        ------
        RigtwinError
            If an effect is unknown, two effects set the same parameter, or values are too many,
            too few or out of bounds.
        """
        effects = find_effects(self.machine, tuple(values))
        for effect, numbers in zip(effects, values.values(), strict=True):
            check_look(effect, numbers)
        return with_values(self._evidence.plant, effects, list(values.values()))

    def predict(self, values: Mapping[str, Sequence[float]]) -> Prediction:
        """Predict the recording with effects, and return the prediction with its errors.

        Parameters
        ----------
        values
            Values of the effects by name.

        Returns
        -------
        Prediction
            Prediction of the whole recording.

        Raises
        ------
        RigtwinError
            As `plant` does.
        """
        # One recording, so one prediction.
        signals = self._evidence.predict(self.plant(values))[0]
        return judge(self.sensors, self._evidence.lines[0], signals)

    def fit(self, names: Sequence[str]) -> EffectFit:
        """Fit the values of effects to the recording, as `rigtwin.fit` does.

        Parameters
        ----------
        names
            Names of one or more effects that are fitted together.

        Returns
        -------
        EffectFit
            Values, intervals, and reasons to doubt them.

        Raises
        ------
        RigtwinError
            If no effect is named, one is unknown, or two set the same parameter.
        """
        return fit_effects(self._evidence, find_effects(self.machine, names))

    def diagnose(
        self, progress: Callable[[str, int], object] = lambda _stage, _steps: None
    ) -> Diagnosis:
        """Diagnose the recording, as `rigtwin.diagnose` does without held-out recordings.

        Parameters
        ----------
        progress
            Function called with the name of a stage and the number of steps since its last call.

        Returns
        -------
        Diagnosis
            The answer, and the corrected twin.
        """
        return diagnose(self.machine, [self.recording], self._base, progress=progress)

    def save(self, path: str | Path, values: Mapping[str, Sequence[float]]) -> Path:
        """Write the twin with effects as TOML, for `--config`.

        Parameters
        ----------
        path
            Path of the new file.
        values
            Values of the effects by name.

        Returns
        -------
        Path
            Path of the file.

        Raises
        ------
        RigtwinError
            As `plant` does, or if the file cannot be written.
        """
        tables = calibrated.format_changes(self.machine.plant, self.plant(values))
        head = [f"# from {self.recording.path}, effects as set by hand or fitted"]
        out = forbid_overwriting(path, self.recording.path, *self.machine.files)
        atomic_write(out, "\n".join([*head, *tables]) + "\n")
        return Path(path)
