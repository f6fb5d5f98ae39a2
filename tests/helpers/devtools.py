"""A page in a headless browser, driven as a person would drive it: over the DevTools protocol."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.request import urlopen

from websockets.sync.client import connect
from websockets.sync.connection import Connection

from tests.helpers.browser import BROWSER

PATIENCE = 60.0
"""s, until something has to be there."""


class Tab:
    """One tab of a browser. errors: what its console was told; asked: addresses it asked for."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._number = connection, 0
        self.errors: list[str] = []
        self.asked: set[str] = set()
        for domain in ("Page", "Runtime", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: object) -> dict[str, Any]:
        """One command, and its result."""
        self._number += 1
        self._connection.send(json.dumps({"id": self._number, "method": method, "params": params}))
        while True:
            reply = json.loads(self._connection.recv(timeout=PATIENCE))
            if reply.get("id") == self._number:
                assert "error" not in reply, reply
                return reply["result"]
            self._note(reply)

    def _note(self, event: dict[str, Any]) -> None:
        if event.get("method") == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(event["params"])[:500])
        if event.get("method") == "Runtime.consoleAPICalled" and event["params"]["type"] == "error":
            self.errors.append(json.dumps(event["params"]["args"])[:500])
        if event.get("method") == "Network.requestWillBeSent":
            self.asked.add(event["params"]["request"]["url"])

    def ask(self, script: str) -> Any:
        """The value of an expression, awaited if it is a promise."""
        reply = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in reply, reply
        return reply["result"].get("value")

    def wait_for(self, script: str, patience: float = PATIENCE) -> Any:
        """The value of an expression, once it is true."""
        until = time.monotonic() + patience
        while time.monotonic() < until:
            if found := self.ask(script):
                return found
            time.sleep(0.05)
        raise AssertionError(f"not within {patience:g} s: {script}")

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Presses, moves or releases the left button."""
        self.call(
            "Input.dispatchMouseEvent",
            type=f"mouse{kind}",
            x=x,
            y=y,
            button="left",
            buttons=0 if kind == "Released" else 1,
            clickCount=1,
        )

    def click(self, x: float, y: float) -> None:
        self.mouse("Pressed", x, y)
        self.mouse("Released", x, y)

    def picture(self, path: Path) -> Path:
        """What is seen, as PNG."""
        shot = self.call("Page.captureScreenshot", format="png")
        path.write_bytes(base64.b64decode(shot["data"]))
        return path


@contextmanager
def browser(folder: Path, size: tuple[int, int] = (1600, 1000)) -> Iterator[Browser]:
    """A browser with nothing in it; its profile in a folder."""
    profile = folder / "profile"
    shutil.rmtree(profile, ignore_errors=True)
    process = subprocess.Popen(
        [
            str(BROWSER),
            "--headless=new",
            "--no-sandbox",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--disable-background-networking",
            "--disable-component-update",
            "--no-first-run",
            "--remote-debugging-port=0",
            "--remote-allow-origins=*",
            f"--user-data-dir={profile}",
            f"--window-size={size[0]},{size[1]}",
            "about:blank",
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        told = profile / "DevToolsActivePort"
        until = time.monotonic() + PATIENCE
        while not (told.exists() and told.read_text().count("\n")):
            assert process.poll() is None, "the browser ended"
            assert time.monotonic() < until, "the browser did not start"
            time.sleep(0.05)
        yield Browser(int(told.read_text().split()[0]))
    finally:
        process.terminate()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class Browser:
    """A browser that runs."""

    def __init__(self, port: int) -> None:
        self._port = port

    @contextmanager
    def tab(self, url: str) -> Iterator[Tab]:
        """A page in a tab of its own, closed at the end."""
        first = "about:blank"
        with urlopen(self._request(f"new?{first}", "PUT")) as reply:
            target = json.load(reply)
        with connect(target["webSocketDebuggerUrl"], max_size=None) as connection:
            tab = Tab(connection)
            tab.call("Page.navigate", url=url)
            yield tab
        urlopen(self._request(f"close/{target['id']}", "GET")).close()

    def _request(self, path: str, method: str) -> Any:
        from urllib.request import Request

        return Request(f"http://127.0.0.1:{self._port}/json/{path}", method=method)
