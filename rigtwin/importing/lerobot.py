"""LeRobot data sets, v2 and v3: a folder with `meta/info.json` and parquet files of episodes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.format import Format
from rigtwin.importing.parquet import read_tables
from rigtwin.importing.selection import Selection

INFO = Path("meta", "info.json")
EPISODE = "episode_index"
"""Column that numbers the episodes."""
TIMESTAMP = "timestamp"
"""Column of the time since the start of the episode, s."""


def read_dataset(path: Path, selection: Selection) -> Columns:
    """Read the needed columns of a data set.

    Parameters
    ----------
    path
        Folder of the data set.
    selection
        Needed columns, such as `observation.state[shoulder_pan.pos]`, and episodes.

    Returns
    -------
    Columns
        Rows of all episodes one after another; of version 2, those of the needed episodes. Items of
        list columns are named as in `meta/info.json`.

    Raises
    ------
    RigtwinError
        If the data set's information or files cannot be read.
    """
    information = _read_information(path / INFO)
    version = str(information.get("codebase_version", "of an unknown version"))
    files = _data_files(path, selection.episodes)
    if not files:
        raise RigtwinError(
            f"{path}: no parquet file in data/; expected a LeRobot data set, v2 or v3"
        )
    names = selection.names
    if names is not None:
        selection = replace(selection, names=names | {EPISODE})
    columns = read_tables(files, selection, _labels(information))
    if EPISODE not in columns.values:
        raise RigtwinError(f"{path}: its files have no column {EPISODE!r}")
    units = dict(columns.units)
    if TIMESTAMP in columns.values:
        units[TIMESTAMP] = "s"
    return replace(columns, units=units, form=f"LeRobot data set {version}", episode=EPISODE)


def _data_files(path: Path, episodes: Sequence[int]) -> list[Path]:
    """Return the data files; of version 2, those of the requested episodes."""
    files = sorted((path / "data").rglob("*.parquet"))
    numbered = {file.stem: file for file in files if file.stem.startswith("episode_")}
    # Version 2 has one file per episode, version 3 many episodes in one file.
    if episodes and len(numbered) == len(files):
        named = [numbered.get(f"episode_{number:06d}") for number in episodes]
        # If a requested episode has no file, all files let the caller list those that exist.
        if None not in named:
            return [file for file in named if file is not None]
    return files


def _read_information(path: Path) -> Mapping[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise RigtwinError(f"{path} is not valid JSON: {error}") from None
    if not isinstance(content, dict):
        raise RigtwinError(f"{path}: expected an object with the data set's features")
    return content


def _labels(information: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the labels of each feature's items: a list, or an object with a list in it."""
    features = information.get("features")
    labels: dict[str, list[str]] = {}
    for name, feature in features.items() if isinstance(features, dict) else ():
        names = feature.get("names") if isinstance(feature, dict) else None
        if isinstance(names, dict):
            # Some data sets group the labels once more: {"motors": ["shoulder", …]}.
            names = next((each for each in names.values() if isinstance(each, list)), None)
        if isinstance(names, list) and all(isinstance(label, str) for label in names):
            labels[name] = names
    return labels


def _is_dataset(folder: Path) -> bool:
    return (folder / INFO).is_file()


FORMAT = Format("LeRobot data set (a folder with meta/info.json)", (), read_dataset, _is_dataset)
