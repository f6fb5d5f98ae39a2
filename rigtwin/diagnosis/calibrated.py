"""The corrected twin as TOML, which `run` and `compare` take with --config: only what differs from
the nominal machine."""

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
    """The file's text. Values in full precision, so that the twin is the same to the bit."""
    answer = diagnosis.answer
    lines = [f"# {answer.verdict}: {answer.sentence}"]
    lines += [f"# from {printable(str(recording))}" for recording in answer.recordings]
    lines += [
        f"# the controller's {each}" for each in map(_describe_setting, answer.effects) if each
    ]
    lines += format_changes(diagnosis.described.plant, diagnosis.machine.plant)
    described, corrected = diagnosis.described, diagnosis.machine
    if advice := described.physics.advise_controller(described.plant, corrected.plant):
        lines += ["", "[controller]", *(f"{name} = {value!r}" for name, value in advice.items())]
    if answer.effects:
        lines += ["", *format_toml(_posterior(diagnosis))]
    return "\n".join(lines) + "\n"


def format_changes(described: Plant, corrected: Plant) -> list[str]:
    """What a corrected plant has other than the described one.

    Parameters
    ----------
    described, corrected
        Of one machine.

    Returns
    -------
    list of str
        TOML, a line each, one table a component that differs.
    """
    nominal = flatten(Configuration(plant=described, controller=Nothing()))
    changed = flatten(Configuration(plant=corrected, controller=Nothing()))
    lines: list[str] = []
    for group in described._fields:
        own = {key: value for key, value in changed[group].items() if value != nominal[group][key]}
        if own:
            lines += ["", f"[{group}]", *(f"{key} = {value!r}" for key, value in own.items())]
    return lines


def _posterior(diagnosis: Diagnosis) -> Posterior:
    """How sure the values are, and what else would explain the recordings."""
    intervals = {
        f"{GROUPS.get(effect.name.component, effect.name.component)}.{name}": (each.low, each.high)
        for effect in diagnosis.effects
        if effect.name.kind not in ("setting", "unknown")
        for name, each in effect.parameters.items()
    }
    sure = min(effect.confidence for effect in diagnosis.effects)
    return Posterior(
        {},
        intervals,
        sure,
        tuple(_otherwise(fit, probability) for fit, probability in diagnosis.otherwise),
    )


def _otherwise(fit: Fit, probability: float) -> Alternative:
    changes: dict[str, dict[str, object]] = {}
    for effect, values in zip(fit.effects, fit.values, strict=True):
        changes.setdefault(effect.group, {}).update(
            zip(effect.kind.parameters, values, strict=True)
        )
    return Alternative(fit.name, probability, changes)


def _describe_setting(effect: Finding) -> str:
    """A setting that is not what the recording says, which is the operator's to change."""
    if effect.name.kind != "setting":
        return ""
    return ", ".join(
        f"{name} was {each.value:g}, told {each.nominal:g}"
        for name, each in effect.parameters.items()
    )


def save(path: Path, diagnosis: Diagnosis) -> Path:
    """Writes it. Raises RigtwinError if it cannot, or if the data were not fit for a diagnosis."""
    if diagnosis.evidence is None:
        raise RigtwinError(f"{path} not written: the data cannot be diagnosed")
    atomic_write(path, toml(diagnosis))
    return path
