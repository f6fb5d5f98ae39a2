"""A page opened in a browser, where there is one."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import axe_core_python

from rigtwin.errors import RigtwinError
from rigtwin.render.browser import find_browser

try:
    BROWSER: str | None = find_browser()
except RigtwinError:
    BROWSER = None
AXE = Path(axe_core_python.__file__).parent / "axe.min.js"
VIEWER = """<!DOCTYPE html><meta charset="utf-8"><body style="margin:0">
<iframe id="page" src="report.html" style="width:{width}px;height:900px;border:0"></iframe>
<script>
const page = document.getElementById('page');
const wait = milliseconds => new Promise(done => setTimeout(done, milliseconds));
page.onload = async () => {{
  const inside = page.contentWindow;
  const root = page.contentDocument.documentElement;
  const figures = root.querySelectorAll('figure').length;
  for (let tries = 0; figures && !inside.Bokeh?.documents[0]?.is_idle && tries < 50; tries++)
    await wait(100);
  const axe = page.contentDocument.createElement('script');
  axe.textContent = await (await fetch('axe.min.js')).text();
  root.appendChild(axe);
  const found = await inside.axe.run();
  const serious = found.violations.filter(v => ['serious', 'critical'].includes(v.impact));
  document.body.dataset.result = JSON.stringify({{
    wide: root.scrollWidth,
    first: page.contentDocument.querySelector('h1').getBoundingClientRect().bottom,
    text: page.contentDocument.querySelector('h1').textContent,
    serious: serious.map(v => v.id + ' ' + v.nodes.slice(0, 3).map(n => n.target).join(' ')),
    drawn: [...root.querySelectorAll('figure .canvas')]
      .filter(e => e.querySelector('[data-root-id]')?.childElementCount
        || e.querySelector('[data-root-id]')?.shadowRoot).length,
    small: [...page.contentDocument.querySelectorAll('td,li,p,h1,h2')]
      .filter(e => parseFloat(getComputedStyle(e).fontSize) < 12).length
  }});
}};
</script>"""


def looked_at(page: str, width: int, folder: Path) -> dict[str, Any]:
    """How wide a page is in a window of that width, px, where its heading ends, and how many of its
    texts are too small to read; how many figures are drawn, and what axe finds serious. Fails if
    the browser's console has an error, or the page asks for anything from elsewhere."""
    (folder / "report.html").write_text(page)
    shutil.copy(AXE, folder / "axe.min.js")
    (folder / "viewer.html").write_text(VIEWER.format(width=width))
    log = folder / "net.json"
    done = subprocess.run(
        [
            str(BROWSER),
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            "--disable-component-update",
            "--no-first-run",
            "--allow-file-access-from-files",
            "--enable-logging=stderr",
            f"--user-data-dir={folder / 'profile'}",
            f"--log-net-log={log}",
            f"--window-size={max(width, 500)},1000",
            "--virtual-time-budget=10000",
            "--dump-dom",
            (folder / "viewer.html").as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=90,
        check=True,
    )
    assert not re.search(r"CONSOLE.*(error|Error)", done.stderr), done.stderr
    found = re.search(r'data-result="([^"]*)"', done.stdout)
    assert found, done.stdout[-500:]
    result = json.loads(found.group(1).replace("&quot;", '"'))
    requests = (
        set(re.findall(r'"url":"(https?://[^"]*)"', log.read_text())) if log.exists() else set()
    )
    assert not {url for url in requests if "google" not in url and "gvt" not in url}, requests
    return result
