"""Latency of the page of `rigtwin look` during a drag, and memory after a thousand drags.

python -m benchmarks.look
"""

from __future__ import annotations

import gc
import os
import tempfile
import time
from pathlib import Path

import numpy as np

import rigtwin
from tests.helpers.described import NOISY, described
from tests.helpers.devtools import Tab, browser
from tests.test_look_page import drag, open_folder, opened

DRAGS = 1000
TIMED = 20
WINDOW = (1600, 1000)
SMALL = {"width": 1000, "height": 450, "deviceScaleFactor": 1, "mobile": False}
"""Small window: without a graphics card its picture is drawn quickly."""


def resident() -> float:
    """Return the memory of this process, MB."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def heap(tab: Tab) -> float:
    """Return the memory of the page's JavaScript, MB."""
    tab.call("HeapProfiler.collectGarbage")
    return tab.call("Runtime.getHeapUsage")["usedSize"] / 1e6


def time_drags(tab: Tab, name: str) -> None:
    """Print the latency of the error's text and of the trace during drags."""
    width, height = tab.ask("[innerWidth, innerHeight]")
    print(f"  window of {width} x {height}")
    drag(tab, name, [0.02, 0.04])
    tab.ask("late = {text: [], trace: []}; true")
    drag(tab, name, [0.05 + 0.9 * n / TIMED for n in range(TIMED)])
    for element, late in tab.ask("late").items():
        print(
            f"  {element}: {np.median(late):.0f} ms in the median, {max(late):.0f} ms at most "
            f"({len(late)} drags)"
        )


def drag_on(tab: Tab, name: str, drags: int) -> None:
    """Move a slider to and fro as fast as the page accepts it."""
    x, y, width, _ = tab.wait_for(f"track('{name}', 1)")
    tab.mouse("Pressed", x + 0.1 * width, y)
    for n in range(drags):
        tab.mouse("Moved", x + (0.1 + 0.8 * (n % 97) / 97) * width, y)
        time.sleep(0.02)
    tab.mouse("Released", x + 0.1 * width, y)


def main() -> None:
    """Print latency and memory for two machines."""
    with tempfile.TemporaryDirectory() as folder:
        bench = described(Path(folder), "slide", NOISY)
        for machine, experiment, name in (
            (bench, "shake", "coulomb@guide"),
            (rigtwin.machine("tx40"), "swing", "viscous@joint_2"),
        ):
            recording = rigtwin.run(machine, experiment, seed=1, effects={name: 6.0})
            look = rigtwin.look(recording, machine=machine)
            with (
                rigtwin.show_look(look) as page,
                browser(Path(folder), WINDOW) as running,
                running.tab(page.url) as first,
            ):
                tab = opened(first)
                open_folder(tab, name.partition("@")[2])
                print(machine.name, look.measured.shape)
                time_drags(tab, name)
                tab.call("Emulation.setDeviceMetricsOverride", **SMALL)
                time.sleep(1.0)
                time_drags(tab, name)
                # The first drags fill caches; only growth after them counts.
                drag_on(tab, name, 100)
                before, page_before = resident(), heap(tab)
                drag_on(tab, name, DRAGS)
                print(
                    f"  {DRAGS} drags: {before:.0f} MB before, {resident():.0f} MB after; "
                    f"the page's JavaScript {page_before:.0f} and {heap(tab):.0f} MB"
                )


if __name__ == "__main__":
    main()
