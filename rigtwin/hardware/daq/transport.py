"""Transport of an unmodified nidaqmx client's calls to a virtual card.

nidaqmx can use NI's gRPC device server in place of a driver. `InProcess` is such a connection that
ends in a Python object. `serve` listens on a port, so that any NI-DAQmx gRPC client can use the
twin as its card.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NoReturn

import grpc
from google.protobuf.message import Message

from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.virtual import DriverError, VirtualCard

SERVICE = "nidaqmx_grpc.NiDAQmx"
LOCAL = "127.0.0.1"
"""Numerical address: a host name could resolve to an address nobody listens on."""


class CardError(grpc.RpcError):
    """Driver error in the form of a gRPC error."""

    def __init__(self, status: grpc.StatusCode, message: str, number: int | None = None) -> None:
        super().__init__(message)
        self._status, self._message, self._number = status, message, number

    def code(self) -> grpc.StatusCode:
        return self._status

    def details(self) -> str:
        return self._message

    def trailing_metadata(self) -> Any:
        """Return the driver's error code where nidaqmx looks for it."""
        return [_Entry("ni-error", str(self._number))] if self._number is not None else []


class _Entry:
    def __init__(self, key: str, value: str) -> None:
        self.key, self.value = key, value


class InProcess(grpc.Channel):
    """gRPC channel to a card in this process. Messages are passed on without serialisation."""

    def __init__(self, card: VirtualCard) -> None:
        self._card = card

    def unary_unary(
        self, method: str, *_: Any, response_deserializer: Any = None, **__: Any
    ) -> Any:  # type: ignore[override]
        # nidaqmx passes the bound method FromString: its owner is the class of the response.
        call, card, response = method.rsplit("/", 1)[1], self._card, response_deserializer.__self__

        def invoke(request: Message, **_: object) -> Message:
            try:
                return card.answer(call, request, response)
            except DriverError as error:
                raise CardError(grpc.StatusCode.UNKNOWN, str(error), error.code) from None
            except RigtwinError as error:
                raise CardError(grpc.StatusCode.UNIMPLEMENTED, str(error)) from None

        return invoke

    def unary_stream(self, *_: object, **__: object) -> Any:
        """Refuse events, which the virtual card does not send."""

        def refuse(*_: object, **__: object) -> NoReturn:
            raise CardError(grpc.StatusCode.UNIMPLEMENTED, "the virtual card sends no events")

        return refuse

    stream_unary = stream_stream = unary_stream

    def subscribe(
        self, callback: Callable[..., Any], try_to_connect: bool | None = False
    ) -> None: ...

    def unsubscribe(self, callback: Callable[..., Any]) -> None: ...

    def close(self) -> None: ...

    def __enter__(self) -> InProcess:
        return self

    def __exit__(self, *_: object) -> None: ...


class _CallHandler(grpc.GenericRpcHandler):
    """Handler of every call of the service, looked up by name."""

    def __init__(self, card: VirtualCard) -> None:
        # Only nidaqmx contains the compiled messages of NI's service.
        from nidaqmx._grpc_interpreter import grpc_types

        self._card, self._messages = card, grpc_types

    def service(
        self, handler_call_details: grpc.HandlerCallDetails
    ) -> grpc.RpcMethodHandler | None:
        service, _, call = handler_call_details.method.strip("/").partition("/")
        # Messages are named after their call: CreateTaskRequest, CreateTaskResponse.
        request, response = (
            getattr(self._messages, call + ending, None) for ending in ("Request", "Response")
        )
        if service != SERVICE or request is None or response is None:
            return None

        def invoke(message: Message, context: grpc.ServicerContext) -> Any:
            try:
                return self._card.answer(call, message, response)
            except DriverError as error:
                context.set_trailing_metadata((("ni-error", str(error.code)),))
                context.abort(grpc.StatusCode.UNKNOWN, str(error))
            except RigtwinError as error:
                context.abort(grpc.StatusCode.UNIMPLEMENTED, str(error))

        return grpc.unary_unary_rpc_method_handler(
            invoke,
            request_deserializer=request.FromString,
            response_serializer=response.SerializeToString,
        )


def serve(card: VirtualCard, port: int) -> tuple[grpc.Server, int]:
    """Serve a card on this computer only; port 0 selects a free port.

    Returns
    -------
    tuple of server and int
        The running server, and its port.

    Raises
    ------
    RigtwinError
        If the port is in use.
    """
    # A refused call is an answer to the client, not an error of the server.
    logging.getLogger("grpc").setLevel(logging.CRITICAL)
    server = grpc.server(
        # A read occupies its thread until the sample exists; others must be free to answer
        # writes.
        ThreadPoolExecutor(max_workers=8),
        handlers=[_CallHandler(card)],
        # Without this, Linux lets two servers share a port, and calls reach either of them.
        options=(("grpc.so_reuseport", 0),),
    )
    try:
        bound = server.add_insecure_port(f"{LOCAL}:{port}")
    except RuntimeError:
        bound = 0
    if bound == 0:
        raise RigtwinError(f"port {port} is in use; expected a free one")
    server.start()
    return server, bound
