"""A page on paper or as a picture: what Chrome, Chromium or Edge makes of it without a window."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.files import write_whole
from rigtwin.system import is_superuser

VARIABLE = "RIGTWIN_BROWSER"
"""Of the environment: the browser to use, where it is not found by its name."""
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
"""Where a browser lies that is not on the PATH."""
SETTLING = 10_000
"""Of the page's own time, ms: until every figure is drawn."""
LONGEST = 120.0
"""Of waiting for the browser, s."""
WIDTH, TALLEST = 1280, 16_384
"""Of a picture, px. Browsers draw none that is higher."""
A4 = 720
"""Of the window whose page fits on A4, px: figures keep the width that they are drawn with."""
HEAD = """<style>@page { size: A4; }</style>
<script>
addEventListener('DOMContentLoaded', () => {
  for (const folded of document.querySelectorAll('details')) folded.open = true;
});
setInterval(() => {
  document.documentElement.dataset.height = document.documentElement.scrollHeight;
}, 500);
</script>"""
"""The paper; on it nothing can be opened by a click; and how high the page is."""


def find_browser() -> str:
    """The browser that prints.

    Raises
    ------
    RigtwinError
        If there is none.
    """
    if chosen := os.environ.get(VARIABLE):
        if found := shutil.which(chosen):
            return found
        raise RigtwinError(f"{VARIABLE} is {chosen!r}; expected the path of Chrome, Chromium, Edge")
    for each in (*NAMES, *PLACES):
        if found := shutil.which(each):
            return found
    raise RigtwinError(
        "a PDF or PNG of a report is printed by Chrome, Chromium or Edge, and none was found; "
        f"install one, name it in {VARIABLE}, or write the report as .html"
    )


def write_pdf(path: Path, page: str) -> None:
    """Prints a page on A4.

    Parameters
    ----------
    path
        Of the PDF.
    page
        Of HTML that needs nothing from elsewhere; what is folded is opened.

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
        write_whole(path, _made(made))


def write_png(path: Path, page: str) -> None:
    """Takes a picture of a whole page, 1280 px wide, as `write_pdf`."""
    with _laid_out(path, page) as folder:
        made = Path(folder, "page.png")
        drawn = _browse(Path(folder), f"--window-size={WIDTH},1000", "--dump-dom")
        found = re.search(r'<html[^>]*data-height="(\d+)"', drawn)
        if found is None:
            raise RigtwinError("the browser did not say how high the page is")
        height = min(int(found.group(1)), TALLEST)
        _browse(
            Path(folder),
            f"--window-size={WIDTH},{height}",
            "--hide-scrollbars",
            f"--screenshot={made}",
        )
        write_whole(path, _made(made))


def _laid_out(path: Path, page: str) -> tempfile.TemporaryDirectory[str]:
    """A folder that holds the page. Beside the output: a browser in a container of its own, such as
    Ubuntu's, sees the user's folders but not /tmp."""
    try:
        folder = tempfile.TemporaryDirectory(
            prefix="rigtwin-", dir=path.resolve().parent, ignore_cleanup_errors=True
        )
    except OSError as error:
        raise RigtwinError(f"cannot write {path}: {error.strerror}") from None
    write_whole(Path(folder.name, "page.html"), page.replace("<head>", "<head>" + HEAD, 1))
    return folder


def _browse(folder: Path, *options: str) -> str:
    """Opens the page in the browser, and returns what that says."""
    command = [
        find_browser(),
        "--headless",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--no-first-run",
        f"--user-data-dir={folder / 'profile'}",
        f"--virtual-time-budget={SETTLING}",
    ]
    if is_superuser():
        command.append("--no-sandbox")  # Chrome refuses root otherwise; the page is our own
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
        last = (done.stderr.strip().splitlines() or ["without a word"])[-1]
        raise RigtwinError(f"{command[0]} failed to print the page: {last}")
    return done.stdout


def _made(path: Path) -> bytes:
    """What the browser wrote."""
    try:
        return path.read_bytes()
    except OSError:
        raise RigtwinError("the browser ended without a word and wrote nothing") from None
