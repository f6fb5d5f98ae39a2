"""Printing of an HTML page to PDF or PNG by Chrome, Chromium or Edge without a window."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.files import atomic_write
from rigtwin.system import is_superuser

VARIABLE = "RIGTWIN_BROWSER"
"""Environment variable with the browser's path, if the browser is not found by its name."""
NAMES = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "msedge",
)
PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
)
"""Paths of browsers that are usually not on the PATH."""
SETTLING = 10_000
"""Time in the page's virtual clock until every figure is drawn, in ms."""
LONGEST = 120.0
"""Maximum time to wait for the browser, in s."""
WIDTH, TALLEST = 1280, 16_384
"""Width and maximum height of a picture, in pixels. Browsers draw none that is higher."""
A4 = 720
"""Width of a window whose page fits on A4, in pixels. Figures keep their own width."""
HEAD = """<style>@page { size: A4; }</style>
<script>
addEventListener('DOMContentLoaded', () => {
  for (const folded of document.querySelectorAll('details')) folded.open = true;
});
setInterval(() => {
  document.documentElement.dataset.height = document.documentElement.scrollHeight;
}, 500);
</script>"""
"""Additions to the page: the paper size, all folds opened, since paper cannot be clicked, and the
page's height as an attribute."""


def find_browser() -> str:
    """Return the path of the browser that prints.

    Raises
    ------
    RigtwinError
        If no browser is found.
    """
    if chosen := os.environ.get(VARIABLE):
        if path := shutil.which(chosen):
            return path
        raise RigtwinError(f"{VARIABLE} is {chosen!r}; expected the path of Chrome, Chromium, Edge")
    for name in (*NAMES, *PLACES):
        if path := shutil.which(name):
            return path
    raise RigtwinError(
        "a PDF or PNG of a report is printed by Chrome, Chromium or Edge, and none was found; "
        f"install one, name it in {VARIABLE}, or write the report as .html"
    )


def write_pdf(path: Path, page: str) -> None:
    """Print a page on A4.

    Parameters
    ----------
    path
        Path of the PDF.
    page
        HTML that needs nothing from elsewhere. All folds are opened.

    Raises
    ------
    RigtwinError
        If there is no browser, it fails, or the file cannot be written.
    """
    with _laid_out(path, page) as folder:
        made = Path(folder, "page.pdf")
        _browse(
            Path(folder),
            f"--window-size={A4},1000",
            "--no-pdf-header-footer",
            f"--print-to-pdf={made}",
        )
        atomic_write(path, _made(made))


def write_png(path: Path, page: str) -> None:
    """Write a picture of a whole page, 1280 pixels wide. Raise RigtwinError as `write_pdf`."""
    with _laid_out(path, page) as folder:
        made = Path(folder, "page.png")
        # The height is unknown until the page is laid out, so the page is opened twice.
        drawn = _browse(Path(folder), f"--window-size={WIDTH},1000", "--dump-dom")
        height_match = re.search(r'<html[^>]*data-height="(\d+)"', drawn)
        if height_match is None:
            raise RigtwinError("the browser did not say how high the page is")
        height = min(int(height_match.group(1)), TALLEST)
        _browse(
            Path(folder),
            f"--window-size={WIDTH},{height}",
            "--hide-scrollbars",
            f"--screenshot={made}",
        )
        atomic_write(path, _made(made))


def _laid_out(path: Path, page: str) -> tempfile.TemporaryDirectory[str]:
    """Return a temporary folder with the page, beside the output.

    A browser in a sandbox, such as Ubuntu's snap, sees the user's folders but not /tmp.
    """
    try:
        folder = tempfile.TemporaryDirectory(
            prefix="rigtwin-", dir=path.resolve().parent, ignore_cleanup_errors=True
        )
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None
    # Once only: a page may quote <head> in its text.
    atomic_write(Path(folder.name, "page.html"), page.replace("<head>", "<head>" + HEAD, 1))
    return folder


def _browse(folder: Path, *options: str) -> str:
    """Open the page in the browser, and return the browser's output."""
    command = [
        find_browser(),
        "--headless",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--no-first-run",
        # A fresh profile keeps the user's browser, its windows and extensions out of it.
        f"--user-data-dir={folder / 'profile'}",
        f"--virtual-time-budget={SETTLING}",
    ]
    if is_superuser():
        command.append("--no-sandbox")  # Chrome refuses to run as root otherwise
    try:
        done = subprocess.run(
            [*command, *options, (folder / "page.html").as_uri()],
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=LONGEST,
        )
    except subprocess.TimeoutExpired:
        raise RigtwinError(f"{command[0]} did not print the page in {LONGEST:.0f} s") from None
    except OSError as error:
        raise RigtwinError(f"cannot start {command[0]}: {error.strerror}") from None
    if done.returncode:
        # The last line of the error output is the most specific.
        last = (done.stderr.strip().splitlines() or ["without a word"])[-1]
        raise RigtwinError(f"{command[0]} failed to print the page: {last}")
    return done.stdout


def _made(path: Path) -> bytes:
    """Return the file that the browser wrote."""
    try:
        return path.read_bytes()
    except OSError:
        raise RigtwinError("the browser ended without a word and wrote nothing") from None
