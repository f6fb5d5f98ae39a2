"""A viser server that only this computer can reach, and that prints nothing."""

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
"""Intensity of ambient light, which keeps shaded faces visible."""


class LocalServer(viser.ViserServer):
    """A server that refuses to share its page outside this computer."""

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self.get_port()}"

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
        """Return None: a page must not be shared, whatever it asks for."""
        return None


def open_server(port: int, label: str) -> LocalServer:
    """Start a server.

    Parameters
    ----------
    port
        Port on this computer; 0 selects a free one.
    label
        Title of the page's panel.

    Returns
    -------
    LocalServer
        Running server.

    Raises
    ------
    RigtwinError
        If the port is in use or out of range.
    """
    if not 0 <= port <= PORTS:
        raise RigtwinError(f"port {port}: expected 0 to {PORTS}")
    # viser silently uses the next port if one is in use, so the port is probed first.
    with socket.socket() as probe:
        # A port whose last page was closed moments ago is free, although connections linger.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise RigtwinError(
                f"no page on port {port}: {error.strerror}; 0 takes a free one"
            ) from None
        free = int(probe.getsockname()[1])
    # viser prints a banner and its address, which belong to no command's output.
    with redirect_stdout(io.StringIO()), _for_its_own_pages():
        server = LocalServer(host=HOST, port=free, label=label, verbose=False)
    if server.get_port() != free:
        stop_server(server)
        raise RigtwinError(
            f"no page on port {port}: another program took it just now; 0 takes a free one"
        )
    server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    _light(server)
    return server


@contextmanager
def _for_its_own_pages() -> Iterator[None]:
    """Make a server that is started inside this context answer only its own pages.

    Otherwise another page in the same browser could read the recording and press buttons, by
    cross-site WebSocket hijacking. viser has no option for this, so its WebSocket server is
    replaced.
    """
    plain = sockets.serve

    def serve(
        handler: Any, host: str, port: int, *, process_request: Callable[..., Any], **options: Any
    ) -> Any:
        hosts = {f"{name}:{port}" for name in (HOST, "localhost")}
        origins = {f"http://{host}" for host in hosts}

        def answer(connection: Any, request: Any) -> Any:
            # Host guards against DNS rebinding, Origin against pages of other servers.
            # A program other than a browser sends no Origin, and is let in.
            asked, by = request.headers.get_all("Host"), request.headers.get_all("Origin")
            if not set(asked) <= hosts or not set(by) <= origins:
                return connection.respond(HTTPStatus.FORBIDDEN, "for pages of this server alone\n")
            return process_request(connection, request)

        return plain(handler, host, port, process_request=answer, **options)

    # viser looks the function up in its module when it starts.
    sockets.serve = serve
    try:
        yield
    finally:
        sockets.serve = plain


def clear(server: LocalServer) -> None:
    """Remove all content from the page, in all tabs."""
    server.gui.reset()
    server.scene.reset()
    _light(server)


def _light(server: LocalServer) -> None:
    # Without a graphics card, reflections and shadows cost most of a picture's time, and a user who
    # drags a slider waits for pictures.
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_ambient("/light", intensity=AMBIENT)


def stop_server(server: LocalServer) -> None:
    """Stop a server and all its connections."""
    with redirect_stdout(io.StringIO()):
        server.stop()
