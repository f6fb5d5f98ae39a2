"""Compiled code on the disk: whatever happens to it, it is compiled again and never believed."""

from __future__ import annotations

import hashlib
import pickle
import sys
from pathlib import Path

import numba
import pytest
from numba.core import config

from rigtwin.numerics.verified_cache import VerifiedCache

DIGEST = hashlib.sha256().digest_size


def triple(x: float) -> float:
    return 3.0 * x


def compiled(folder: Path, monkeypatch) -> float:
    """What the function gives, compiled or loaded as a new process would."""
    monkeypatch.setattr(config, "CACHE_DIR", str(folder))
    made = numba.njit(nogil=True)(triple)
    made._cache = VerifiedCache(triple)
    return made(2.0)


def files(folder: Path, ending: str) -> list[Path]:
    return sorted(folder.rglob(f"*.{ending}"))


def cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


def empty(_: bytes) -> bytes:
    return b""


def garble(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 0xFF]) + data[middle + 1 :]


@pytest.mark.parametrize("damage", [cut, empty, garble])
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_a_damaged_file_is_thrown_away_and_made_again(tmp_path, monkeypatch, damage, ending):
    assert compiled(tmp_path, monkeypatch) == 6.0
    (path,) = files(tmp_path, ending)
    path.write_bytes(damage(path.read_bytes()))
    assert compiled(tmp_path, monkeypatch) == 6.0
    assert len(files(tmp_path, "*")) == 2, "an index and its code; nothing else is left"
    before = path.stat().st_mtime_ns
    assert compiled(tmp_path, monkeypatch) == 6.0
    assert path.stat().st_mtime_ns == before, "it is whole again"


def test_whole_code_is_loaded_and_not_compiled(tmp_path, monkeypatch):
    compiled(tmp_path, monkeypatch)
    before = [path.stat().st_mtime_ns for path in files(tmp_path, "nb*")]
    assert compiled(tmp_path, monkeypatch) == 6.0
    assert [path.stat().st_mtime_ns for path in files(tmp_path, "nb*")] == before


class Renamed:
    """Class that a later version of the program lacks."""


def test_an_index_of_a_class_that_is_gone_is_not_read(tmp_path, monkeypatch):
    compiled(tmp_path, monkeypatch)
    (path,) = files(tmp_path, "nbi")
    whole = path.read_bytes()[:-DIGEST]
    version = pickle.loads(whole)
    stamped = whole[len(pickle.dumps(version)) :]
    stamp, _ = pickle.loads(stamped)
    index = pickle.dumps(version) + pickle.dumps((stamp, {Renamed: "code"}))
    path.write_bytes(index + hashlib.sha256(index).digest())
    monkeypatch.delattr(sys.modules[__name__], "Renamed")
    assert compiled(tmp_path, monkeypatch) == 6.0


def test_a_full_disk_is_named_and_stops_nothing(tmp_path, monkeypatch, caplog):
    def full(_: Path, mode: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "open", full)
    assert compiled(tmp_path, monkeypatch) == 6.0
    assert f"compiled code cannot be kept in {tmp_path}" in caplog.text
    assert "No space left on device" in caplog.text
    assert not files(tmp_path, "nb*")
