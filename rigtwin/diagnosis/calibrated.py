"""Corrected twin as TOML, which `run` and `compare` take with `--config`.

The file holds only the values that differ from the described machine, and how uncertain they are.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.components.effect import GROUPS
from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.description.posterior import Alternative, Posterior, format_toml
from rigtwin.description.settings import Nothing
from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.fit import Fit
from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write, printable

if TYPE_CHECKING:
    from rigtwin.diagnosis.result import Diagnosis


def toml(diagnosis: Diagnosis) -> str:
    """Write the corrected twin as TOML text.

    Parameters
    ----------
    diagnosis
        Diagnosis with a corrected twin.

    Returns
    -------
    str
        TOML with the answer as a comment, the changed values, and their posterior.
    """
    answer = diagnosis.answer
    # A file name may hold a line break, which would end the comment: hence `printable`.
    lines = [f"# {answer.verdict}: {answer.sentence}"]
    lines += [f"# from {printable(str(recording))}" for recording in answer.recordings]
    lines += [
        f"# the controller's {setting}"
        for setting in map(_describe_setting, answer.effects)
        if setting
    ]
    lines += format_changes(diagnosis.described.plant, diagnosis.machine.plant)
    described, corrected = diagnosis.described, diagnosis.machine
    # A friction compensator, for example, is set from the corrected friction.
    if advice := described.physics.advise_controller(described.plant, corrected.plant):
        lines += ["", "[controller]", *(f"{name} = {value!r}" for name, value in advice.items())]
    if answer.effects:
        lines += ["", *format_toml(_posterior(diagnosis))]
    return "\n".join(lines) + "\n"


def format_changes(described: Plant, corrected: Plant) -> list[str]:
    """Write the values in which a corrected plant differs from the described one.

    Parameters
    ----------
    described, corrected
        Plants of one machine.

    Returns
    -------
    list of str
        Lines of TOML, with one table for each component that differs.
    """
    nominal = flatten(Configuration(plant=described, controller=Nothing()))
    changed = flatten(Configuration(plant=corrected, controller=Nothing()))
    lines: list[str] = []
    for group in described._fields:
        differing = {
            key: value for key, value in changed[group].items() if value != nominal[group][key]
        }
        if differing:
            # `repr` writes a float in full precision, so the loaded twin is equal to the bit.
            lines += ["", f"[{group}]", *(f"{key} = {value!r}" for key, value in differing.items())]
    return lines


def _posterior(diagnosis: Diagnosis) -> Posterior:
    """Intervals of the corrected values, and the other explanations with their probability."""
    intervals = {
        f"{GROUPS.get(effect.name.component, effect.name.component)}.{name}": (
            estimate.low,
            estimate.high,
        )
        for effect in diagnosis.effects
        # A setting belongs to the controller, and "unknown" has no value: neither is in the plant.
        if effect.name.kind not in ("setting", "unknown")
        for name, estimate in effect.parameters.items()
    }
    # The corrected twin needs all its corrections at once, so it is as certain as the least certain
    # one.
    confidence = min(effect.confidence for effect in diagnosis.effects)
    return Posterior(
        {},
        intervals,
        confidence,
        tuple(_alternative(fit, probability) for fit, probability in diagnosis.otherwise),
    )


def _alternative(fit: Fit, probability: float) -> Alternative:
    """Other explanation as changes of the plant, by component."""
    # Two effects of one component share its table.
    changes: dict[str, dict[str, object]] = {}
    for effect, values in zip(fit.effects, fit.values, strict=True):
        changes.setdefault(effect.group, {}).update(
            zip(effect.kind.parameters, values, strict=True)
        )
    return Alternative(fit.name, probability, changes)


def _describe_setting(effect: Finding) -> str:
    """Describe a controller setting that deviates from the recording; the operator corrects it."""
    if effect.name.kind != "setting":
        return ""
    return ", ".join(
        f"{name} was {estimate.value:g}, configured as {estimate.nominal:g}"
        for name, estimate in effect.parameters.items()
    )


def save(path: Path, diagnosis: Diagnosis) -> Path:
    """Write the corrected twin to a file.

    Parameters
    ----------
    path
        File to be written.
    diagnosis
        Diagnosis with a corrected twin.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    RigtwinError
        If the recordings could not be diagnosed, or the file cannot be written.
    """
    if diagnosis.evidence is None:
        raise RigtwinError(
            f"{path} not written: the recordings cannot be diagnosed, so there is no corrected twin"
        )
    atomic_write(path, toml(diagnosis))
    return path
