"""A structure in another program that speaks as OpenSees' element `genericClient` does, as
OpenFresco's users connect it.

The client connects by TCP and says, as 11 integers of 32 bits, how many displacements, velocities,
accelerations, forces and times it will send, how many of each it wants back, and how many numbers a
message has. Then come messages of that many doubles, in the computer's own byte order. The first is
what is asked: 3 a trial response (displacements from the second number on), 10 the force, which is
answered, and 99 the end; 12 to 15 ask for a stiffness, damping or mass, of which the rig has none
to tell (OpenSees, SRC/element/genericClient; OpenFresco, simApplicationClient).
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
"""What a client asks of an element besides its force: stiffnesses, damping, mass."""
SIZES, DISPLACEMENTS, LENGTH = 11, 0, 10
MOST = 65_536
"""Numbers in a message."""


class GenericClientServer:
    """Listens for one client, and moves a `SlowModel` as it asks.

    Parameters
    ----------
    model
        Whose targets the client gives.
    start
        m, of the plate: a client's displacements are from there.
    host, port
        Where to listen; 0 for any port that is free.

    Raises
    ------
    RigtwinError
        If nothing can listen there.
    """

    def __init__(
        self, model: SlowModel, start: float, host: str = "127.0.0.1", port: int = 8090
    ) -> None:
        self.fault = ""
        """What the client did that ended the connection, if it was not its end."""
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
        """Until a client has given its first target. Raises RigtwinError if none does."""
        if not self._begun.wait(seconds):
            why = self.fault or "none has connected, or it has not moved"
            raise RigtwinError(f"no client at port {self.port} within {seconds:g} s: {why}")

    def close(self) -> None:
        """Ends the model and the connection."""
        self._model.end()
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join(timeout=1.0)

    def _serve(self) -> None:
        with suppress(OSError):
            connection, _ = self._socket.accept()
            with closing(connection):
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                try:
                    self._answer(connection)
                except (OSError, RigtwinError) as error:
                    # The rig's own loop finds that no target comes, and ends the test.
                    self.fault = str(error)

    def _answer(self, connection: socket.socket) -> None:
        sizes = np.frombuffer(_receive(connection, 4 * SIZES), np.int32)
        length = int(sizes[LENGTH])
        if sizes[DISPLACEMENTS] != 1 or not 2 <= length <= MOST:
            wanted = f"{sizes[DISPLACEMENTS]} displacements in messages of {length} numbers"
            raise RigtwinError(f"a client with {wanted}: expected one in 2 to {MOST}")
        while True:
            message = np.frombuffer(_receive(connection, 8 * length), np.float64)
            asked = int(message[0]) if np.isfinite(message[0]) else 0
            reply = np.zeros(length)
            if asked == TRIAL:
                if not np.isfinite(message[1]):
                    raise RigtwinError("a client gave a displacement that is not a number")
                if not self._model.give(self._start + float(message[1])):
                    return
                self._begun.set()
            elif asked == FORCE:
                force = self._model.take_force()
                if force is None:
                    return
                # The client's equations have it on the side of what resists.
                reply[0] = -force
                connection.sendall(reply.tobytes())
            elif asked in MATRICES:
                connection.sendall(reply.tobytes())
            elif asked == END:
                self._model.end()
                return
            elif asked != COMMIT:
                raise RigtwinError(f"a client asked for {asked}: expected 3, 5, 10, 12 to 15, 99")


def _receive(connection: socket.socket, count: int) -> bytes:
    """So many bytes. Raises RigtwinError if the client goes before."""
    parts: list[bytes] = []
    while count > 0:
        part = connection.recv(min(count, 1 << 16))
        if not part:
            raise RigtwinError("the client closed the connection without an end")
        parts.append(part)
        count -= len(part)
    return b"".join(parts)
