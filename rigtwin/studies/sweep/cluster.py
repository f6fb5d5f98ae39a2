"""The workers of a dask cluster, by its scheduler's address."""

from __future__ import annotations

import re
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep.digest import source_digest

ANSWERS = 5.0
"""s that a scheduler may take to answer."""
PATIENCE = 60.0
"""s without any worker until a sweep gives up."""
ADDRESS = re.compile(r"(?:[a-z]+://)?\[?(?P<host>[^\[\]/\s]+)\]?:(?P<port>\d+)/?")
KEPT = "what is done is kept, run again to go on"


def _run_if_same(digest: str, function: Callable[[Any], Any], argument: Any) -> Any:
    """On a worker: do the job, if the worker has the same sources."""
    here = source_digest()
    if here != digest:
        told = f"sources {here}, here {digest}"
        raise RigtwinError(f"a worker of the cluster has another version of rigtwin: {told}")
    return function(argument)


class _Remote:
    """A job at the cluster. Results are fetched together, since each fetch is milliseconds."""

    def __init__(self, future: Any) -> None:
        self.future = future
        self.results: list[Any] = []

    def result(self) -> Any:
        return self.results[0] if self.results else self.future.result()

    def cancel(self) -> None:
        self.future.cancel()

    def add_done_callback(self, fn: Callable[[Any], Any], /) -> None:
        self.future.add_done_callback(lambda _: fn(self))


def _knock(address: str) -> None:
    """Raises RigtwinError unless something listens there: dask's own client takes long to find out,
    and complains again when it ends."""
    found = ADDRESS.fullmatch(address)
    expected = "expected a scheduler's address, such as tcp://host:8786"
    if found is None:
        raise RigtwinError(f"no cluster at {address!r}: {expected}")
    try:
        with socket.create_connection((found["host"], int(found["port"])), ANSWERS):
            pass
    except (OSError, OverflowError, UnicodeError) as error:
        said = getattr(error, "strerror", None) or error
        raise RigtwinError(f"no cluster at {address}: {said}; {expected}") from None


class Cluster:
    """The workers of a cluster.

    Parameters
    ----------
    address : str
        Of the scheduler, such as tcp://host:8786.

    Raises
    ------
    RigtwinError
        If the package is missing, nobody answers, or the cluster has no workers.
    """

    ahead = 16
    """A job is tens of milliseconds on its way."""

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
            from distributed.scheduler import KilledWorker
        except ImportError:
            missing = "--cluster needs dask.distributed: pip install 'rigtwin[cluster]'"
            raise RigtwinError(missing) from None
        self.lost: tuple[type[BaseException], ...] = (KilledWorker,)
        self.address = address
        _knock(address)
        try:
            self._client = Client(address, timeout=ANSWERS, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            said = str(error).splitlines()[0] if str(error) else "no answer"
            expected = "expected a scheduler's address, such as tcp://host:8786"
            raise RigtwinError(f"no cluster at {address}: {said}; {expected}") from None
        self._run = uuid4().hex
        self._given = 0
        self._ready: deque[_Remote] = deque()
        if not self.capacity:
            self._client.close()
            start = f"start some: dask worker {address} --nthreads 1"
            raise RigtwinError(f"the cluster at {address} has no workers; {start}")

    @property
    def capacity(self) -> int:
        """Threads of all workers."""
        return sum(self._client.nthreads().values())

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Any:
        """Give a job to the cluster."""
        self._given += 1
        key = f"rigtwin-{self._run}-{self._given}"
        job = (_run_if_same, source_digest(), function, argument)
        return _Remote(self._client.submit(*job, key=key, pure=False))

    def next(self, finished: SimpleQueue[Any]) -> Any:
        """Wait for the next job that is done, and fetch all that are done with it."""
        if not self._ready:
            self._ready.append(self._wait(finished))
            with suppress(Empty):
                while True:
                    self._ready.append(finished.get_nowait())
            good = [one for one in self._ready if one.future.status == "finished"]
            with suppress(Exception):
                # What cannot be fetched together says why when it is asked for alone.
                results: Any = self._client.gather([one.future for one in good])
                for one, result in zip(good, results, strict=True):
                    one.results.append(result)
        return self._ready.popleft()

    def _wait(self, finished: SimpleQueue[Any]) -> _Remote:
        """Wait for the next job that is done."""
        alone = 0.0
        while True:
            before = time.monotonic()
            try:
                return finished.get(timeout=2.0)
            except Empty:
                pass
            if self._client.status != "running":
                raise RigtwinError(f"the cluster at {self.address} is gone; {KEPT}")
            alone = 0.0 if self.capacity else alone + time.monotonic() - before
            if alone > PATIENCE:
                raise RigtwinError(f"the cluster at {self.address} has no workers left; {KEPT}")

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()
