"""Access to the NI-DAQmx driver, on this computer or behind a gRPC device server."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rigtwin.errors import RigtwinError

if TYPE_CHECKING:
    import grpc

DRIVER = (
    "install NI-DAQmx from ni.com, or name a gRPC device server in the channel table: card.address"
)
PACKAGE = "the nidaqmx package is missing; pip install 'rigtwin[daq]'"


class CardFault(RigtwinError):
    """Error for a card, driver or connection that does not do what it was asked."""


@contextmanager
def translate_errors(doing: str) -> Iterator[None]:
    """Raise errors of nidaqmx as a CardFault with a message of one line."""
    # Imported here, like everywhere below: the package is optional, and only a card needs it.
    from nidaqmx.errors import DaqNotFoundError, DaqNotSupportedError, Error, RpcError

    try:
        yield
    # All errors of nidaqmx are subclasses of Error, so the special ones come first.
    except (DaqNotFoundError, DaqNotSupportedError):
        raise CardFault(f"the NI-DAQmx driver is missing on this computer; {DRIVER}") from None
    except RpcError as error:
        raise CardFault(f"{doing}: {str(error).splitlines()[0]}") from None
    except Error as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        raise CardFault(f"{doing}: {' '.join(lines[:4])}") from None
    except (AssertionError, ValueError, TypeError) as error:
        # nidaqmx raises these from its own checks of a card's answer.
        raise CardFault(
            f"{doing}: unexpected answer of the card, which the driver's client rejects: "
            f"{error or type(error).__name__}"
        ) from None


def require_client() -> None:
    """Raise CardFault unless the driver's client and the virtual card's packages are installed."""
    try:
        import grpc  # noqa: F401
        import nidaqmx  # noqa: F401
    except ImportError:
        raise CardFault(PACKAGE) from None


def connect(address: str) -> grpc.Channel | None:
    """Return the connection to a gRPC device server, or None for this computer's driver.

    Raises
    ------
    CardFault
        If the client is not installed.
    """
    require_client()
    if not address:
        return None
    import grpc

    # The client's calls have no timeout of their own. Keepalive pings end a call to a server that
    # is frozen, or whose network is gone.
    alive = (
        ("grpc.keepalive_time_ms", 1000),
        ("grpc.keepalive_timeout_ms", 1000),
        ("grpc.http2.max_pings_without_data", 0),
    )
    # The server is on the laboratory's own network; NI's server has no encryption by default.
    return grpc.insecure_channel(address, options=alive)
