"""Windows, by documented calls of kernel32, shell32, winmm and the C library.

Docstrings name the calls; learn.microsoft.com documents each of them.
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
_NORMAL, _REALTIME = 0x20, 0x100
"""NORMAL_ and REALTIME_PRIORITY_CLASS."""
_USUAL, _CRITICAL = 0, 15
"""THREAD_PRIORITY_NORMAL and _TIME_CRITICAL."""
_SYNCHRONIZE, _TERMINATE = 0x0010_0000, 0x0001
_ENDED = 0x0
"""WAIT_OBJECT_0."""
_GRAIN = 1
"""Finest resolution of the system's timers that can be requested, in ms."""

# time.monotonic has steps of 15.6 ms on Windows. perf_counter is QueryPerformanceCounter, which all
# processes share.
monotonic = time.perf_counter
RESOLUTION = time.get_clock_info("perf_counter").resolution


def _library(name: str) -> Any:
    """Return a system library that passes 64-bit handles unchanged."""
    library = getattr(ctypes, "WinDLL")(name, use_last_error=True)  # noqa: B009 - of Windows alone
    # By default ctypes takes results for 32-bit integers, and would cut off a handle.
    for call in ("GetCurrentProcess", "GetCurrentThread", "OpenProcess"):
        if name == "kernel32":
            getattr(library, call).restype = ctypes.c_void_p
    return library


def _handle(value: int | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(value)


def _reason() -> str:
    """Return the last error of Windows in words."""
    number = getattr(ctypes, "get_last_error")()  # noqa: B009 - of Windows alone
    return f"error {number} of Windows"


def lock_file(handle: int) -> None:
    """Lock a file for as long as it is open. Raise OSError if another program has locked it.

    `_locking` locks one byte far beyond the end, so that other programs can read the content.
    """
    msvcrt = import_module("msvcrt")
    os.lseek(handle, 1 << 30, os.SEEK_SET)
    # _locking starts at the file position, which is therefore set beyond the end and reset.
    try:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    finally:
        os.lseek(handle, 0, os.SEEK_SET)


@contextmanager
def no_interrupts() -> Iterator[None]:
    """Block Ctrl-C in this program, and permanently in processes started inside this context.

    SetConsoleCtrlHandler(NULL, TRUE) is inherited by new processes.
    """
    kernel = _library("kernel32")
    kernel.SetConsoleCtrlHandler(None, True)
    try:
        yield
    finally:
        kernel.SetConsoleCtrlHandler(None, False)


@contextmanager
def read_keys() -> Iterator[Callable[[], bool] | None]:
    """Provide a function that returns whether a key was pressed; None without a console.

    It calls `_kbhit` and `_getwch`.
    """
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
    """Ignore the signals that a console sends to all its programs."""
    _library("kernel32").SetConsoleCtrlHandler(None, True)
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def watch_process(number: int) -> Iterator[Callable[[float], bool]]:
    """Provide a function that waits up to some seconds for a process, and returns whether it ended.

    It calls OpenProcess, WaitForSingleObject and CloseHandle. Raises OSError if there is no such
    process.
    """
    kernel = _library("kernel32")
    opened = kernel.OpenProcess(_SYNCHRONIZE, False, number)
    if not opened:
        raise OSError(f"process {number}: {_reason()}")

    def ended(seconds: float) -> bool:
        # A wait of 0 ms would not wait at all, and take a core away from the loop.
        milliseconds = max(_GRAIN, round(1e3 * seconds))
        return kernel.WaitForSingleObject(_handle(opened), milliseconds) == _ENDED

    try:
        yield ended
    finally:
        kernel.CloseHandle(_handle(opened))


def kill_process(number: int) -> None:
    """Kill a process at once, if it exists: OpenProcess, TerminateProcess, CloseHandle."""
    kernel = _library("kernel32")
    opened = kernel.OpenProcess(_TERMINATE, False, number)
    if opened:
        kernel.TerminateProcess(_handle(opened), 1)
        kernel.CloseHandle(_handle(opened))


def freeze_process(number: int) -> None:
    """Raise RigtwinError: Windows documents no call that suspends a process."""
    raise RigtwinError(f"process {number}: Windows has no way to freeze it; leave this trial out")


def raise_signal(number: int) -> None:
    """Send a signal to this process."""
    signal.raise_signal(number)


@contextmanager
def limit_files() -> Iterator[Callable[[int], None]]:
    """Provide a function that raises RigtwinError: Windows cannot limit a program's files."""

    def limit(_: int) -> None:
        raise RigtwinError("Windows has no limit of a program's files; leave this trial out")

    yield limit


def lock_memory() -> Grant:
    """Return a refusal: VirtualLock locks given pages, not a whole program."""
    return Grant(MEMORY, "Windows locks no program as a whole; leave enough memory free")


def unlock_memory() -> None:
    """Do nothing: no memory was locked."""


def return_memory() -> None:
    """Do nothing: the heap returns free memory by itself."""


def raise_priority(priority: int) -> Grant:  # noqa: ARG001 - one class is all there is
    """Give this thread the highest priority.

    Calls SetPriorityClass and SetThreadPriority, and timeBeginPeriod for a fine timer.
    """
    kernel, timers = _library("kernel32"), _library("winmm")
    # By default a sleep may end up to 15.6 ms late.
    timers.timeBeginPeriod(_GRAIN)
    process = _handle(kernel.GetCurrentProcess())
    granted = kernel.SetPriorityClass(process, _REALTIME)
    # Without the privilege Windows silently grants the next lower class, so the result is checked.
    if not granted or kernel.GetPriorityClass(process) != _REALTIME:
        lower_priority()
        return Grant(SCHEDULING, "REALTIME_PRIORITY_CLASS refused; start it as administrator")
    if not kernel.SetThreadPriority(_handle(kernel.GetCurrentThread()), _CRITICAL):
        reason = _reason()
        lower_priority()
        return Grant(SCHEDULING, f"THREAD_PRIORITY_TIME_CRITICAL refused: {reason}")
    return Grant(SCHEDULING)


def lower_priority() -> None:
    """Return to normal priority."""
    kernel, timers = _library("kernel32"), _library("winmm")
    kernel.SetThreadPriority(_handle(kernel.GetCurrentThread()), _USUAL)
    kernel.SetPriorityClass(_handle(kernel.GetCurrentProcess()), _NORMAL)
    timers.timeEndPeriod(_GRAIN)


def count_cores() -> int:
    """Return the number of cores of this computer."""
    return os.cpu_count() or 1


def cache_folder() -> Path:
    """Return the folder for the user's cached files."""
    return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")


def is_superuser() -> bool:
    """Return whether this program runs as administrator (IsUserAnAdmin)."""
    return bool(_library("shell32").IsUserAnAdmin())
