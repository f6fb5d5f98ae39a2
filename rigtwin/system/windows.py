"""Windows, by the documented calls of kernel32, shell32, winmm and the C library.

Each call is named where it is made; learn.microsoft.com has a page of each.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from rigtwin.errors import RigtwinError
from rigtwin.system.grant import MEMORY, SCHEDULING, Grant

STOP_SIGNALS: tuple[int, ...] = tuple(
    int(getattr(signal, name))
    for name in ("SIGINT", "SIGTERM", "SIGBREAK")
    if hasattr(signal, name)
)
RENDERER = "glfw"
_NORMAL, _HIGH, _REALTIME = 0x20, 0x80, 0x100
"""NORMAL_, HIGH_ and REALTIME_PRIORITY_CLASS."""
_USUAL, _CRITICAL = 0, 15
"""THREAD_PRIORITY_NORMAL and _TIME_CRITICAL."""
_SYNCHRONIZE, _TERMINATE = 0x0010_0000, 0x0001
_ENDED, _RUNS = 0x0, 0x102
"""WAIT_OBJECT_0 and WAIT_TIMEOUT."""
_GRAIN = 1
"""ms: the finest grain of the system's timers that can be asked for."""

# Of time.monotonic the steps are 15.6 ms here; this is QueryPerformanceCounter, one for all
# processes.
monotonic = time.perf_counter
RESOLUTION = time.get_clock_info("perf_counter").resolution


def _library(name: str) -> Any:
    """A system library; 64-bit handles go through as they are."""
    library = getattr(ctypes, "WinDLL")(name, use_last_error=True)  # noqa: B009 - of Windows alone
    for call in ("GetCurrentProcess", "GetCurrentThread", "OpenProcess"):
        if name == "kernel32":
            getattr(library, call).restype = ctypes.c_void_p
    return library


def _handle(value: int | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(value)


def _reason() -> str:
    number = getattr(ctypes, "get_last_error")()  # noqa: B009 - of Windows alone
    return f"error {number} of Windows"


def lock_file(handle: int) -> None:
    """Makes a file this program's own for as long as it is open; OSError if it is another's.

    `_locking` of one byte far behind the end, so that others may read what is there.
    """
    msvcrt = import_module("msvcrt")
    os.lseek(handle, 1 << 30, os.SEEK_SET)
    try:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    finally:
        os.lseek(handle, 0, os.SEEK_SET)


@contextmanager
def no_interrupts() -> Iterator[None]:
    """Keeps Ctrl-C from this program, and from processes that are started meanwhile for good.

    SetConsoleCtrlHandler(NULL, TRUE), which new processes inherit.
    """
    kernel = _library("kernel32")
    kernel.SetConsoleCtrlHandler(None, True)
    try:
        yield
    finally:
        kernel.SetConsoleCtrlHandler(None, False)


@contextmanager
def read_keys() -> Iterator[Callable[[], bool] | None]:
    """Gives a function that takes a key of the console, if one was pressed; None where there is no
    console. `_kbhit`, `_getwch`."""
    if not (sys.stdin and sys.stdin.isatty()):
        yield None
        return
    msvcrt = import_module("msvcrt")

    def pressed() -> bool:
        if not msvcrt.kbhit():
            return False
        msvcrt.getwch()
        return True

    yield pressed


def leave_terminal() -> None:
    """What a console sends to all its programs, this one gets no more."""
    _library("kernel32").SetConsoleCtrlHandler(None, True)
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def watch_process(number: int) -> Iterator[Callable[[float], bool]]:
    """Gives a function that waits up to some seconds for a process to end, and says if it has.

    OpenProcess, WaitForSingleObject, CloseHandle. Raises OSError if there is no such process.
    """
    kernel = _library("kernel32")
    opened = kernel.OpenProcess(_SYNCHRONIZE, False, number)
    if not opened:
        raise OSError(f"process {number}: {_reason()}")

    def ended(seconds: float) -> bool:
        # A wait of 0 ms does not wait at all, and would leave no core to the loop.
        milliseconds = max(_GRAIN, round(1e3 * seconds))
        return kernel.WaitForSingleObject(_handle(opened), milliseconds) == _ENDED

    try:
        yield ended
    finally:
        kernel.CloseHandle(_handle(opened))


def kill_process(number: int) -> None:
    """Ends a process at once, if it is there. OpenProcess, TerminateProcess, CloseHandle."""
    kernel = _library("kernel32")
    opened = kernel.OpenProcess(_TERMINATE, False, number)
    if opened:
        kernel.TerminateProcess(_handle(opened), 1)
        kernel.CloseHandle(_handle(opened))


def freeze_process(number: int) -> None:
    """Raises RigtwinError: Windows documents no such call."""
    raise RigtwinError(f"process {number}: Windows has no way to freeze it; leave this trial out")


def raise_signal(number: int) -> None:
    """Sends a signal to this process."""
    signal.raise_signal(number)


@contextmanager
def limit_files() -> Iterator[Callable[[int], None]]:
    """Gives a function that raises RigtwinError: Windows has no limit of a program's files."""

    def limit(_: int) -> None:
        raise RigtwinError("Windows has no limit of a program's files; leave this trial out")

    yield limit


def lock_memory() -> Grant:
    """Says that there is none: VirtualLock locks given pages, not a program."""
    return Grant(MEMORY, "Windows locks no program as a whole; leave enough memory free")


def unlock_memory() -> None:
    """Nothing was locked."""


def return_memory() -> None:
    """Nothing: the heap gives back what is free by itself."""


def raise_priority(priority: int) -> Grant:  # noqa: ARG001 - one class is all there is
    """Puts this thread before all others: SetPriorityClass, SetThreadPriority; timeBeginPeriod."""
    kernel, timers = _library("kernel32"), _library("winmm")
    timers.timeBeginPeriod(_GRAIN)
    here = _handle(kernel.GetCurrentProcess())
    granted = kernel.SetPriorityClass(here, _REALTIME)
    # Without the right to it Windows gives the class below, and says that all went well.
    if not granted or kernel.GetPriorityClass(here) != _REALTIME:
        lower_priority()
        return Grant(SCHEDULING, "REALTIME_PRIORITY_CLASS refused; start it as administrator")
    if not kernel.SetThreadPriority(_handle(kernel.GetCurrentThread()), _CRITICAL):
        reason = _reason()
        lower_priority()
        return Grant(SCHEDULING, f"THREAD_PRIORITY_TIME_CRITICAL refused: {reason}")
    return Grant(SCHEDULING)


def lower_priority() -> None:
    """Takes it back."""
    kernel, timers = _library("kernel32"), _library("winmm")
    kernel.SetThreadPriority(_handle(kernel.GetCurrentThread()), _USUAL)
    kernel.SetPriorityClass(_handle(kernel.GetCurrentProcess()), _NORMAL)
    timers.timeEndPeriod(_GRAIN)


def count_cores() -> int:
    """That this computer has."""
    return os.cpu_count() or 1


def cache_folder() -> Path:
    """Where this user's programs keep what they can make again."""
    return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")


def is_superuser() -> bool:
    """Whether this program runs as administrator. IsUserAnAdmin."""
    return bool(_library("shell32").IsUserAnAdmin())
