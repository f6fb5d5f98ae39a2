"""Messages that are taken many at once are those that are taken one by one."""

from __future__ import annotations

import io
import zlib
from collections import defaultdict

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk

from rigtwin.recording.records import Messages, take_apart

Taken = dict[int, list[tuple[int, bytes]]]


def chunk(messages: list[tuple[int, int, bytes]]) -> Chunk:
    data = io.BytesIO()
    for number, (channel, time, content) in enumerate(messages):
        data.write(bytes([Opcode.MESSAGE]) + (22 + len(content)).to_bytes(8, "little"))
        data.write(channel.to_bytes(2, "little") + number.to_bytes(4, "little"))
        data.write(time.to_bytes(8, "little") * 2 + content)
    whole = data.getvalue()
    return Chunk("", whole, 2**62, 0, zlib.crc32(whole), len(whole))


def one_by_one(of: Chunk) -> Taken:
    taken: Taken = defaultdict(list)
    for record in breakup_chunk(of, validate_crc=True):
        assert isinstance(record, Message)
        taken[record.channel_id].append((record.log_time, record.data))
    return taken


def at_once(of: Chunk) -> Taken:
    taken: Taken = defaultdict(list)
    for record in take_apart(of):
        if isinstance(record, Messages):
            taken[record.channel_id] += zip(record.times, record.data, strict=True)
        else:
            assert isinstance(record, Message)
            taken[record.channel_id].append((record.log_time, record.data))
    return taken


@pytest.mark.parametrize("seed", range(40))
def test_any_interleaving_is_taken_as_it_is(seed: int) -> None:
    """Turns of some channels, broken by others, by sizes that change, by channels left out."""
    random = np.random.default_rng(seed)
    messages: list[tuple[int, int, bytes]] = []
    for _ in range(int(random.integers(1, 6))):
        sizes = random.integers(0, 40, int(random.integers(1, 5)))
        channels = random.permutation(7)[: len(sizes)]
        for _ in range(int(random.integers(1, 60))):
            for channel, size in zip(channels.tolist(), sizes.tolist(), strict=True):
                if random.random() < 0.02:
                    continue
                length = size + int(random.random() < 0.02)
                time = int(random.integers(2**63))
                messages.append((channel, time, random.bytes(length)))
    assert at_once(chunk(messages)) == one_by_one(chunk(messages))


def test_most_messages_are_taken_at_once() -> None:
    messages = [(place % 3, place, b"x" * (8 * (place % 3))) for place in range(3000)]
    taken = take_apart(chunk(messages))
    assert len(taken) == 6
    assert sum(isinstance(each, Messages) for each in taken) == 3


def test_messages_of_other_sizes_each_time_are_taken_too() -> None:
    messages = [(0, place, b"x" * (place % 13)) for place in range(4000)]
    assert at_once(chunk(messages)) == one_by_one(chunk(messages))
