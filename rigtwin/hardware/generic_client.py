"""Server for a structure simulated in another program, by the protocol of OpenSees' element
`genericClient`, which OpenFresco's users know.

A client connects by TCP. Its first message has 11 integers of 32 bits: the numbers of
displacements, velocities, accelerations, forces and times it sends, the same numbers it wants back,
and the length of a message. Messages of that many doubles follow, in the computer's byte order. The
first number is the request: 3 a trial response (displacements from the second number on), 10 the
force, which is answered, 99 the end. Requests 12 to 15 ask for a stiffness, damping or mass, which
the rig does not have (OpenSees, SRC/element/genericClient; OpenFresco, simApplicationClient).
"""

from __future__ import annotations

import socket
import threading
from contextlib import closing, suppress

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.simulation.slow_model import SlowModel

TRIAL, COMMIT, FORCE, END = 3, 5, 10, 99
MATRICES = (12, 13, 14, 15)
"""Requests for stiffnesses, damping or mass."""
SIZES, DISPLACEMENTS, LENGTH = 11, 0, 10
MOST = 65_536
"""Maximum number of doubles in a message."""


class GenericClientServer:
    """Server that listens for one client, and moves a `SlowModel` as the client asks.

    Parameters
    ----------
    model
        Model whose targets the client sets.
    start
        Position of the plate, in m, that a client's displacements are relative to.
    host, port
        Address and port to listen on; port 0 selects a free one.

    Raises
    ------
    RigtwinError
        If the address or port cannot be listened on.
    """

    def __init__(
        self, model: SlowModel, start: float, host: str = "127.0.0.1", port: int = 8090
    ) -> None:
        self.fault = ""
        """Error of the client that ended the connection; empty after a regular end."""
        self._model, self._start = model, start
        self._begun = threading.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind((host, port))
            self._socket.listen(1)
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise RigtwinError(f"cannot listen at {host}:{port}: {error}") from None
        self.port: int = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def wait(self, seconds: float) -> None:
        """Wait until a client has set its first target. Raise RigtwinError after a timeout in s."""
        if not self._begun.wait(seconds):
            why = self.fault or "no client has connected, or it has not moved"
            raise RigtwinError(f"no client at port {self.port} within {seconds:g} s: {why}")

    def close(self) -> None:
        """End the model and the connection."""
        self._model.end()
        # Shutting down wakes the thread from accept(); closing alone would not on Linux.
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join(timeout=1.0)

    def _serve(self) -> None:
        """Accept one client, and answer it until its end."""
        with suppress(OSError):
            connection, _ = self._socket.accept()
            with closing(connection):
                # A request is one small message that waits for its answer: Nagle's algorithm would
                # delay each by up to 40 ms.
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                try:
                    self._answer(connection)
                except (OSError, RigtwinError) as error:
                    # The rig's loop notices that no target comes, and ends the test.
                    self.fault = str(error)

    def _answer(self, connection: socket.socket) -> None:
        sizes = np.frombuffer(_receive(connection, 4 * SIZES), np.int32)
        length = int(sizes[LENGTH])
        if sizes[DISPLACEMENTS] != 1 or not 2 <= length <= MOST:
            wanted = f"{sizes[DISPLACEMENTS]} displacements in messages of {length} numbers"
            raise RigtwinError(f"a client with {wanted}: expected one in 2 to {MOST}")
        last, felt = np.nan, True
        while True:
            message = np.frombuffer(_receive(connection, 8 * length), np.float64)
            # int() raises an error for NaN and infinity; 0 is no request, and is refused like one
            # below.
            asked = int(message[0]) if np.isfinite(message[0]) else 0
            reply = np.zeros(length)
            if asked == TRIAL:
                if not np.isfinite(message[1]):
                    raise RigtwinError("a client gave a displacement that is not a number")
                # OpenSees gives a step's displacement twice, before and after it commits the step.
                if message[1] == last and not felt:
                    continue
                last, felt = message[1], False
                # The model is closed once the rig's loop has ended.
                if not self._model.give(self._start + float(message[1])):
                    return
                # The rig may start only after a target exists.
                self._begun.set()
            elif asked == FORCE:
                force = self._model.take_force()
                if force is None:
                    return
                # The client's equations have the restoring force on the side of the resistance.
                reply[0] = -force
                felt = True
                connection.sendall(reply.tobytes())
            elif asked in MATRICES:
                connection.sendall(reply.tobytes())
            elif asked == END:
                self._model.end()
                return
            elif asked != COMMIT:
                raise RigtwinError(f"a client asked for {asked}: expected 3, 5, 10, 12 to 15, 99")


def _receive(connection: socket.socket, count: int) -> bytes:
    """Receive a number of bytes. Raise RigtwinError if the client disconnects before."""
    parts: list[bytes] = []
    while count > 0:
        part = connection.recv(min(count, 1 << 16))
        if not part:
            raise RigtwinError("the client closed the connection without an end")
        parts.append(part)
        count -= len(part)
    return b"".join(parts)
