"""The command line. Parsing only; each command's work is imported when it is asked for, so that
help is instant."""

from __future__ import annotations

import argparse
import atexit
import gc
import io
import os
import signal
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from keyword import iskeyword
from pathlib import Path
from types import ModuleType

from rigtwin.cli.files import check_files
from rigtwin.errors import RigtwinError
from rigtwin.files import printable

OVERVIEW = """\
The digital twin of a test rig, and the tool that says why the twin and the rig disagree.

a first session:
  rigtwin list                                  what can be run
  rigtwin run drop --out drop.mcap              run it on the twin, record it
  rigtwin info drop.mcap                        what is in a recording
  rigtwin plot drop.mcap -o drop.png            look at it
  rigtwin video drop.mcap -o drop.mp4           watch it
  rigtwin compare rig.mcap                      where a recording of the rig and the twin disagree
  rigtwin diagnose rig.mcap --html why.html     why

on the real rig: docs/rig.md
your own machine: docs/tutorial.md
a model and a log, nothing else: rigtwin diagnose log.csv --machine arm.xml, docs/your_robot.md
"""


COMMANDS = (
    *("list", "run", "session", "card", "faults", "effects", "info", "plot", "video", "export"),
    *("import", "describe", "calibrate", "compare", "diagnose", "fit", "look", "watch"),
    *("machines", "machine", "blindcheck", "reproduce", "tune", "stability", "rths"),
)
"""In the order of the help; each has a module of its name here."""


LONGEST = 4000
"""Characters of a message."""
COLLECTED = 50_000
"""Objects made before Python looks for unreachable ones: by its own count of 700 it does so some
hundred times while packages are imported, and finds none."""


def _module(command: str) -> ModuleType:
    return import_module(f"rigtwin.cli.{command}{'_' if iskeyword(command) else ''}")


def _parser() -> argparse.ArgumentParser:
    # The examples in the descriptions are laid out by hand, and must not be wrapped.
    form = argparse.RawDescriptionHelpFormatter
    top = argparse.ArgumentParser(prog="rigtwin", description=OVERVIEW, formatter_class=form)
    top.add_argument("--version", action="store_true", help="print the version and stop")
    commands = top.add_subparsers(dest="command", metavar="command")
    for name in COMMANDS:
        module = _module(name)
        about = f"{module.SUMMARY}.\n\n{module.MORE}"
        module.add_arguments(
            commands.add_parser(name, help=module.SUMMARY, description=about, formatter_class=form)
        )
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit code: 0 done, 1 a fault said in one line, 2 wrong usage, 3 a
    test that tripped, 4 done and something is not as it should be, 130 interrupted."""
    try:
        if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
            # From here on an interruption is said.
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return _main(arguments)
    except KeyboardInterrupt:
        # Also while packages are imported.
        _say("interrupted")
        return 130
    except ImportError as error:
        # Compiled packages make another error of it.
        if not isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
            raise
        _say("interrupted")
        return 130


def _main(arguments: Sequence[str] | None) -> int:
    gc.set_threshold(COLLECTED)
    # What overflows is judged by its result; where in numpy it did so helps nobody.
    warnings.simplefilter("ignore", RuntimeWarning)
    # The end of the program frees everything anyhow; to look through it first takes 0.3 s.
    atexit.register(gc.freeze)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # Closed by whoever started the program: nobody wants to hear what it says.
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            # A terminal that cannot show a sign gets a question mark, not the end of the program.
            stream.reconfigure(errors="replace")
    parser = _parser()
    parsed = parser.parse_args(arguments)
    if parsed.command is None and not parsed.version:
        parser.error("a command is missing; rigtwin --help lists them")
    try:
        code = _execute(parsed)
        sys.stdout.flush()
        return code
    except RigtwinError as error:
        _say(error)
        return 1
    except BrokenPipeError:
        # Nobody reads on: that is no fault, and there is nobody to tell.
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        _say(f"{error.filename}: {error.strerror}" if error.filename else error.strerror or error)
        return 1
    except MemoryError:
        _say("not enough memory for that; make the test shorter")
        return 1


def _execute(parsed: argparse.Namespace) -> int:
    if parsed.version:
        print(f"rigtwin {import_module('rigtwin').__version__}")
        return 0
    check_files(parsed)
    return _module(parsed.command).execute(parsed)


def _say(error: object) -> None:
    """A fault in one line, which names no more of what is wrong than anybody reads."""
    said = printable(" ".join(str(error).split()))
    print(f"rigtwin: {said[:LONGEST]}{'…' if len(said) > LONGEST else ''}", file=sys.stderr)
