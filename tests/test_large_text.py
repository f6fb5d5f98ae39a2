"""Text files in bounded memory: both readers agree, only mapped columns are read, gzip."""

from __future__ import annotations

import gzip
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigtwin.errors import RigtwinError
from rigtwin.importing import fast_text
from rigtwin.importing.cells import BLOCK
from rigtwin.importing.columns import Columns
from rigtwin.importing.selection import EVERYTHING, Selection
from rigtwin.importing.table import read

ROWS = 2 * BLOCK + 500
VALUES = np.random.default_rng(3).normal(size=(ROWS, 4)).round(4)


def text(separator: str = ",", decimal: str = ".", head: str = "a [mm],b,c,d") -> str:
    rows = "\n".join("|".join(map(str, row)) for row in VALUES.tolist())
    rows = rows.replace(".", decimal).replace("|", separator)
    return f"{head.replace(',', separator)}\n{rows}\n"


def read_both(path: Path, monkeypatch, selection: Selection = EVERYTHING) -> list[Columns]:
    """Read a file by Arrow where that can be, and by the slower reader."""
    pytest.importorskip("pyarrow")
    found = []
    for large in (0, 10**12):
        monkeypatch.setattr(fast_text, "LARGE", large)
        found.append(read(path, selection))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "write",
    [
        lambda: text(),
        lambda: text(";", ","),
        lambda: text("\t"),
        lambda: "Logger 7\n\n" + text(),
        lambda: text().replace("\n", "\r\n"),
        lambda: text() + "1.0,NaN,nan,4.0\n",
        lambda: text() + "\n\n1.0,2.0,3.0,4.0\n",
        lambda: text() + "1.0,,3.0,4.0\n1.0,n/a,3.0,4.0\n",
        lambda: text() + "1.0,2.0",
        lambda: text() + ",,,\n1.0,2.0,3.0,4.0\n",
        lambda: text() + "1.0,2.0,3.0,4.0,\n",
        lambda: text() + '"1.0","2.0",3.0,4.0\n',
        lambda: text() + "+1.0,1e400, 3.0 ,4.0\n",
        lambda: text() + "1.0,late,3.0,4.0\n",
    ],
    ids=range(14),
)
def test_both_readers_read_the_same(tmp_path: Path, monkeypatch, write: Callable[[], str]):
    # The text is made in the test: at import, every worker would make all of them.
    (tmp_path / "log.csv").write_text(write(), newline="")
    fast, slow = read_both(tmp_path / "log.csv", monkeypatch)
    assert fast.names == slow.names
    assert fast.units == slow.units
    assert fast.notes == slow.notes
    assert fast.wrong == slow.wrong
    for name, values in slow.values.items():
        np.testing.assert_array_equal(fast.values[name], values)
    assert fast.rows >= ROWS


def test_a_wrong_cell_in_a_later_block_is_named_by_its_line(tmp_path: Path):
    lines = text().splitlines()
    lines[BLOCK + 7] = "1.0,2.0,oops,4.0"
    (tmp_path / "log.csv").write_text("\n".join(lines))
    found = read(tmp_path / "log.csv")
    assert found.wrong == {"c": f"'oops' in line {BLOCK + 8}"}
    np.testing.assert_array_equal(found.values["a"][:5], VALUES[:5, 0])


def test_dates_go_on_over_blocks(tmp_path: Path):
    seconds = np.arange(ROWS) * 0.01 + 86390.0
    clocks = [f"{int(s // 3600) % 24:02d}:{int(s // 60) % 60:02d}:{s % 60:05.2f}" for s in seconds]
    body = "\n".join(f"{c},{v}" for c, v in zip(clocks, VALUES[:, 0].tolist(), strict=True))
    (tmp_path / "log.csv").write_text(f"t,x\n{body}\n")
    found = read(tmp_path / "log.csv")
    np.testing.assert_allclose(np.diff(found.values["t"]), 0.01, atol=1e-6)
    assert found.units["t"] == "s"


def test_only_the_needed_columns_are_read_and_all_are_listed(tmp_path: Path, monkeypatch):
    (tmp_path / "log.csv").write_text(text())
    for found in read_both(tmp_path / "log.csv", monkeypatch, Selection(frozenset({"a [mm]"}))):
        assert list(found.values) == ["a"]
        assert found.names == ("a", "b", "c", "d")


@pytest.mark.slow
def test_memory_does_not_grow_with_the_columns_that_are_not_needed(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(fast_text, "LARGE", 10**12)
    row = ",".join(["1.2345678"] * 60)
    rows = 3 * BLOCK
    with (tmp_path / "wide.csv").open("w") as file:
        file.write(",".join(f"c{n}" for n in range(60)) + "\n")
        file.writelines(f"{row}\n" for _ in range(rows))
    tracemalloc.start()
    found = read(tmp_path / "wide.csv", Selection(frozenset({"c7"})))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found.rows == rows
    # All cells as texts would be 60 bytes each: 216 MB.
    assert peak < 30e6


def test_compressed_text(tmp_path: Path, monkeypatch):
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(text().encode()))
    for found in read_both(tmp_path / "log.csv.gz", monkeypatch):
        np.testing.assert_array_equal(found.values["b"], VALUES[:, 1])
    for wrong in (text().encode(), gzip.compress(text().encode())[:5000]):
        (tmp_path / "log.csv.gz").write_bytes(wrong)
        with pytest.raises(RigtwinError, match=r"log\.csv\.gz is not a gzip file, or cut off"):
            read(tmp_path / "log.csv.gz")


def test_a_column_of_words_says_what_it_holds_if_it_is_needed(tmp_path: Path):
    (tmp_path / "log.csv").write_text("t,x\n" + "".join(f"{n},0x{n:02X}\n" for n in range(50)))
    assert "it holds '0x00' in line 2" in read(tmp_path / "log.csv").refused["x"]
