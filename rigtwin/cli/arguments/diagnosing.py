"""The commands that look for a gap between rig and twin."""

from __future__ import annotations

from pathlib import Path

from rigtwin.cli.arguments.shared import Command, effect, settings, workers


def add(command: Command) -> None:
    compare = command(
        "compare",
        "replay each component of a recording on the twin and say what is left",
        "One recording: motor, carriage, mechanics, both cylinders, controller and closed loop, each driven by measured\n"
        "signals. A ratio of 1 means that noise is all that is left. Two recordings: of one test, channel by channel.\n"
        "--set and --config change the twin that it is compared with.",
    )
    compare.add_argument("recording", type=Path)
    compare.add_argument("other", type=Path, nargs="?", help="a second recording of the same test")
    compare.add_argument(
        "--json", type=Path, metavar="J.json", help="also write the figures to a file"
    )
    compare.add_argument(
        "--machine",
        metavar="F.toml",
        help="the machine's description (default: the one that the recording names)",
    )
    effect(compare, "compare with a twin that has an effect, e.g. coulomb@rail=80")
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
    diagnose.add_argument(
        "recordings",
        type=Path,
        nargs="+",
        metavar="recording",
        help="of one rig, explained together",
    )
    diagnose.add_argument(
        "--json", type=Path, metavar="F.json", help="also write the answer for other programs"
    )
    diagnose.add_argument(
        "--html", type=Path, metavar="F.html", help="also write a report to look at, one file"
    )
    diagnose.add_argument(
        "--without",
        action="append",
        default=[],
        metavar="EFFECT",
        help="take this out of the twin first, e.g. coulomb@rail",
    )
    diagnose.add_argument(
        "--held-out",
        nargs="+",
        type=Path,
        default=[],
        metavar="recording",
        help="of the same rig, to judge on",
    )
    diagnose.add_argument(
        "--save-twin", type=Path, metavar="F.toml", help="write the corrected twin, for --config"
    )
    diagnose.add_argument(
        "--machine",
        metavar="F.toml",
        help="the machine's description (default: the one that the recording names)",
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

    blindcheck = command(
        "blindcheck",
        "check the diagnosis on recordings of another rig, whose defects are withheld from it",
        "A referee in a process of its own draws rigs and their defects and records tests; the diagnosis sees the files\n"
        "alone; then the key is opened, checked against its digest, and every answer is scored.",
    )
    blindcheck.add_argument(
        "--cases", type=int, help="how many (default 200; of rigs to tune for 8)"
    )
    blindcheck.add_argument(
        "--tune",
        metavar="STUDY",
        help="instead: is a controller tuned on the diagnosed twin better on the rig itself?",
    )
    blindcheck.add_argument(
        "--seed", type=int, default=2026, help="of the referee's draws (default 2026)"
    )
    blindcheck.add_argument(
        "--folder",
        type=Path,
        default=Path("blindcheck"),
        help="of recordings and answers; a second run goes on",
    )
    blindcheck.add_argument(
        "--baselines", action="store_true", help="also score what cruder methods would have said"
    )
    blindcheck.add_argument(
        "--json", type=Path, metavar="F.json", help="also write the scores to a file"
    )
    workers(blindcheck)
