"""A page on paper and as a picture, as a browser prints it."""

from __future__ import annotations

import re
import struct

import pytest

from rigtwin.errors import RigtwinError
from rigtwin.render.browser import VARIABLE, find_browser, write_pdf, write_png
from tests.helpers.browser import BROWSER

PAGE = """<!DOCTYPE html><html lang="en"><head><title>A page</title></head><body>
<h1>Above</h1><div style="height:3000px"></div>
<details><summary>More</summary><div style="height:2000px">Below</div></details></body></html>"""
WRITERS = (write_pdf, write_png)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no browser")


@needs_browser
def test_a_pdf_is_a4_with_everything_unfolded(tmp_path):
    write_pdf(tmp_path / "page.pdf", PAGE)
    printed = (tmp_path / "page.pdf").read_bytes()
    assert printed.startswith(b"%PDF-")
    (size,) = set(re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", printed))
    assert [float(each) for each in size] == pytest.approx([595.0, 842.0], abs=1.0)
    assert len(re.findall(rb"/Type /Page\b", printed)) >= 5


@pytest.mark.slow
@needs_browser
def test_a_picture_is_of_the_whole_page(tmp_path):
    write_png(tmp_path / "page.png", PAGE)
    picture = (tmp_path / "page.png").read_bytes()
    width, height = struct.unpack(">II", picture[16:24])
    assert width == 1280
    assert 5000 < height < 5400
    assert [each.name for each in tmp_path.iterdir()] == ["page.png"], "nothing else is left"


@pytest.mark.parametrize("write", WRITERS)
def test_a_browser_that_is_not_there_gets_one_line(write, tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "no-such-browser")
    with pytest.raises(RigtwinError, match=rf"^{VARIABLE} is 'no-such-browser'; expected [^\n]*$"):
        write(tmp_path / "page", PAGE)
    assert not list(tmp_path.iterdir())


def test_without_any_browser_it_is_said_what_to_do(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(RigtwinError, match=r"none was found; install one, .* as \.html"):
        find_browser()


@pytest.mark.parametrize("write", WRITERS)
def test_a_browser_that_fails_gets_one_line(write, tmp_path, monkeypatch):
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\necho starting >&2\necho out of memory >&2\nexit 3\n")
    broken.chmod(0o755)
    monkeypatch.setenv(VARIABLE, str(broken))
    with pytest.raises(RigtwinError, match=r"failed to print the page: out of memory$"):
        write(tmp_path / "page", PAGE)


@pytest.mark.parametrize("write", WRITERS)
def test_a_browser_that_writes_nothing_gets_one_line(write, tmp_path, monkeypatch):
    silent = tmp_path / "silent"
    silent.write_text("#!/bin/sh\necho '<html data-height=\"900\">'\n")
    silent.chmod(0o755)
    monkeypatch.setenv(VARIABLE, str(silent))
    with pytest.raises(RigtwinError, match=r"wrote nothing$"):
        write(tmp_path / "page", PAGE)


@pytest.mark.parametrize("write", WRITERS)
def test_a_folder_that_is_not_there_gets_one_line(write, tmp_path):
    with pytest.raises(RigtwinError, match=r"^cannot write .*: No such file or directory$"):
        write(tmp_path / "none" / "page", PAGE)
