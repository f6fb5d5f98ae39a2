"""`rigtwin watch`: an alarm while a test runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.cli.options import add_machine, add_settings, add_without, settings_of

SUMMARY = "hold a test against its twin while it runs, and raise an alarm at a gap"
MORE = """\
Follows a recording that is being written, until its test ends; one that is whole is watched as fast
as it goes. An alarm is raised once a signal is off by more than noise and tolerances explain; what
may be behind it is then looked for.

examples:
  rigtwin run road10 --real-time --out test.mcap & rigtwin watch test.mcap
  rigtwin watch log.mcap --machine machine.toml --config calibrated.toml

exit code 4: an alarm was raised."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    add_without(parser)
    parser.add_argument(
        "--patience",
        type=float,
        metavar="S",
        help="give up when nothing was added for so long, in s (default 30)",
    )
    add_machine(parser)
    add_settings(parser)


def execute(parsed: argparse.Namespace) -> int:
    from tqdm import tqdm

    import rigtwin

    said: list[str] = []
    if not parsed.recording.exists():
        print(f"waiting for {parsed.recording}", flush=True)
    with tqdm(unit="s", desc="judged", bar_format="{desc} {n:.1f} s{postfix}", disable=None) as bar:

        def tell(now: rigtwin.Watch) -> None:
            bar.n = now.judged
            bar.set_postfix_str(f"alarm level {100.0 * min(now.level, 1.0):.0f} %")
            # The alarm's text changes as suspects are found; each version is said once.
            if now.alarm is not None and str(now.alarm) not in said:
                said.append(str(now.alarm))
                bar.write(said[-1])

        watch = rigtwin.watch(
            parsed.recording,
            machine=parsed.machine,
            settings=settings_of(parsed),
            without=parsed.without,
            on_update=tell,
            **({} if parsed.patience is None else {"patience": parsed.patience}),
        )
    if watch.alarm is not None:
        return 4
    print(
        f"no gap beyond noise and tolerances in the {watch.seconds:.1f} s that could be judged of "
        f"{watch.judged:.1f} s; the alarm level was {100.0 * watch.highest:.0f} % at most"
    )
    return 0
