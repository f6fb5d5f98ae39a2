"""The workers of a dask cluster, by its scheduler's address."""

from __future__ import annotations

import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any
from uuid import uuid4

from rigtwin.errors import RigtwinError
from rigtwin.sweep.digest import source_digest

ANSWERS = 5.0
"""s that a scheduler may take to answer."""
PATIENCE = 60.0
"""s without any worker until a sweep gives up."""


def _same(digest: str, function: Callable[[Any], Any], argument: Any) -> Any:
    """On a worker: the job, if the worker has the same sources."""
    here = source_digest()
    if here != digest:
        raise RigtwinError(f"a worker of the cluster has another version of rigtwin: sources {here}, here {digest}")
    return function(argument)


class Cluster:
    """Raises RigtwinError if the package is missing, nobody answers, or it has no workers."""

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
            from distributed.scheduler import KilledWorker
        except ImportError:
            raise RigtwinError("--cluster needs dask.distributed: pip install 'rigtwin[cluster]'") from None
        self.lost: tuple[type[BaseException], ...] = (KilledWorker,)
        self.address = address
        try:
            self._client = Client(address, timeout=ANSWERS, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            said = str(error).splitlines()[0] if str(error) else "no answer"
            raise RigtwinError(
                f"no cluster at {address}: {said}; expected a scheduler's address, such as tcp://host:8786"
            ) from None
        self._run = uuid4().hex
        self._given = 0
        if not self.capacity:
            self._client.close()
            raise RigtwinError(f"the cluster at {address} has no workers; start some: dask worker {address} --nthreads 1")

    @property
    def capacity(self) -> int:
        return sum(self._client.nthreads().values())

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Any:
        self._given += 1
        return self._client.submit(
            _same, source_digest(), function, argument, key=f"rigtwin-{self._run}-{self._given}", pure=False
        )

    def next(self, finished: SimpleQueue[Any]) -> Any:
        alone = 0.0
        while True:
            before = time.monotonic()
            try:
                return finished.get(timeout=2.0)
            except Empty:
                pass
            if self._client.status != "running":
                raise RigtwinError(f"the cluster at {self.address} is gone; what is done is kept, run again to go on")
            alone = 0.0 if self.capacity else alone + time.monotonic() - before
            if alone > PATIENCE:
                raise RigtwinError(
                    f"the cluster at {self.address} has no workers left; what is done is kept, run again to go on"
                )

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._client.close()
