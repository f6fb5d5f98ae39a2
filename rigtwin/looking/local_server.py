"""A viser server that only this computer reaches, and that says nothing of its own."""

from __future__ import annotations

import io
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from typing import Any

import viser
import websockets.asyncio.server as sockets

from rigtwin.errors import RigtwinError

HOST = "127.0.0.1"
PORTS = 65535
AMBIENT = 0.8
"""Light from everywhere, so that nothing is black."""


class LocalServer(viser.ViserServer):
    """A server that cannot be asked to share its page with the world."""

    @property
    def url(self) -> str:
        """Where its page is."""
        return f"http://{HOST}:{self.get_port()}"

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
        """Nothing: whatever a page asks for stays here."""
        return None


def open_server(port: int, label: str) -> LocalServer:
    """Starts a server.

    Parameters
    ----------
    port
        Of this computer; 0 takes a free one.
    label
        Title of the page's panel.

    Returns
    -------
    LocalServer
        Running.

    Raises
    ------
    RigtwinError
        If the port is taken or is none.
    """
    if not 0 <= port <= PORTS:
        raise RigtwinError(f"port {port}: expected 0 to {PORTS}")
    # viser goes on to the next port where one is taken; whoever asked for this one would not know.
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise RigtwinError(
                f"no page on port {port}: {error.strerror}; 0 takes a free one"
            ) from None
        free = int(probe.getsockname()[1])
    with redirect_stdout(io.StringIO()), _for_its_own_pages():
        server = LocalServer(host=HOST, port=free, label=label, verbose=False)
    if server.get_port() != free:
        stop_server(server)
        raise RigtwinError(f"no page on port {port}: it was taken just now; 0 takes a free one")
    server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    _light(server)
    return server


@contextmanager
def _for_its_own_pages() -> Iterator[None]:
    """A server that is started meanwhile answers its own pages alone. Another page of the same
    browser could otherwise read the recording and press buttons; viser has no option for that."""
    plain = sockets.serve

    def serve(
        handler: Any, host: str, port: int, *, process_request: Callable[..., Any], **options: Any
    ) -> Any:
        hosts = {f"{name}:{port}" for name in (HOST, "localhost")}
        origins = {f"http://{each}" for each in hosts}

        def answer(connection: Any, request: Any) -> Any:
            asked, by = request.headers.get_all("Host"), request.headers.get_all("Origin")
            if not set(asked) <= hosts or not set(by) <= origins:
                return connection.respond(HTTPStatus.FORBIDDEN, "for pages of this server alone\n")
            return process_request(connection, request)

        return plain(handler, host, port, process_request=answer, **options)

    sockets.serve = serve
    try:
        yield
    finally:
        sockets.serve = plain


def clear(server: LocalServer) -> None:
    """Takes everything from its page, in all tabs."""
    server.gui.reset()
    server.scene.reset()
    _light(server)


def _light(server: LocalServer) -> None:
    # Where there is no graphics card, mirrored surroundings and shadows are most of what a picture
    # costs, and whoever drags a slider waits for pictures.
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_ambient("/light", intensity=AMBIENT)


def stop_server(server: LocalServer) -> None:
    """Ends it and all its connections."""
    with redirect_stdout(io.StringIO()):
        server.stop()
