"""JSON: records, or a list a column; and JSON lines."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns, numbers_of
from rigtwin.importing.format import Format
from rigtwin.importing.selection import EVERYTHING, Selection


def read_json(path: Path, _: Selection = EVERYTHING) -> Columns:
    """Read the columns of a JSON file.

    The file is a list of records, an object that contains such a list, an object with one list of
    numbers per column, or one record per line. A record's inner object `{"motor": {"u": 1}}` is
    the column `motor.u`, its inner list `{"q": [1, 2]}` the columns `q:1` and `q:2`. Raises
    RigtwinError for any other content.
    """
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    try:
        if path.suffix.lower() == ".json":
            content = json.loads(text, object_pairs_hook=_once)
        else:
            lines = [line for line in text.splitlines() if line.strip()]
            content = [json.loads(line, object_pairs_hook=_once) for line in lines]
    except (ValueError, RecursionError) as error:
        raise RigtwinError(f"{path} is not valid JSON: {error}") from None
    records = _find_records(content)
    if records is not None:
        return _of_records(records)
    if isinstance(content, Mapping):
        flat = _flatten("", content, lists=False)
        lists = {
            name: value
            for name, value in flat.items()
            # Only lists of plain values are columns; the shorter ones are taken for settings.
            if isinstance(value, list) and value and not isinstance(value[0], list | dict)
        }
        longest = max(map(len, lists.values()), default=0)
        columns = {name: value for name, value in lists.items() if len(value) == longest}
        return _of_cells(columns, "JSON, a list a column", ())
    raise RigtwinError(f"{path}: expected records or lists of numbers; it holds neither")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object. Raises ValueError for a repeated key, which JSON leaves undefined."""
    record = dict(pairs)
    if len(record) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(n for n in names if names.count(n) > 1)!r} is listed twice")
    return record


def _find_records(content: Any) -> Sequence[Mapping[str, Any]] | None:
    """Return the longest list of records in a document; None without one."""
    if isinstance(content, list):
        records = content and all(isinstance(each, Mapping) for each in content)
        return content if records else None
    if isinstance(content, Mapping):
        inner = [records for value in content.values() if (records := _find_records(value))]
        return max(inner, key=len, default=None)
    return None


def _flatten(prefix: str, record: Mapping[str, Any], lists: bool = True) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for name, value in record.items():
        column = f"{prefix}{name}"
        if isinstance(value, Mapping):
            columns |= _flatten(f"{column}.", value, lists)
        elif isinstance(value, list) and lists:
            columns |= {f"{column}:{place}": item for place, item in enumerate(value, start=1)}
        else:
            columns[column] = value
    return columns


def _of_records(records: Sequence[Mapping[str, Any]]) -> Columns:
    flat = [_flatten("", record) for record in records]
    names = list(dict.fromkeys(name for record in flat for name in record))
    short = sum(len(record) < len(names) for record in flat)
    notes = (f"{short} records lack some of the columns",) if short else ()
    cells = {name: [record.get(name) for record in flat] for name in names}
    return _of_cells(cells, "JSON, records", notes)


def _of_cells(cells: Mapping[str, Sequence[Any]], form: str, notes: tuple[str, ...]) -> Columns:
    values, wrong, texts = {}, {}, []
    for name, column in cells.items():
        numbers, bad = numbers_of(["" if each is None else _cell(each) for each in column], ".")
        # Not a single number: a column of words, which is only mentioned.
        if bad is not None and not np.isfinite(numbers).any():
            texts.append(name)
            continue
        values[name] = numbers
        if bad is not None:
            wrong[name] = f"{str(column[bad])[:40]!r} in record {bad + 1}"
    if texts:
        form += f"; text in {', '.join(texts)}"
    return Columns(values, {}, form, notes, wrong)


def _cell(value: Any) -> str:
    # True as text would be a word, while a signal of truth values is 0 and 1.
    return str(float(value)) if isinstance(value, bool) else str(value)


FORMAT = Format("JSON", (".json", ".jsonl", ".ndjson"), read_json)
