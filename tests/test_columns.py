"""Messages that are read all at once are those that are read one by one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Channel

from rigtwin.errors import RigtwinError
from rigtwin.recording.columns import decode_columns

CHANNEL = Channel(id=1, topic="/odd", message_encoding="json", metadata={}, schema_id=0)


def columns(data: list[bytes]) -> dict[str, list[float]]:
    return {
        name: values.tolist()
        for name, values in decode_columns(Path("f.mcap"), CHANNEL, None, data, []).items()
    }


def one_by_one(data: list[bytes]) -> str:
    """What is said of the first message that is no object; nothing if all are."""
    for number, message in enumerate(data):
        try:
            if isinstance(json.loads(message), dict):
                continue
        except ValueError:
            pass
        return f"message {number} on /odd cannot be read"
    return ""


def test_columns_are_the_numbers_of_the_messages() -> None:
    rows = [{"a": n, "b": 0.1 * n, "word": "x"} for n in range(50)]
    decoded = columns([json.dumps(row).encode() for row in rows])
    assert decoded == {"a": [row["a"] for row in rows], "b": [row["b"] for row in rows]}


@pytest.mark.parametrize(
    "pair",
    [
        (b'{"a": 1}, {"a": 2}', b'{"a": 3}'),
        (b'{"a": 1', b'"b": 2}'),
        (b'{"x}": 1', b'"{y": 2}'),
        (b'{"a": 1}, 2', b'{"a": 2}'),
        (b"[", b"]"),
        (b"", b'{"a": 1}'),
        (b'{"a": {}}', b'{"a": 1}'),
        (b'{"a": [{}', b"{}]}"),
    ],
)
def test_what_is_whole_only_together_is_refused(pair: tuple[bytes, bytes]) -> None:
    """Side by side in a list these would be what they are not alone."""
    said = one_by_one(list(pair))
    if said:
        with pytest.raises(RigtwinError, match=said):
            columns(list(pair))
    else:
        with pytest.raises(RigtwinError, match="none of the fields"):
            columns(list(pair))


@pytest.mark.parametrize("seed", range(30))
def test_damage_is_told_of_the_message_that_has_it(seed: int) -> None:
    random = np.random.default_rng(seed)
    data = [json.dumps({"a": n, "{b": 2.5}).encode() for n in range(20)]
    for _ in range(int(random.integers(1, 4))):
        where = int(random.integers(len(data)))
        damaged = bytearray(data[where])
        damaged[int(random.integers(len(damaged)))] = int(random.choice(list(b'{}[],:"1 a')))
        data[where] = bytes(damaged)
    said = one_by_one(data)
    if said:
        with pytest.raises(RigtwinError, match=said):
            columns(data)
    else:
        rows = [json.loads(each) for each in data]
        for name, values in columns(data).items():
            assert values == [row[name] for row in rows]
