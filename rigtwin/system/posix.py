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
    # Ctrl-Z would suspend the loop while the rig moves.
    signal.SIGTSTP,
)
RENDERER = "egl" if sys.platform == "linux" else "glfw"
_MCL_CURRENT, _MCL_FUTURE = 1, 2

monotonic = time.monotonic
RESOLUTION = time.get_clock_info("monotonic").resolution


def lock_file(handle: int) -> None:
    """Lock a file for as long as it is open. Raise OSError if another program has locked it."""
    # flock belongs to the open file, and ends with it, also when the program is killed.
    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def no_interrupts() -> Iterator[None]:
    """Block Ctrl-C in this thread, and permanently in processes started inside this context."""
    # Starting the first process also starts the resource tracker, which unblocks SIGINT again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        # A process inherits the signal mask of the thread that starts it.
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def read_keys() -> Iterator[Callable[[], bool] | None]:
    """Provide a function that returns whether a key was pressed; None without a terminal."""
    try:
        terminal = sys.stdin.fileno() if sys.stdin and sys.stdin.isatty() else None
        # A background process must not read the terminal: the system would stop it (SIGTTIN).
        ours = terminal is not None and os.getpgrp() == os.tcgetpgrp(terminal)
    except OSError:
        terminal, ours = None, False
    if terminal is None or not ours:
        yield None
        return
    before = termios.tcgetattr(terminal)
    # Without canonical mode a key arrives without Enter.
    # Cbreak rather than raw mode: Ctrl-C must still send its signal.
    tty.setcbreak(terminal)

    def pressed() -> bool:
        if not select.select([sys.stdin], [], [], 0.0)[0]:
            return False
        # Consumed, so that the shell does not get the key after the test.
        sys.stdin.read(1)
        return True

    try:
        yield pressed
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def leave_terminal() -> None:
    """Detach from the terminal, so that Ctrl-C, Ctrl-Z and hang-up do not reach this process."""
    # setsid refuses the leader of a process group; the signals are ignored in any case.
    with suppress(OSError):
        os.setsid()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def watch_process(number: int) -> Iterator[Callable[[float], bool]]:
    """Provide a function that waits up to some seconds for a process, and returns whether it ended.

    Without process handles (pidfd, Linux only) just the parent process can be watched.
    """
    if not hasattr(os, "pidfd_open"):
        # An orphan gets another parent.
        def ended(seconds: float) -> bool:
            time.sleep(seconds)
            return os.getppid() != number

        yield ended
        return
    # A handle refers to this process even if its number is used again.
    handle = os.pidfd_open(number)
    try:
        yield lambda seconds: bool(select.select([handle], [], [], seconds)[0])
    finally:
        os.close(handle)


def kill_process(number: int) -> None:
    """Kill a process at once, if it exists."""
    with suppress(ProcessLookupError):
        os.kill(number, signal.SIGKILL)


def freeze_process(number: int) -> None:
    """Suspend a process, to test what watches it."""
    os.kill(number, signal.SIGSTOP)


def raise_signal(number: int) -> None:
    """Send a signal to this process."""
    os.kill(os.getpid(), number)


@contextmanager
def limit_files() -> Iterator[Callable[[int], None]]:
    """Provide a function that limits the size of this program's files in bytes, as a full disk.

    It is used in tests.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(ctypes.util.find_library("c"), use_errno=True)


def lock_memory() -> Grant:
    """Lock the memory of this program, so that no page has to be loaded from disk."""
    if sys.platform != "linux":
        return Grant(MEMORY, f"not known how on {sys.platform}")
    # ctypes keeps errno per thread only with use_errno.
    if _libc().mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        reason = os.strerror(ctypes.get_errno())
        return Grant(MEMORY, f"{reason}; raise it with: ulimit -l unlimited")
    return Grant(MEMORY)


def unlock_memory() -> None:
    """Unlock the memory."""
    _libc().munlockall()


def return_memory() -> None:
    """Return freed memory to the system, which the C library might keep."""
    trim = getattr(_libc(), "malloc_trim", None)
    if trim is not None:
        trim(0)


def raise_priority(priority: int) -> Grant:
    """Give this thread FIFO scheduling with a priority from 1 to 99."""
    if not hasattr(os, "sched_setscheduler"):
        return Grant(SCHEDULING, f"not known how on {sys.platform}")
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        allow = f"allow it with: ulimit -r {priority}, or CAP_SYS_NICE"
        return Grant(SCHEDULING, f"{error.strerror}; {allow}")
    return Grant(SCHEDULING)


def lower_priority() -> None:
    """Return to normal scheduling."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def count_cores() -> int:
    """Return the number of cores that this program may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cache_folder() -> Path:
    """Return the folder for the user's cached files."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def is_superuser() -> bool:
    """Return whether this program runs as root."""
    return os.geteuid() == 0
