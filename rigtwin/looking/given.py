"""What a diagnosis found, as its JSON has it: where a look begins."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigtwin.diagnosis.finding import VERDICTS
from rigtwin.errors import RigtwinError
from rigtwin.looking.look import Look
from rigtwin.watching import Alarm


@dataclass(frozen=True)
class Given:
    """What was found. sentence: as it is told; values: of the effects that can be moved, by name;
    beside: those that were found and cannot be, such as a setting; confidence: of each effect, by
    name."""

    sentence: str
    values: Mapping[str, tuple[float, ...]]
    beside: tuple[str, ...]
    confidence: Mapping[str, float]


def take_alarm(alarm: Alarm, look: Look) -> Given:
    """What a watch suspects most.

    Parameters
    ----------
    alarm
        Of a test.
    look
        Of the test's recording.

    Returns
    -------
    Given
        The likeliest effect; none if there was none.
    """
    likeliest = {each.effect: each for each in alarm.suspects[:1] if each.effect in look.effects}
    return Given(
        str(alarm),
        {
            name: tuple(each.values[key] for key in look.effects[name].kind.parameters)
            for name, each in likeliest.items()
        },
        (),
        {name: each.probability for name, each in likeliest.items()},
    )


def read_answer(path: str | Path, look: Look) -> Given:
    """Reads what `rigtwin diagnose --json` wrote.

    Parameters
    ----------
    path
        The file.
    look
        Of a recording that was diagnosed.

    Returns
    -------
    Given
        The effects that were found.

    Raises
    ------
    RigtwinError
        If it cannot be read, is no diagnosis, or is one of other recordings or another machine.
    """
    try:
        document = json.loads(Path(path).read_text())
    except OSError as error:
        raise RigtwinError(f"cannot read {path}: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise RigtwinError(f"{path}: expected the JSON of rigtwin diagnose --json") from None
    try:
        machine, recordings = str(document["machine"]), [str(r) for r in document["recordings"]]
        sentence = str(document["sentence"])
        found = [_finding(each) for each in document["effects"]]
        if document["verdict"] not in VERDICTS:
            raise ValueError
    except (KeyError, TypeError, ValueError, AttributeError):
        raise RigtwinError(f"{path}: expected the JSON of rigtwin diagnose --json") from None
    if machine != look.machine.name:
        raise RigtwinError(
            f"{path} is a diagnosis of {machine}; the recording is of {look.machine.name}"
        )
    name = look.recording.path.name
    if name not in {Path(each).name for each in recordings}:
        raise RigtwinError(
            f"{path} is a diagnosis of {', '.join(recordings) or 'no recording'}; expected {name}"
        )
    possible = {each.name for each in look.machine.effects()}
    for effect, _, _ in found:
        if effect not in possible and not effect.endswith("@controller"):
            raise RigtwinError(f"{path}: {machine} can have no {effect}")
    values = {
        effect: tuple(of[each] for each in look.effects[effect].kind.parameters)
        for effect, of, _ in found
        if effect in look.effects and set(look.effects[effect].kind.parameters) <= set(of)
    }
    look.plant(values)
    return Given(
        f"the diagnosis: {sentence}",
        values,
        tuple(effect for effect, _, _ in found if effect not in values),
        {effect: sure for effect, _, sure in found},
    )


def _finding(entry: Mapping[str, Any]) -> tuple[str, dict[str, float], float]:
    """Name, parameters and confidence of an effect."""
    values = {str(name): float(each["value"]) for name, each in entry["parameters"].items()}
    return f"{entry['kind']}@{entry['component']}", values, float(entry["confidence"])
