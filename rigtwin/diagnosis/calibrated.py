"""The corrected twin as TOML, which `run` and `compare` take with --config: only what differs from the nominal rig."""

from __future__ import annotations

from pathlib import Path

from rigtwin.configuration import Configuration, flattened
from rigtwin.diagnosis.diagnose import Outcome
from rigtwin.errors import RigtwinError


def toml(outcome: Outcome) -> str:
    """The file's text. Values in full precision, so that the twin is the same to the bit."""
    nominal, corrected = flattened(Configuration()), flattened(outcome.corrected)
    lines = [f"# {outcome.diagnosis.verdict}: {outcome.diagnosis.sentence}"]
    lines += [f"# from {recording}" for recording in outcome.diagnosis.recordings]
    for group in outcome.corrected.plant._fields:
        changed = {key: value for key, value in corrected[group].items() if value != nominal[group][key]}
        if changed:
            lines += ["", f"[{group}]", *(f"{key} = {value!r}" for key, value in changed.items())]
    return "\n".join(lines) + "\n"


def save(path: Path, outcome: Outcome) -> None:
    """Writes it. Raises RigtwinError if it cannot, or if the data were not fit for a diagnosis."""
    if outcome.evidence is None:
        raise RigtwinError(f"{path} not written: the data cannot be diagnosed")
    try:
        path.write_text(toml(outcome))
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None
