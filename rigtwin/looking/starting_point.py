"""Starting point of a look: what the first look suspects, or a diagnosis or an alarm found."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rigtwin.diagnosis.answer import VERDICTS
from rigtwin.errors import RigtwinError
from rigtwin.looking.look import Look
from rigtwin.watching import Alarm


@dataclass(frozen=True)
class StartingPoint:
    """Effects that a look starts with.

    Attributes
    ----------
    sentence
        The diagnosis or alarm in words.
    values
        Values of the effects that have sliders, by name.
    without_slider
        Names of effects that no slider moves, such as a setting.
    confidence
        Confidence of each effect, by name.
    suspects
        Effects that are listed first but are not in the twin, with the values of their sliders.
    """

    sentence: str
    values: Mapping[str, tuple[float, ...]]
    without_slider: tuple[str, ...] = ()
    confidence: Mapping[str, float] = field(default_factory=dict)
    suspects: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def from_first_look(look: Look) -> StartingPoint:
    """Return the suspects of the first look as a starting point.

    Parameters
    ----------
    look
        Look at a recording.

    Returns
    -------
    StartingPoint
        Suspects with the best values that were tried, and no effect in the twin.
    """
    return StartingPoint(f"first look: {look.first_look}", {}, suspects=look.suspects)


def from_alarm(alarm: Alarm, look: Look) -> StartingPoint:
    """Return the likeliest suspect of an alarm as a starting point.

    Parameters
    ----------
    alarm
        Alarm of a test.
    look
        Look at the recording of the test.

    Returns
    -------
    StartingPoint
        The likeliest effect; no effect if there are no suspects.
    """
    # Suspects are rivals, not parts of one explanation, so only the first is shown.
    likeliest = {s.effect: s for s in alarm.suspects[:1] if s.effect in look.effects}
    return StartingPoint(
        str(alarm),
        {
            name: tuple(suspect.values[key] for key in look.effects[name].kind.parameters)
            for name, suspect in likeliest.items()
        },
        (),
        {name: suspect.probability for name, suspect in likeliest.items()},
    )


def read_diagnosis(path: str | Path, look: Look) -> StartingPoint:
    """Read the JSON of `rigtwin diagnose --json` as a starting point.

    Parameters
    ----------
    path
        Path of the JSON file.
    look
        Look at one of the diagnosed recordings.

    Returns
    -------
    StartingPoint
        Effects of the diagnosis.

    Raises
    ------
    RigtwinError
        If the file cannot be read, is no diagnosis, or belongs to other recordings or to another
        machine.
    """
    return from_document(_read_document(path), look, str(path))


def from_document(document: Mapping[str, Any], look: Look, path: str) -> StartingPoint:
    """Return the JSON document of a diagnosis as a starting point.

    Parameters
    ----------
    document
        JSON document, see `Diagnosis.document`.
    look
        Look at one of the diagnosed recordings.
    path
        Path of the document, for messages.

    Returns
    -------
    StartingPoint
        Effects of the diagnosis.

    Raises
    ------
    RigtwinError
        If the document is no diagnosis, or belongs to other recordings or to another machine.
    """
    try:
        machine, recordings = str(document["machine"]), [str(r) for r in document["recordings"]]
        sentence = str(document["sentence"])
        findings = [_finding(entry) for entry in document["effects"]]
        if document["verdict"] not in VERDICTS:
            raise ValueError
    except (KeyError, TypeError, ValueError, AttributeError):
        raise RigtwinError(f"{path}: expected the JSON of rigtwin diagnose --json") from None
    if machine != look.machine.name:
        raise RigtwinError(
            f"{path} is a diagnosis of {machine}; the recording is of {look.machine.name}"
        )
    # Only names are compared: the recordings may have been moved since the diagnosis.
    name = look.recording.path.name
    if name not in {Path(recording).name for recording in recordings}:
        raise RigtwinError(
            f"{path} is a diagnosis of {', '.join(recordings) or 'no recording'}; expected {name}"
        )
    possible = {effect.name for effect in look.machine.effects()}
    for effect, _, _ in findings:
        # Findings on the controller's settings are no effects of the machine, but valid.
        if effect not in possible and not effect.endswith("@controller"):
            raise RigtwinError(f"{path}: {machine} can have no {effect}")
    values = {
        effect: tuple(parameters[key] for key in look.effects[effect].kind.parameters)
        for effect, parameters, _ in findings
        if effect in look.effects and set(look.effects[effect].kind.parameters) <= set(parameters)
    }
    # Raises an error for values out of bounds.
    look.plant(values)
    return StartingPoint(
        f"the diagnosis: {sentence}",
        values,
        tuple(effect for effect, _, _ in findings if effect not in values),
        {effect: confidence for effect, _, confidence in findings},
    )


def _read_document(path: str | Path) -> Any:
    try:
        return json.loads(Path(path).read_text())
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise RigtwinError(f"{path}: expected the JSON of rigtwin diagnose --json") from None


def _finding(entry: Mapping[str, Any]) -> tuple[str, dict[str, float], float]:
    """Return name, parameters and confidence of an effect."""
    parameters = entry["parameters"].items()
    values = {str(name): float(parameter["value"]) for name, parameter in parameters}
    return f"{entry['kind']}@{entry['component']}", values, float(entry["confidence"])
