"""A diagnosis: the answer, what pictures of it are drawn from, and the corrected twin."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rigtwin.components import with_parameters
from rigtwin.components.effect import GROUPS
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.mjcf import Change, write_mjcf
from rigtwin.diagnosis import calibrated, report, text
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Answer, Finding, Gap, Place, Verdict
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.overlay import Overlay, overlay
from rigtwin.diagnosis.pictures import Picture, picture
from rigtwin.files import forbid_overwriting


@dataclass(frozen=True)
class Diagnosis:
    """Why recordings of a machine and its twin disagree.

    answer: all that is said; described: the machine as described; evidence: None where the data
    cannot be diagnosed; corrected: the twin of the first recording with what was found; otherwise:
    other explanations that are not out of the question, with their probability; held_out: the
    recordings that the correction was judged on, None without any. In a notebook it shows its
    report.
    """

    answer: Answer
    described: Machine
    evidence: Evidence | None = field(repr=False)
    corrected: Configuration = field(repr=False)
    otherwise: tuple[tuple[Fit, float], ...] = field(default=(), repr=False)
    held_out: Evidence | None = field(default=None, repr=False)

    @property
    def verdict(self) -> Verdict:
        """no gap, explained, partly explained, unknown or unusable."""
        return self.answer.verdict

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        return self.answer.sentence

    @property
    def effects(self) -> tuple[Finding, ...]:
        """The effects that are named, with magnitude, interval, confidence and class."""
        return self.answer.effects

    @property
    def where(self) -> tuple[Place, ...]:
        """Where the gap lies."""
        return self.answer.where

    @property
    def gap(self) -> Gap | None:
        """The gap before and after the correction; None where the data cannot be diagnosed."""
        return self.answer.gap

    @property
    def machine(self) -> Machine:
        """The corrected machine: the described one with what was found of plant, sensors and
        computer."""
        plant = self.corrected.plant
        for effect in self.effects:
            group = GROUPS.get(effect.name.component, "")
            if group and all(name in getattr(plant, group)._fields for name in effect.parameters):
                # What the computer does late or not at all belongs to the twin as the plant's
                # defects do.
                plant = with_parameters(
                    plant, group, {name: each.value for name, each in effect.parameters.items()}
                )
        return replace(self.described, plant=plant)

    @property
    def _inputs(self) -> tuple[Path, ...]:
        """The files that it was made of."""
        recordings = [Path(each) for each in self.answer.recordings]
        if self.held_out is not None:
            recordings += [each.path for each in self.held_out.recordings]
        return (*recordings, *self.described.files)

    def document(self) -> dict[str, Any]:
        """The answer as JSON has it."""
        return self.answer.document()

    def overlays(self) -> tuple[Overlay, ...]:
        """Every observed sensor as measured, as nominal and as corrected, held-out recordings
        first; empty where the data cannot be diagnosed."""
        if self.evidence is None:
            return ()
        return overlay(self.evidence, self.corrected.plant, self.held_out)

    def pictures(self) -> tuple[Picture, ...]:
        """For each effect that is named, the numbers of the picture that shows it in the data, in
        held-out recordings if there are any."""
        shown = self.held_out or self.evidence
        if shown is None:
            return ()
        return tuple(picture(shown, self.corrected.plant, effect) for effect in self.effects)

    def report(self, path: str | Path) -> Path:
        """Writes the report, one file.

        Parameters
        ----------
        path
            PDF or PNG if its name ends so, printed by Chrome, Chromium or Edge; HTML otherwise.

        Returns
        -------
        Path
            The same.

        Raises
        ------
        RigtwinError
            If it cannot be written, or no browser is there to print it.
        """
        return report.write(forbid_overwriting(path, *self._inputs), self)

    def save_twin(self, path: str | Path) -> Path:
        """Writes the corrected twin as TOML, for `--config`. Raises RigtwinError if it cannot be
        written, or if the data were not fit for a diagnosis."""
        return calibrated.save(forbid_overwriting(path, *self._inputs), self)

    def save_mjcf(self, path: str | Path) -> tuple[str, ...]:
        """Writes the machine's own MJCF with the corrected values and nothing else changed.

        Parameters
        ----------
        path
            Of the new file. Meshes and included files are looked for beside it.

        Returns
        -------
        tuple of str
            The corrections that MJCF has no attribute for, such as a lag or a play, a line each.

        Raises
        ------
        RigtwinError
            If the model is a URDF, or the file cannot be written.
        """
        changes = [
            Change(effect.name.component, name, each.value)
            for effect in self.effects
            for name, each in effect.parameters.items()
        ]
        return write_mjcf(forbid_overwriting(path, *self._inputs), self.described, changes)

    def __str__(self) -> str:
        return text.describe(self.answer)

    def _repr_html_(self) -> str:
        return report.html(self)
