"""The two sides of what depends on the operating system: POSIX as it is here, Windows against
stand-ins of its documented calls."""

from __future__ import annotations

import ast
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from rigtwin import system
from rigtwin.errors import RigtwinError
from rigtwin.system import posix, windows

SOURCES = Path(system.__file__).parents[1]
POSIX_ALONE = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "select", "termios", "tty"}
WINDOWS_ALONE = {"_winapi", "msvcrt", "winreg"}
ASKING = {
    *("getppid", "setsid", "pidfd_open", "geteuid", "getpgrp", "tcgetpgrp", "uname", "killpg"),
    *("sched_setscheduler", "sched_getaffinity", "platform", "pthread_sigmask", "kill"),
    *("SIGKILL", "SIGSTOP", "SIGHUP", "SIGQUIT", "SIGBREAK", "WinDLL", "CDLL"),
}
"""Attributes of `os`, `sys`, `signal`, `time` and `ctypes` that differ between systems."""


def test_both_sides_have_the_same_names() -> None:
    names = {name for name in vars(system) if not name.startswith("_")}
    names -= {"sys", "posix", "windows", "grant"}
    for side in (posix, windows):
        assert not [name for name in names if not hasattr(side, name)]


def test_nothing_else_asks_which_system_it_is_on() -> None:
    paths = [path for path in SOURCES.rglob("*.py") if path.parent.name != "system"]
    assert len(paths) > 100
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text())):
            names: list[str] = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            of_one = {name.split(".")[0] for name in names} & (POSIX_ALONE | WINDOWS_ALONE)
            assert not of_one, f"{path}: {of_one}"
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                owner, message = node.value.id, f"{path}: {node.value.id}.{node.attr}"
                # Steps of 15.6 ms on Windows; processes that watch each other need one clock.
                clock = (owner, node.attr) == ("time", "monotonic")
                assert not (clock and "hardware" in path.parts), message
                assert owner not in ("os", "sys", "signal", "ctypes") or node.attr not in ASKING, (
                    message
                )


ON_WINDOWS = """
import importlib, os, pkgutil, signal, sys, types
import rigtwin

def import_all():
    for found in pkgutil.walk_packages(rigtwin.__path__, "rigtwin."):
        if not found.name.endswith(("__main__", "system.posix")):
            importlib.import_module(found.name)

# What others have written is imported as it is here, ours once more as on Windows.
import_all()
OURS = ("rigtwin", "controllers", "experiments", "machines")
for name in [name for name in sys.modules if name.split(".")[0] in OURS]:
    del sys.modules[name]
for name in ("fcntl", "grp", "pwd", "resource", "termios", "tty"):
    sys.modules[name] = None
for owner, names in (
    (os, ("getppid", "setsid", "pidfd_open", "geteuid", "getpgrp", "tcgetpgrp",
          "sched_setscheduler", "sched_getaffinity", "O_NONBLOCK")),
    (signal, ("pthread_sigmask", "SIGKILL", "SIGSTOP", "SIGHUP", "SIGQUIT", "SIGTSTP")),
):
    for name in names:
        if hasattr(owner, name):
            delattr(owner, name)
msvcrt = types.ModuleType("msvcrt")
msvcrt.LK_NBLCK, msvcrt.locking = 2, lambda handle, mode, size: None
sys.modules["msvcrt"] = msvcrt
sys.platform = "win32"
import rigtwin
from rigtwin import system
assert system._platform.__name__ == "rigtwin.system.windows"
import_all()
ran = rigtwin.run("emps", "positioning", settings={"timing": {"duration": 2.0}}, path=sys.argv[1])
assert rigtwin.load(sys.argv[1]).ticks == ran.ticks
print(rigtwin.diagnose(sys.argv[1]).verdict)
"""


@pytest.mark.slow
def test_everything_imports_and_a_diagnosis_runs_without_posix(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", ON_WINDOWS, str(tmp_path / "run.mcap")],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "LOCALAPPDATA": str(posix.cache_folder())},
        timeout=180,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.strip() == "no gap"


# The stand-ins: what the documentation says of each call, and no more.


class Call:
    """A function of a library."""

    def __init__(self, act: Callable[..., Any]) -> None:
        self.act, self.restype = act, ctypes.c_int

    def __call__(self, *arguments: Any) -> Any:
        return self.act(
            *(one.value if isinstance(one, ctypes.c_void_p) else one for one in arguments)
        )


class Kernel:
    """kernel32. processes: number → whether it runs; elevated: whether this one may have the
    highest class."""

    def __init__(self, elevated: bool) -> None:
        self.elevated = elevated
        self.processes = {41: True}
        self.opened: dict[int, tuple[int, int]] = {}
        self.priority, self.thread = 0x20, 0

        for name in dir(self):
            if name.startswith("do_"):
                setattr(self, name[3:], Call(getattr(self, name)))

    def do_GetCurrentProcess(self) -> int:
        return 2**64 - 1

    def do_GetCurrentThread(self) -> int:
        return 2**64 - 2

    def do_SetConsoleCtrlHandler(self, handler: None, add: bool) -> int:
        assert handler is None
        self.ignored = add
        return 1

    def do_OpenProcess(self, access: int, inherit: bool, number: int) -> int | None:
        assert not inherit
        if number not in self.processes:
            return None
        handle = 2**33 + 4 * len(self.opened)
        self.opened[handle] = number, access
        return handle

    def do_WaitForSingleObject(self, handle: int, milliseconds: int) -> int:
        number, access = self.opened[handle]
        assert access & 0x0010_0000
        assert milliseconds >= 1
        return 0x102 if self.processes[number] else 0

    def do_TerminateProcess(self, handle: int, code: int) -> int:
        number, access = self.opened[handle]
        assert access & 0x0001
        assert code
        self.processes[number] = False
        return 1

    def do_CloseHandle(self, handle: int) -> int:
        del self.opened[handle]
        return 1

    def do_SetPriorityClass(self, process: int, wanted: int) -> int:
        assert process == 2**64 - 1
        self.priority = 0x80 if wanted == 0x100 and not self.elevated else wanted
        return 1

    def do_GetPriorityClass(self, process: int) -> int:
        assert process == 2**64 - 1
        return self.priority

    def do_SetThreadPriority(self, thread: int, wanted: int) -> int:
        assert thread == 2**64 - 2
        self.thread = wanted
        return 1


@pytest.fixture(params=[True, False], ids=["administrator", "user"])
def kernel(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Kernel]:
    stand_in, grains = Kernel(request.param), list[int]()
    timers = SimpleNamespace(
        timeBeginPeriod=grains.append, timeEndPeriod=lambda grain: grains.remove(grain)
    )
    shell = SimpleNamespace(IsUserAnAdmin=lambda: int(request.param))
    libraries = {"kernel32": stand_in, "winmm": timers, "shell32": shell}

    def load(name: str, use_last_error: bool = False) -> Any:
        assert use_last_error
        return libraries[name]

    monkeypatch.setattr(ctypes, "WinDLL", load, raising=False)
    monkeypatch.setattr(ctypes, "get_last_error", lambda: 5, raising=False)
    stand_in.grains = grains  # type: ignore[attr-defined]
    yield stand_in
    assert not stand_in.opened, "a handle was left open"
    assert not grains, "the timers' grain was not given back"


def test_windows_priority_is_taken_and_given_back(kernel: Kernel) -> None:
    granted = windows.raise_priority(80)
    if kernel.elevated:
        assert not granted.lacking
        assert (kernel.priority, kernel.thread) == (0x100, 15)
        assert kernel.grains == [1]  # type: ignore[attr-defined]
        windows.lower_priority()
    else:
        assert "administrator" in granted.lacking
    assert (kernel.priority, kernel.thread) == (0x20, 0)
    assert windows.is_superuser() == kernel.elevated
    assert windows.lock_memory().lacking


def test_windows_watches_and_kills_a_process(kernel: Kernel) -> None:
    with windows.watch_process(41) as ended:
        assert not ended(2.5e-4)
        windows.kill_process(41)
        assert ended(1.0)
    windows.kill_process(999)
    with pytest.raises(OSError, match="process 999: error 5"), windows.watch_process(999):
        pass


def test_windows_keeps_interrupts_from_new_processes(kernel: Kernel) -> None:
    with windows.no_interrupts():
        assert kernel.ignored is True
    assert kernel.ignored is False


def test_windows_reads_keys_and_locks_files(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    console = ModuleType("msvcrt")
    waiting, locked = ["s"], dict[int, tuple[int, int]]()

    def locking(handle: int, mode: int, size: int) -> None:
        assert (mode, size) == (2, 1)
        inode = os.fstat(handle).st_ino
        if inode in locked:
            raise OSError(36, "Resource deadlock avoided")
        locked[inode] = os.lseek(handle, 0, os.SEEK_CUR), size

    console.LK_NBLCK, console.locking = 2, locking  # type: ignore[attr-defined]
    console.kbhit, console.getwch = lambda: bool(waiting), waiting.pop  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "msvcrt", console)
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: True))
    with windows.read_keys() as pressed:
        assert pressed is not None
        assert pressed()
        assert not pressed()
    with (tmp_path / "one").open("wb") as first, (tmp_path / "one").open("wb") as second:
        windows.lock_file(first.fileno())
        assert first.tell() == 0
        with pytest.raises(OSError, match="deadlock"):
            windows.lock_file(second.fileno())
    assert next(iter(locked.values()))[0] > 2**29, "what others read must stay readable"


def test_windows_has_no_trials_that_it_cannot_do() -> None:
    with pytest.raises(RigtwinError, match="no way to freeze"):
        windows.freeze_process(1)
    with windows.limit_files() as limit, pytest.raises(RigtwinError, match="no limit"):
        limit(10)


@pytest.mark.skipif(sys.platform == "win32", reason="of POSIX")
def test_posix_watches_freezes_and_kills_a_process() -> None:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    with posix.watch_process(child.pid) as ended:
        assert not ended(0.01)
        posix.freeze_process(child.pid)
        assert not ended(0.01)
        begun = time.monotonic()
        posix.kill_process(child.pid)
        assert ended(10.0)
        assert time.monotonic() - begun < 5.0
    assert child.wait() == -signal.SIGKILL
    posix.kill_process(child.pid)


@pytest.mark.skipif(sys.platform == "win32", reason="of POSIX")
def test_posix_limits_files_for_a_while(tmp_path: Path) -> None:
    path = tmp_path / "grows"
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        with posix.limit_files() as limit, path.open("wb", buffering=0) as file:
            file.write(b"x" * 10)
            limit(10)
            with pytest.raises(OSError, match="too large"):
                file.write(b"x")
        path.write_bytes(b"x" * 20)
    finally:
        signal.signal(signal.SIGXFSZ, before)
