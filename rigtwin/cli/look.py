"""`rigtwin look`: a recording and its twin in the browser."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rigtwin.cli.options import add_machine, add_settings, add_without, settings_of
from rigtwin.console import writable
from rigtwin.errors import RigtwinError
from rigtwin.files import forbid_overwriting

if TYPE_CHECKING:
    from rigtwin.looking.live import LivePage
    from rigtwin.looking.page import Page

SUMMARY = "see a recording beside its twin, and move what may be wrong by hand"
MORE = """\
A page for the browsers of this computer, until Ctrl-C: the machine in motion as measured and as
predicted, the traces, and a slider for each effect, which tells at once how far the twin is off.
Effects that are ticked can be fitted, and the twin with them written for --config.

examples:
  rigtwin look rig.mcap
  rigtwin diagnose rig.mcap --json why.json; rigtwin look rig.mcap --diagnosis why.json
  rigtwin look rig.mcap --live                while the test runs (rigtwin watch: without a page)"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    parser.add_argument(
        "--diagnosis", type=Path, metavar="F.json", help="begin with what this diagnosis found"
    )
    parser.add_argument(
        "--live",
        action="store_true",
        help="the recording is being written: watch its test, with an alarm; sliders afterwards",
    )
    parser.add_argument(
        "--save-twin",
        type=Path,
        metavar="F.toml",
        help="file that the save button writes (default: RECORDING_twin.toml in this folder)",
    )
    add_without(parser)
    parser.add_argument("--port", type=int, default=8080, help="default 8080; 0 takes a free one")
    add_machine(parser)
    add_settings(parser)


def execute(parsed: argparse.Namespace) -> int:

    if parsed.live and parsed.diagnosis is not None:
        raise RigtwinError("--diagnosis is of a recording that is whole; not with --live")
    # The name is settled here, so that the page and the check below mean the same file.
    out = parsed.save_twin or Path(f"{parsed.recording.stem}_twin.toml")
    writable(
        forbid_overwriting(
            out, *(each for each in (parsed.config, parsed.diagnosis) if each is not None)
        )
    )
    with _page(parsed, out) as page:
        try:
            print(f"{page.url}, until Ctrl-C", flush=True)
            page.wait()
        except KeyboardInterrupt:
            # A browser that is open holds connections, which are waited for a few seconds.
            print("closing", flush=True)
    return 0


def _page(parsed: argparse.Namespace, out: Path) -> Page | LivePage:
    import rigtwin

    if parsed.live:
        if not parsed.recording.exists():
            print(f"waiting for {parsed.recording}", flush=True)
        return rigtwin.show_live(
            parsed.recording,
            port=parsed.port,
            machine=parsed.machine,
            settings=settings_of(parsed),
            without=parsed.without,
            save_twin=out,
            on_message=partial(print, flush=True),
        )
    look = rigtwin.look(
        rigtwin.load(parsed.recording, parsed.machine),
        settings=settings_of(parsed),
        without=parsed.without,
    )
    return rigtwin.show_look(look, port=parsed.port, diagnosis=parsed.diagnosis, save_twin=out)
