"""The command line. Parsing only; each command's work is imported when it is asked for, so that help is instant."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.stability.commands import arguments as stability_arguments

CARD = Path(__file__).parents[1] / "machines" / "cards" / "pci-6229.toml"
"""The packaged channel table."""
OVERVIEW = """\
The digital twin of a hybrid suspension rig, and the tool that says why the twin and the rig disagree.

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
"""


def _parser() -> argparse.ArgumentParser:
    top = argparse.ArgumentParser(prog="rigtwin", description=OVERVIEW, formatter_class=argparse.RawDescriptionHelpFormatter)
    top.add_argument("--version", action="store_true", help="print the version and stop")
    commands = top.add_subparsers(dest="command", metavar="command")

    def command(name: str, summary: str, more: str = "") -> argparse.ArgumentParser:
        return commands.add_parser(
            name, help=summary, description=f"{summary}.\n\n{more}", formatter_class=argparse.RawDescriptionHelpFormatter
        )

    def settings(parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--set", action="append", default=[], metavar="KEY=VALUE", help="override one setting, e.g. rail.coulomb=60"
        )
        parser.add_argument("--config", type=Path, metavar="F.toml", help="override settings from a TOML file, before --set")

    listing = command(
        "list",
        "list the experiments, or the settings",
        "rigtwin list --settings drop prints every setting of an experiment with unit, bounds and source.",
    )
    listing.add_argument("--settings", metavar="NAME", help="the settings of that experiment instead")

    run = command(
        "run",
        "run an experiment on the twin and record it",
        "examples:\n  rigtwin run drop --out drop.mcap\n"
        "  rigtwin run road10 --seed 3 --set controller.kp=0.5 --set timing.duration=10\n\n"
        "exit code 3: a limit tripped; the recording is kept.",
    )
    run.add_argument("name", help="an experiment of rigtwin list")
    run.add_argument("--seed", type=int, default=0, help="of noise and road (default 0); the same seed gives the same bytes")
    run.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="F.mcap",
        help="where to record; replaced if there (default NAME-SEED.mcap, numbered if there)",
    )
    _effect(run, "give the rig an effect that its settings do not tell, e.g. coulomb@rail=80")
    settings(run)
    _supervised(run)

    _card(command("card", "a virtual card on a port, or the check of a channel table", "docs/rig.md"), settings)
    _session(command("session", "run a list of tests on the rig, one recording each", SESSION), settings)
    _faults(command("faults", "put faults into sessions on the virtual card; see that each is stopped", "docs/faults.md"))

    effects = command(
        "effects",
        "list the effects that a rig can have",
        "Give one to a test with rigtwin run NAME --effect KIND@COMPONENT=VALUE.",
    )
    effects.add_argument("component", nargs="?", help="only those of this component")

    info = command("info", "say what is in a recording")
    info.add_argument("recording", type=Path)

    plot = command("plot", "draw a recording: motions, force, wheel and voltage over time")
    plot.add_argument("recording", type=Path)
    plot.add_argument("--out", "-o", type=Path, metavar="F.png", help="png, svg or pdf (default: beside the recording)")
    _stretch(plot)

    video = command("video", "film a recording: the rig moving, its force and travel drawn beneath")
    video.add_argument("recording", type=Path)
    video.add_argument("--out", "-o", type=Path, metavar="F.mp4", help="default: beside the recording")
    video.add_argument("--camera", default="overview", help="overview, side or wheel (default overview)")
    video.add_argument("--magnify", type=float, default=1.0, metavar="X", help="draw motions X times as large (default 1)")
    _stretch(video)

    export = command("export", "write a recording as CSV or MAT for other programs")
    export.add_argument("recording", type=Path)
    export.add_argument("--out", "-o", type=Path, required=True, metavar="F.csv|F.mat")

    compare = command(
        "compare",
        "replay each component of a recording on the twin and say what is left",
        "One recording: motor, carriage, mechanics, both cylinders, controller and closed loop, each driven by measured\n"
        "signals. A ratio of 1 means that noise is all that is left. Two recordings: of one test, channel by channel.\n"
        "--set and --config change the twin that it is compared with.",
    )
    compare.add_argument("recording", type=Path)
    compare.add_argument("other", type=Path, nargs="?", help="a second recording of the same test")
    compare.add_argument("--json", type=Path, metavar="J.json", help="also write the figures to a file")
    compare.add_argument(
        "--machine", metavar="F.toml", help="the machine's description (default: the one that the recording names)"
    )
    _effect(compare, "compare with a twin that has an effect, e.g. coulomb@rail=80")
    settings(compare)

    diagnose = command(
        "diagnose",
        "say why recordings of one rig and the twin disagree",
        "Checks the data, fits every effect that the twin knows, and says which explains the gap, how sure that is, where it\n"
        "lies, and how far the gap shrinks on data that were not fitted; or that there is no gap, or none that it knows.\n\n"
        "examples:\n  rigtwin diagnose rig.mcap --html report.html --save-twin calibrated.toml\n"
        "  rigtwin diagnose monday.mcap tuesday.mcap --held-out wednesday.mcap\n"
        "  rigtwin compare rig.mcap --config calibrated.toml",
    )
    diagnose.add_argument("recordings", type=Path, nargs="+", metavar="recording", help="of one rig, explained together")
    diagnose.add_argument("--json", type=Path, metavar="F.json", help="also write the answer for other programs")
    diagnose.add_argument("--html", type=Path, metavar="F.html", help="also write a report to look at, one file")
    diagnose.add_argument(
        "--without", action="append", default=[], metavar="EFFECT", help="take this out of the twin first, e.g. coulomb@rail"
    )
    diagnose.add_argument(
        "--held-out", nargs="+", type=Path, default=[], metavar="recording", help="of the same rig, to judge on"
    )
    diagnose.add_argument("--save-twin", type=Path, metavar="F.toml", help="write the corrected twin, for --config")
    diagnose.add_argument(
        "--machine", metavar="F.toml", help="the machine's description (default: the one that the recording names)"
    )
    settings(diagnose)

    command("machines", "list the machines that can be diagnosed")
    machine = command(
        "machine",
        "check a machine's description",
        "rigtwin machine check F.toml explains every mistake in one line each; without any, what will be looked for.",
    )
    machine.add_argument("action", choices=["check"])
    machine.add_argument("description", type=Path, metavar="F.toml")

    importing = command(
        "import",
        "make a recording of other programs' data",
        "A map says which column is which channel, in what unit, and what the time base is; docs/tutorial.md explains it.\n\n"
        "example:\n  rigtwin import bench.csv --map bench-map.toml -o bench.mcap",
    )
    importing.add_argument("data", type=Path, metavar="DATA.{csv,mat,parquet}")
    importing.add_argument("--map", type=Path, required=True, metavar="MAP.toml")
    importing.add_argument("--out", "-o", type=Path, required=True, metavar="F.mcap")

    blindcheck = command(
        "blindcheck",
        "check the diagnosis on recordings of another rig, whose defects are withheld from it",
        "A referee in a process of its own draws rigs and their defects and records tests; the diagnosis sees the files\n"
        "alone; then the key is opened, checked against its digest, and every answer is scored.",
    )
    blindcheck.add_argument("--cases", type=int, help="how many (default 200; of rigs to tune for 8)")
    blindcheck.add_argument(
        "--tune", metavar="STUDY", help="instead: is a controller tuned on the diagnosed twin better on the rig itself?"
    )
    blindcheck.add_argument("--seed", type=int, default=2026, help="of the referee's draws (default 2026)")
    blindcheck.add_argument(
        "--folder", type=Path, default=Path("blindcheck"), help="of recordings and answers; a second run goes on"
    )
    blindcheck.add_argument("--baselines", action="store_true", help="also score what cruder methods would have said")
    blindcheck.add_argument("--json", type=Path, metavar="F.json", help="also write the scores to a file")
    _workers(blindcheck)

    reproduce = command(
        "reproduce",
        "reproduce the thesis: its tables, figures and statements beside ours",
        "examples:\n"
        "  rigtwin reproduce                       everything, under ten minutes on two cores\n"
        "  rigtwin reproduce 5                     a chapter\n"
        "  rigtwin reproduce table-4.2             a table, figure or equation\n"
        "  rigtwin reproduce skyhook --html F.html --draw FOLDER\n\n"
        "Results of finished jobs are kept; a second run goes on where the first was stopped.",
    )
    reproduce.add_argument(
        "what", nargs="*", help="a chapter (3 to 7, A), study, table, figure or equation; default: everything"
    )
    reproduce.add_argument("--seeds", type=int, default=32, help="roads and noise to judge over (default 32)")
    _workers(reproduce)
    reproduce.add_argument("--folder", type=Path, default=Path("reproduction"), help="of the results (default reproduction)")
    reproduce.add_argument("--json", type=Path, metavar="F.json", help="also write everything for other programs")
    reproduce.add_argument("--html", type=Path, metavar="F.html", help="also write a page to look at, one file")
    reproduce.add_argument(
        "--draw", type=Path, metavar="FOLDER", help="where to draw the figures (default: figures in --folder)"
    )
    reproduce.add_argument("--gallery", type=Path, metavar="FOLDER", help="also write gallery.md with its pictures")

    _tune(command("tune", "tune the controller on the twin, and judge it on roads that the tuning has not seen", TUNE))

    calibrate = command(
        "calibrate",
        "find the friction compensator's settings from a recording",
        "The recording must be made without compensation and reverse often, such as friction-road.\n\n"
        "example:\n  rigtwin calibrate friction.mcap -o compensator.toml\n"
        "  rigtwin run friction-road --config compensator.toml",
    )
    calibrate.add_argument("recording", type=Path)
    calibrate.add_argument("--out", "-o", type=Path, metavar="F.toml", help="where to write them (default: print)")

    stability = command(
        "stability",
        "say whether a vehicle is stable on the rig with its delays, and how much delay it bears",
        "example:\n  rigtwin stability --vehicle car --tau 0.01",
    )
    stability_arguments(stability)
    return top


TUNE = """\
A study is a TOML file: parameters with bounds, objectives, constraints, and what varies; docs/tuning.md. Without one, those
that come along are listed.

examples:
  rigtwin tune skyhook --out tuning/skyhook
  rigtwin tune friction --twin calibrated.toml     of a rig that diagnose --save-twin has described
  rigtwin run active --config tuning/skyhook/tuned.toml

Every run is kept; a second call goes on where the first was stopped."""


def _tune(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", nargs="?", help="a study by name, or the path of its file")
    parser.add_argument("--twin", type=Path, metavar="F.toml", help="tune on this calibrated twin and within its uncertainty")
    parser.add_argument("--out", "-o", type=Path, metavar="FOLDER", help="of the results (default tuning/STUDY)")
    parser.add_argument(
        "--seed", type=int, default=1, help="of the optimiser (default 1); the same seed gives the same settings"
    )
    parser.add_argument("--evaluations", type=int, metavar="N", help="about how many candidates (default: the study's)")
    parser.add_argument("--roads", type=int, metavar="N", help="scenarios that each is tried in (default: the study's)")
    parser.add_argument("--held-out", type=int, metavar="N", help="scenarios to judge on (default: the study's)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a setting of every run")
    _workers(parser)


def _effect(parser: argparse.ArgumentParser, summary: str) -> None:
    parser.add_argument("--effect", action="append", default=[], metavar="KIND@COMPONENT=VALUE", help=summary)


def _workers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--workers", type=int, metavar="N", help="processes that work side by side (default: one a core)")
    parser.add_argument("--cluster", metavar="ADDRESS", help="work on a dask cluster instead, e.g. tcp://host:8786")


def _stretch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--from", dest="start", type=float, default=0.0, metavar="S", help="start at this time (default 0)")
    parser.add_argument("--until", type=float, metavar="S", help="stop at this time (default: the end)")


SESSION = """\
The list is a TOML file of [[test]] tables: experiment, and if wanted seed, pause (s before it), name, set (a table of
settings). After each test its recording is compared with the twin. A session ends at the first test that does not
complete; --resume goes on with what is missing."""


def _card(parser: argparse.ArgumentParser, settings: Callable[[argparse.ArgumentParser], None]) -> None:
    deeds = parser.add_subparsers(dest="deed", metavar="deed", required=True)
    serving = deeds.add_parser("serve", help="let the twin be the card of any NI-DAQmx gRPC client on this computer")
    serving.add_argument("card", type=Path, metavar="CARD.toml", help="channel table: how the twin is wired to the card")
    serving.add_argument("--port", type=int, default=31763, help="default 31763; 0 takes a free one")
    serving.add_argument("--seed", type=int, default=0, help="of the sensors' noise (default 0)")
    _effect(serving, "give the rig an effect, e.g. coulomb@rail=80")
    settings(serving)
    checking = deeds.add_parser("check", help="find zero, span and signs; write the channel table")
    checking.add_argument("card", type=Path, metavar="CARD.toml", help="the channel table to begin with")
    checking.add_argument("--out", "-o", type=Path, required=True, metavar="NEW.toml", help="where to write what was found")
    checking.add_argument("--operator", required=True, metavar="NAME", help="who does it")
    checking.add_argument("--note", default="", help="kept in the table")
    checking.add_argument(
        "--signs", action="store_true", help="move each output a little and see which signal follows, and how"
    )
    checking.add_argument("--zero", action="store_true", help="as it stands now, every input reads its reference")
    checking.add_argument("--reference", action="append", default=[], metavar="NAME=VALUE", help="other than zero, with --zero")
    checking.add_argument("--span", action="append", default=[], metavar="NAME=VALUE", help="as it stands now, it reads this")
    checking.add_argument(
        "--stroke", type=float, default=0.005, metavar="M", help="of the plates, with --signs (default 0.005)"
    )
    checking.add_argument("--moved", action="append", default=[], metavar="OUTPUT=+|-", help="which way it went, if not asked")
    checking.add_argument("--arm", action="store_true", help="do not ask: everybody is clear of the rig")
    checking.add_argument("--virtual", type=Path, metavar="WIRING.toml", help="on a virtual card that is wired like this")
    freeing = deeds.add_parser("release", help="free what a program that died has left on a gRPC device server")
    freeing.add_argument("card", type=Path, metavar="CARD.toml")


def _session(parser: argparse.ArgumentParser, settings: Callable[[argparse.ArgumentParser], None]) -> None:
    parser.add_argument("list", type=Path, metavar="LIST.toml", help="the tests")
    parser.add_argument("--folder", type=Path, default=Path("session"), help="of the recordings (default session)")
    parser.add_argument("--resume", action="store_true", help="keep the recordings that were completed; run the others")
    _effect(parser, "give the twin an effect that its settings do not tell")
    settings(parser)
    _supervised(parser)


def _faults(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--each", type=int, default=11, metavar="N", help="sessions of each kind in one process (default 11)")
    parser.add_argument("--processes", type=int, default=4, metavar="N", help="of each kind that kills a process (default 4)")
    parser.add_argument("--seed", type=int, default=0, help="of kinds' times, tests and places (default 0)")
    parser.add_argument("--card", type=Path, default=CARD, metavar="CARD.toml", help="channel table (default the packaged one)")
    parser.add_argument("--out", "-o", type=Path, metavar="F.md", help="write the table there")
    parser.add_argument("--json", type=Path, metavar="J.json", help="write every outcome there")


def _supervised(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("on the rig (docs/rig.md)")
    group.add_argument("--target", choices=("twin", "daq"), default="twin", help="what to run on (default twin)")
    group.add_argument(
        "--card", type=Path, metavar="CARD.toml", help="channel table; with the twin: its converters, ramps, limits"
    )
    group.add_argument("--dry-run", action="store_true", help="with daq: the exact session on the virtual card first")
    group.add_argument("--real-time", action="store_true", help="the twin at the pace of the clock")
    group.add_argument("--arm", action="store_true", help="do not ask before the rig is armed: everybody is clear of it")
    group.add_argument("--without-dry-run", metavar="NAME", help="arm without a dry run; NAME answers for it, and is recorded")
    group.add_argument("--stop-file", type=Path, metavar="F", help="stop when this file appears; signals and keys stop anyway")
    group.add_argument(
        "--live", type=int, nargs="?", const=8765, default=0, metavar="PORT", help="live view for Foxglove (default port 8765)"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit code: 0 done, 1 a fault said in one line, 2 wrong usage, 3 a test that tripped,
    130 interrupted."""
    parser = _parser()
    parsed = parser.parse_args(arguments)
    if parsed.version:
        print(f"rigtwin {import_module('rigtwin').__version__}")
        return 0
    if parsed.command is None:
        parser.error("a command is missing; rigtwin --help lists them")
    try:
        return import_module("rigtwin.commands").COMMANDS[parsed.command](parsed)
    except RigtwinError as error:
        print(f"rigtwin: {' '.join(str(error).split())}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    except OSError as error:
        print(f"rigtwin: {error.strerror or error}", file=sys.stderr)
        return 1
    except MemoryError:
        print("rigtwin: not enough memory for that; make the test shorter", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("rigtwin: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
