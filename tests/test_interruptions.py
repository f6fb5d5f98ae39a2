"""Ctrl-C in a terminal: every process gets it, and one line is said."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.interruptions import block_sigint, defer_sigint


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="POSIX")
def test_a_process_started_meanwhile_gets_no_interruption():
    code = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('still there')"
    with block_sigint():
        started = subprocess.Popen([sys.executable, "-S", "-c", code], stdout=subprocess.PIPE)
    assert started.communicate(timeout=20)[0] == b"still there\n"


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="POSIX")
def test_the_one_that_starts_it_gets_it_behind():
    reached = []
    with pytest.raises(KeyboardInterrupt), block_sigint():  # noqa: PT012
        os.kill(os.getpid(), signal.SIGINT)
        reached.append(True)
    assert reached


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="POSIX")
def test_another_thread_that_takes_it_changes_nothing():
    reached, over = [], threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt), block_sigint():  # noqa: PT012
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.05)
            reached.append(True)
    finally:
        over.set()
        thread.join()
    assert reached


def test_an_interruption_while_packages_are_imported_is_one_line(monkeypatch, capsys):
    def interrupt(_: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("rigtwin.cli.import_module", interrupt)
    assert main(["list"]) == 130
    assert capsys.readouterr().err == "rigtwin: interrupted\n"


def test_an_interruption_that_a_package_makes_an_import_error_of_is_one(monkeypatch, capsys):
    def interrupt(_: str) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as pressed:
            raise ImportError("initialization failed") from pressed

    monkeypatch.setattr("rigtwin.cli.import_module", interrupt)
    assert main(["list"]) == 130
    assert capsys.readouterr().err == "rigtwin: interrupted\n"


@pytest.mark.slow
def test_a_referee_that_still_records_says_nothing_of_an_interruption(tmp_path, capfd):
    def interrupt(*_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rigtwin.blindcheck(2, seed=1, folder=tmp_path, workers=1, progress=interrupt)
    assert capfd.readouterr().err == ""


def test_an_interruption_comes_behind_what_it_would_spoil() -> None:
    done = []

    @defer_sigint()
    def work() -> None:
        signal.raise_signal(signal.SIGINT)
        done.append("all of it")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["all of it"]


@pytest.mark.parametrize(
    "start",
    [
        ["-c", "import rigtwin.start; KILL"],
        ["-c", "import rigtwin.__main__; KILL"],
    ],
)
def test_an_interruption_while_packages_are_imported_prints_nothing(start: list[str]) -> None:
    kill = "import os, signal; os.kill(os.getpid(), signal.SIGINT)"
    command = [sys.executable, *(part.replace("KILL", kill) for part in start)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_the_command_line_hears_interruptions_as_usual() -> None:
    code = (
        "import rigtwin.start, signal, sys; sys.argv = ['rigtwin', '--version']; "
        "rigtwin.start.main(); print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "True"
