"""Result of a diagnosis: the answer, the evidence that its pictures are drawn from, the twin."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rigtwin.components.effect import GROUPS
from rigtwin.components.plant import select, with_parameters
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.mjcf import Change, write_mjcf
from rigtwin.diagnosis import calibrated, report, text
from rigtwin.diagnosis.answer import Answer, Verdict
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Finding, Place
from rigtwin.diagnosis.fit import Fit
from rigtwin.diagnosis.gap import Gap
from rigtwin.diagnosis.overlay import Overlay, overlay
from rigtwin.diagnosis.picture import Picture
from rigtwin.diagnosis.pictures import picture
from rigtwin.files import forbid_overwriting


@dataclass(frozen=True)
class Diagnosis:
    """Why recordings of a machine and its twin disagree.

    A notebook shows the report.

    Attributes
    ----------
    answer
        Verdict, findings and figures.
    described
        Machine as described.
    evidence
        Recordings that were fitted. None where they cannot be diagnosed.
    corrected
        Settings of the first recording with the corrected plant.
    otherwise
        Other explanations that remain possible, with their probability, the likeliest first.
    held_out
        Recordings that judged the correction. None without any.
    """

    answer: Answer
    described: Machine
    evidence: Evidence | None = field(repr=False)
    corrected: Configuration = field(repr=False)
    otherwise: tuple[tuple[Fit, float], ...] = field(default=(), repr=False)
    held_out: Evidence | None = field(default=None, repr=False)

    @property
    def verdict(self) -> Verdict:
        """Verdict: no gap, explained, partly explained, unknown or unusable."""
        return self.answer.verdict

    @property
    def sentence(self) -> str:
        """Answer on one line."""
        return self.answer.sentence

    @property
    def effects(self) -> tuple[Finding, ...]:
        """Named effects, with values, intervals, confidence and rivals."""
        return self.answer.effects

    @property
    def where(self) -> tuple[Place, ...]:
        """Locations of the gap, the largest share first."""
        return self.answer.where

    @property
    def gap(self) -> Gap | None:
        """Gap before and after the correction. None where the data cannot be diagnosed."""
        return self.answer.gap

    @property
    def machine(self) -> Machine:
        """Described machine with the corrected values of plant, sensors and computer."""
        plant = self.corrected.plant
        for effect in self.effects:
            group = GROUPS.get(effect.name.component, "")
            if not group:
                continue
            (component,) = select(plant, [group])
            if all(name in component._fields for name in effect.parameters):
                # Delays and missed ticks of the computer are read off the controller's commands, so
                # `corrected` lacks them; the twin needs them as much as the plant's defects.
                values = {name: estimate.value for name, estimate in effect.parameters.items()}
                plant = with_parameters(plant, group, values)
        return replace(self.described, plant=plant)

    @property
    def _inputs(self) -> tuple[Path, ...]:
        """Files that the diagnosis was made of; none of its outputs may overwrite them."""
        recordings = [Path(name) for name in self.answer.recordings]
        if self.held_out is not None:
            recordings += [recording.path for recording in self.held_out.recordings]
        return (*recordings, *self.described.files)

    def document(self) -> dict[str, Any]:
        """Return the answer as the JSON document that keeps to `answer.schema.json`."""
        return self.answer.document()

    def overlays(self) -> tuple[Overlay, ...]:
        """Return every observed sensor as measured, nominal and corrected.

        Returns
        -------
        tuple of Overlay
            Held-out recordings first. Empty where the data cannot be diagnosed.
        """
        if self.evidence is None:
            return ()
        return overlay(self.evidence, self.corrected.plant, self.held_out)

    def pictures(self) -> tuple[Picture, ...]:
        """Return the picture that shows each named effect in the data.

        Returns
        -------
        tuple of Picture
            One picture per effect, of held-out recordings if there are any. Empty where the data
            cannot be diagnosed.
        """
        # What the correction was not fitted to is the stronger demonstration.
        shown = self.held_out or self.evidence
        if shown is None:
            return ()
        return tuple(picture(shown, self.corrected.plant, effect) for effect in self.effects)

    def report(self, path: str | Path) -> Path:
        """Write the report to one file.

        Parameters
        ----------
        path
            File to be written. A name that ends in .pdf or .png is printed by Chrome, Chromium or
            Edge; every other one is HTML.

        Returns
        -------
        Path
            The path.

        Raises
        ------
        RigtwinError
            If the file cannot be written, or no browser is installed to print it.
        """
        return report.write(forbid_overwriting(path, *self._inputs), self)

    def save_twin(self, path: str | Path) -> Path:
        """Write the corrected twin as TOML, for `--config`.

        Parameters
        ----------
        path
            File to be written.

        Returns
        -------
        Path
            The path.

        Raises
        ------
        RigtwinError
            If the recordings could not be diagnosed, or the file cannot be written.
        """
        return calibrated.save(forbid_overwriting(path, *self._inputs), self)

    def save_mjcf(self, path: str | Path) -> tuple[str, ...]:
        """Write the machine's MJCF with the corrected values and nothing else changed.

        Parameters
        ----------
        path
            File to be written. MuJoCo looks for meshes and included files beside it.

        Returns
        -------
        tuple of str
            Corrections that MJCF has no attribute for, such as a lag or a play, one line each.

        Raises
        ------
        RigtwinError
            If the model is a URDF, or the file cannot be written.
        """
        changes = [
            Change(effect.name.component, name, estimate.value)
            for effect in self.effects
            for name, estimate in effect.parameters.items()
        ]
        return write_mjcf(forbid_overwriting(path, *self._inputs), self.described, changes)

    def __str__(self) -> str:
        return text.describe(self.answer)

    def _repr_html_(self) -> str:
        return report.html(self)
