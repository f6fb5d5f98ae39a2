"""Workers of a dask cluster, reached by its scheduler's address."""

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
"""Time a scheduler may take to answer, in s."""
PATIENCE = 60.0
"""Time without any worker after which a sweep gives up, in s."""
ADDRESS = re.compile(r"(?:[a-z]+://)?\[?(?P<host>[^\[\]/\s]+)\]?:(?P<port>\d+)/?")
RESUME_HINT = "finished results are stored, run again to continue"


def _run_if_same(digest: str, function: Callable[[Any], Any], argument: Any) -> Any:
    """Do a job on a worker, if the worker has the same sources."""
    worker_digest = source_digest()
    if worker_digest != digest:
        raise RigtwinError(
            "a worker of the cluster has another version of rigtwin: "
            f"sources {worker_digest}, expected {digest}"
        )
    return function(argument)


class _Remote:
    """Job on the cluster. Results are fetched in batches, since each request takes milliseconds."""

    def __init__(self, future: Any) -> None:
        self.future = future
        self.results: list[Any] = []

    def result(self) -> Any:
        return self.results[0] if self.results else self.future.result()

    def cancel(self) -> None:
        self.future.cancel()

    def add_done_callback(self, fn: Callable[[Any], Any], /) -> None:
        self.future.add_done_callback(lambda _: fn(self))


def _check_scheduler(address: str) -> None:
    """Raise RigtwinError unless a server listens at an address.

    dask's own client takes long to notice, and logs complaints when it is closed.
    """
    parts = ADDRESS.fullmatch(address)
    expected = "expected a scheduler's address, such as tcp://host:8786"
    if parts is None:
        raise RigtwinError(f"no cluster at {address!r}: {expected}")
    try:
        with socket.create_connection((parts["host"], int(parts["port"])), ANSWERS):
            pass
    except (OSError, OverflowError, UnicodeError) as error:
        said = getattr(error, "strerror", None) or error
        raise RigtwinError(f"no cluster at {address}: {said}; {expected}") from None


class Cluster:
    """Workers of a dask cluster.

    Parameters
    ----------
    address : str
        Address of the scheduler, such as tcp://host:8786.

    Raises
    ------
    RigtwinError
        If the package is missing, the scheduler does not answer, or the cluster has no workers.
    """

    ahead = 16
    """Jobs submitted per thread. A job spends tens of milliseconds in transit."""

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
            from distributed.scheduler import KilledWorker
        except ImportError:
            missing = "--cluster needs dask.distributed: pip install 'rigtwin[cluster]'"
            raise RigtwinError(missing) from None
        self.lost: tuple[type[BaseException], ...] = (KilledWorker,)
        self.address = address
        _check_scheduler(address)
        try:
            self._client = Client(address, timeout=ANSWERS, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            said = str(error).splitlines()[0] if str(error) else "no answer"
            expected = "expected a scheduler's address, such as tcp://host:8786"
            raise RigtwinError(f"no cluster at {address}: {said}; {expected}") from None
        self._run = uuid4().hex
        self._submitted = 0
        # Keys carry a random prefix: dask would return an earlier sweep's result for an equal key.
        self._ready: deque[_Remote] = deque()
        if not self.capacity:
            self._client.close()
            start = f"start some: dask worker {address} --nthreads 1"
            raise RigtwinError(f"the cluster at {address} has no workers; {start}")

    @property
    def capacity(self) -> int:
        """Number of threads of all workers."""
        return sum(self._client.nthreads().values())

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Any:
        """Submit a job to the cluster."""
        self._submitted += 1
        key = f"rigtwin-{self._run}-{self._submitted}"
        job = (_run_if_same, source_digest(), function, argument)
        return _Remote(self._client.submit(*job, key=key, pure=False))

    def next(self, finished: SimpleQueue[Any]) -> Any:
        """Wait for the next finished job, and fetch the results of all finished jobs."""
        if not self._ready:
            # At least one job must be finished before a batch is fetched.
            self._ready.append(self._wait(finished))
            with suppress(Empty):
                while True:
                    self._ready.append(finished.get_nowait())
            good = [job for job in self._ready if job.future.status == "finished"]
            with suppress(Exception):
                # If the batch fails, result() of the failed job raises its own error later.
                results: Any = self._client.gather([job.future for job in good])
                for job, result in zip(good, results, strict=True):
                    job.results.append(result)
        return self._ready.popleft()

    def _wait(self, finished: SimpleQueue[Any]) -> _Remote:
        """Wait for the next finished job, while the cluster has workers."""
        idle = 0.0
        while True:
            before = time.monotonic()
            try:
                # The queue is polled, because a scheduler that dies wakes nobody.
                return finished.get(timeout=2.0)
            except Empty:
                pass
            if self._client.status != "running":
                raise RigtwinError(f"the cluster at {self.address} is gone; {RESUME_HINT}")
            idle = 0.0 if self.capacity else idle + time.monotonic() - before
            if idle > PATIENCE:
                raise RigtwinError(
                    f"the cluster at {self.address} has no workers left; {RESUME_HINT}"
                )

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()
