"""A recording that is still written is read in time that grows with its length alone, whatever
stands in it."""

from __future__ import annotations

import shutil
import struct
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from rigtwin.errors import RigtwinError
from rigtwin.recording import Writer, load
from rigtwin.recording.growing import LONGEST, GrowingRecording

TICKS = 20_000


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("growing") / "whole.mcap"
    noise = np.random.default_rng(1).normal(size=(TICKS, 2))
    with Writer(path, "test", 1e-3, {}, "bench", {"/sensor": ("a", "b")}) as writer:
        for start in range(0, TICKS, 250):
            writer.append(sensor=noise[start : start + 250])
    return path


def chunks_of(data: bytes) -> list[int]:
    """Places of a file's chunks."""
    places, at = [], len(MCAP0_MAGIC)
    while not data.startswith(MCAP0_MAGIC, at):
        opcode, length = struct.unpack_from("<BQ", data, at)
        places += [at] if opcode == Opcode.CHUNK else []
        at += 9 + length
    return places


def read_growing(path: Path) -> GrowingRecording:
    growing = GrowingRecording(path, 1e6)
    growing.read()
    return growing


def test_a_whole_file_is_read_as_it_is(whole: Path) -> None:
    growing = read_growing(whole)
    assert growing.ended or growing.recording().ticks == TICKS
    np.testing.assert_array_equal(growing.recording()["/sensor.a"], load(whole)["/sensor.a"])


def test_a_file_that_grows_by_bytes_is_read_to_its_end(whole: Path, tmp_path: Path) -> None:
    data, path = whole.read_bytes(), tmp_path / "part.mcap"
    path.write_bytes(data[:5])
    growing = GrowingRecording(path, 1e6)
    for end in range(5, len(data) + 10_007, 10_007):
        path.write_bytes(data[:end])
        growing.read()
    assert growing.recording().ticks == TICKS
    assert growing.recording().notes == ()


@pytest.mark.parametrize("head", [MCAP0_MAGIC, MCAP0_MAGIC + b"\x0f"])
def test_zeros_take_no_longer_than_reading_them(tmp_path: Path, head: bytes) -> None:
    path = tmp_path / "zeros.mcap"
    with path.open("wb") as file:
        file.write(head)
        file.truncate(2**26)
    begun = time.perf_counter()
    growing = read_growing(path)
    assert time.perf_counter() - begun < 2.0
    with pytest.raises(RigtwinError):
        growing.recording()
    begun = time.perf_counter()
    with pytest.raises(RigtwinError):
        load(path)
    assert time.perf_counter() - begun < 2.0


@pytest.mark.parametrize("byte", [3, 4, 7])
def test_a_wrong_length_costs_the_chunk_that_has_it(whole: Path, tmp_path: Path, byte: int) -> None:
    data = bytearray(whole.read_bytes())
    place = chunks_of(bytes(data))[3]
    data[place + byte] ^= 0x40
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    begun = time.perf_counter()
    recording = read_growing(path).recording()
    assert time.perf_counter() - begun < 3.0
    assert load(path).ticks == recording.ticks
    lost = TICKS - recording.ticks
    assert 0 < lost < TICKS / 10
    assert any("damaged" in note for note in recording.notes)


def test_a_large_file_with_a_wrong_length_takes_no_hour(whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "large.mcap"
    shutil.copy(whole, path)
    data = whole.read_bytes()
    with path.open("r+b") as file:
        file.seek(chunks_of(data)[2] + 1)
        file.write(struct.pack("<Q", LONGEST - 1))
        file.seek(0, 2)
        file.write(bytes(10**8))
    begun = time.perf_counter()
    growing = read_growing(path)
    assert time.perf_counter() - begun < 5.0
    assert growing.recording().ticks == load(path).ticks > 0.9 * TICKS
