"""The corrected twin as TOML, which `run` and `compare` take with --config: only what differs from the nominal machine."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rigtwin.diagnosis.diagnose import Outcome
from rigtwin.diagnosis.finding import Finding
from rigtwin.diagnosis.fit import Fit
from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import Configuration, flattened
from rigtwin.machine.effects import NAMES
from rigtwin.machine.posterior import Otherwise, Posterior, written

GROUPS = {component: group for group, component in NAMES.items()}
"""What a component is called among the parameters, where that is not its name in effects."""


def toml(outcome: Outcome) -> str:
    """The file's text. Values in full precision, so that the twin is the same to the bit."""
    assert outcome.evidence is not None
    lines = [f"# {outcome.diagnosis.verdict}: {outcome.diagnosis.sentence}"]
    lines += [f"# from {recording}" for recording in outcome.diagnosis.recordings]
    lines += [f"# the controller's {each}" for each in map(_told, outcome.diagnosis.effects) if each]
    nominal, corrected = _values(outcome, outcome.evidence.machine.plant), _values(outcome, outcome.corrected.plant)
    for effect in outcome.diagnosis.effects:
        if effect.name.component == "controller" and effect.name.kind in corrected.get("computer", {}):
            # What the computer does late or not at all belongs to the twin as the plant's defects do.
            corrected["computer"] = {
                **corrected["computer"],
                **{name: each.value for name, each in effect.parameters.items()},
            }
    for group in corrected:
        changed = {key: value for key, value in corrected[group].items() if value != nominal[group][key]}
        if changed:
            lines += ["", f"[{group}]", *(f"{key} = {value!r}" for key, value in changed.items())]
    if isinstance(outcome.corrected, Configuration) and outcome.diagnosis.effects:
        lines += ["", *written(_posterior(outcome))]
    return "\n".join(lines) + "\n"


def _posterior(outcome: Outcome) -> Posterior:
    """How sure the values are, and what else would explain the recordings."""
    intervals = {
        f"{GROUPS.get(effect.name.component, effect.name.component)}.{name}": (each.low, each.high)
        for effect in outcome.diagnosis.effects
        if effect.name.kind not in ("setting", "unknown")
        for name, each in effect.parameters.items()
    }
    sure = min(effect.confidence for effect in outcome.diagnosis.effects)
    return Posterior({}, intervals, sure, tuple(_otherwise(fit, probability) for fit, probability in outcome.otherwise))


def _otherwise(fit: Fit, probability: float) -> Otherwise:
    changes: dict[str, dict[str, object]] = {}
    for effect, values in zip(fit.effects, fit.values, strict=True):
        changes.setdefault(effect.group, {}).update(zip(effect.kind.parameters, values, strict=True))
    return Otherwise(fit.name, probability, changes)


def _told(effect: Finding) -> str:
    """A setting that is not what the recording says, which is the operator's to change."""
    if effect.name.kind != "setting":
        return ""
    return ", ".join(f"{name} was {each.value:g}, told {each.nominal:g}" for name, each in effect.parameters.items())


def _values(outcome: Outcome, plant: object) -> dict[str, dict[str, float | str]]:
    """Component → parameter → value of a plant."""
    if isinstance(outcome.corrected, Configuration):
        every = flattened(outcome.corrected._replace(plant=plant))  # type: ignore[arg-type]
        return {group: every[group] for group in outcome.corrected.plant._fields}
    groups: Mapping[str, object] = plant._asdict()  # type: ignore[attr-defined]
    return {name: {key: float(v) for key, v in part._asdict().items()} for name, part in groups.items()}  # type: ignore[attr-defined]


def save(path: Path, outcome: Outcome) -> None:
    """Writes it. Raises RigtwinError if it cannot, or if the data were not fit for a diagnosis."""
    if outcome.evidence is None:
        raise RigtwinError(f"{path} not written: the data cannot be diagnosed")
    try:
        path.write_text(toml(outcome), encoding="utf-8")
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None
