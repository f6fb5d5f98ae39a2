"""Linux and macOS."""

from __future__ import annotations

import ctypes
import ctypes.util
import fcntl
import os
import resource
import select
import signal
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from pathlib import Path

from rigtwin.system.grant import MEMORY, SCHEDULING, Grant

STOP_SIGNALS: tuple[int, ...] = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGTSTP,
)
RENDERER = "egl" if sys.platform == "linux" else "glfw"
_MCL_CURRENT, _MCL_FUTURE = 1, 2

monotonic = time.monotonic
RESOLUTION = time.get_clock_info("monotonic").resolution


def lock_file(handle: int) -> None:
    """Makes a file this program's own for as long as it is open; OSError if it is another's."""
    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def no_interrupts() -> Iterator[None]:
    """Keeps Ctrl-C from this thread, and from processes that are started meanwhile for good."""
    # It is started with the first process, and lets interruptions through when it is.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def read_keys() -> Iterator[Callable[[], bool] | None]:
    """Gives a function that takes a key of the terminal, if one was pressed; None where there is no
    terminal."""
    try:
        terminal = sys.stdin.fileno() if sys.stdin and sys.stdin.isatty() else None
        ours = terminal is not None and os.getpgrp() == os.tcgetpgrp(terminal)
    except OSError:
        terminal, ours = None, False
    if terminal is None or not ours:
        yield None
        return
    before = termios.tcgetattr(terminal)
    tty.setcbreak(terminal)

    def pressed() -> bool:
        if not select.select([sys.stdin], [], [], 0.0)[0]:
            return False
        sys.stdin.read(1)
        return True

    try:
        yield pressed
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def leave_terminal() -> None:
    """What a terminal sends to all its programs, this one gets no more: Ctrl-C, Ctrl-Z, hanging
    up."""
    with suppress(OSError):
        os.setsid()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def watch_process(number: int) -> Iterator[Callable[[float], bool]]:
    """Gives a function that waits up to some seconds for a process to end, and says if it has. Only
    this process' own parent is looked for where the system has no handles of processes."""
    if not hasattr(os, "pidfd_open"):

        def ended(seconds: float) -> bool:
            time.sleep(seconds)
            return os.getppid() != number

        yield ended
        return
    handle = os.pidfd_open(number)
    try:
        yield lambda seconds: bool(select.select([handle], [], [], seconds)[0])
    finally:
        os.close(handle)


def kill_process(number: int) -> None:
    """Ends a process at once, if it is there."""
    with suppress(ProcessLookupError):
        os.kill(number, signal.SIGKILL)


def freeze_process(number: int) -> None:
    """Stops a process where it is, for a trial of what watches it."""
    os.kill(number, signal.SIGSTOP)


def raise_signal(number: int) -> None:
    """Sends a signal to this process."""
    os.kill(os.getpid(), number)


@contextmanager
def limit_files() -> Iterator[Callable[[int], None]]:
    """Gives a function after which no file of this program grows beyond some bytes, as on a full
    disk; for a trial."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(ctypes.util.find_library("c"), use_errno=True)


def lock_memory() -> Grant:
    """Keeps all memory of this program in memory."""
    if sys.platform != "linux":
        return Grant(MEMORY, f"not known how on {sys.platform}")
    if _libc().mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        reason = os.strerror(ctypes.get_errno())
        return Grant(MEMORY, f"{reason}; raise it with: ulimit -l unlimited")
    return Grant(MEMORY)


def unlock_memory() -> None:
    """Takes it back."""
    _libc().munlockall()


def return_memory() -> None:
    """Gives back what the program has freed, which the C library may keep for itself."""
    trim = getattr(_libc(), "malloc_trim", None)
    if trim is not None:
        trim(0)


def raise_priority(priority: int) -> Grant:
    """Puts this thread before all others of the computer but those above it. priority: 1 to 99."""
    if not hasattr(os, "sched_setscheduler"):
        return Grant(SCHEDULING, f"not known how on {sys.platform}")
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        allow = f"allow it with: ulimit -r {priority}, or CAP_SYS_NICE"
        return Grant(SCHEDULING, f"{error.strerror}; {allow}")
    return Grant(SCHEDULING)


def lower_priority() -> None:
    """Takes it back."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def count_cores() -> int:
    """That this program may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cache_folder() -> Path:
    """Where this user's programs keep what they can make again."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def is_superuser() -> bool:
    """Whether this program runs as root."""
    return os.geteuid() == 0
