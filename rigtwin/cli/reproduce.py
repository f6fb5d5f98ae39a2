"""`rigtwin reproduce`: the thesis beside the twin."""

from __future__ import annotations

import argparse
from pathlib import Path

import rigtwin
from rigtwin.cli.options import add_workers, counting_bar
from rigtwin.console import writable, write_json
from rigtwin.errors import RigtwinError

SUMMARY = "reproduce the thesis: its tables, figures and statements beside ours"
MORE = """\
examples:
  rigtwin reproduce                       everything, under ten minutes on two cores
  rigtwin reproduce 5                     a chapter
  rigtwin reproduce table-4.2             a table, figure or equation
  rigtwin reproduce skyhook --html F.html --draw FOLDER

Results of finished jobs are kept; a second run goes on where the first was stopped."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "what",
        nargs="*",
        help="a chapter (3 to 7, A), study, table, figure or equation; default: everything",
    )
    parser.add_argument(
        "--seeds", type=int, default=32, help="roads and noise to judge over (default 32)"
    )
    add_workers(parser)
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path("reproduction"),
        help="folder of the results (default reproduction)",
    )
    parser.add_argument(
        "--json", type=Path, metavar="F.json", help="also write everything for other programs"
    )
    parser.add_argument(
        "--html", type=Path, metavar="F.html", help="also write a page to look at, one file"
    )
    parser.add_argument(
        "--draw",
        type=Path,
        metavar="FOLDER",
        help="where to draw the figures (default: figures in --folder)",
    )
    parser.add_argument(
        "--gallery", type=Path, metavar="FOLDER", help="also write gallery.md with its pictures"
    )


def execute(parsed: argparse.Namespace) -> int:
    """Runs the studies asked for; a second run goes on where the first was stopped."""
    for out in (parsed.json, parsed.html):
        if out is not None:
            writable(out)
    pictures = parsed.draw or parsed.folder / "figures"
    if pictures.exists() and not pictures.is_dir():
        raise RigtwinError(f"cannot draw into {pictures}: it is a file")
    with counting_bar("job", "reproduce") as progress:
        reproduction = rigtwin.reproduce(
            " ".join(parsed.what) or None,
            seeds=parsed.seeds,
            folder=parsed.folder,
            workers=parsed.workers,
            cluster=parsed.cluster,
            progress=progress,
        )
    print(reproduction.text())
    if parsed.json is not None:
        write_json(parsed.json, reproduction.document())
    if parsed.html is not None:
        print(f"\nlook at {reproduction.page(parsed.html)}")
    drawn = reproduction.draw(pictures)
    if len(drawn) == 1:
        [(out, covers)] = drawn.items()
        print(f"\n{covers} drawn in {out}")
    elif drawn:
        print(f"\n{len(drawn)} figures drawn in {pictures}")
    if parsed.gallery is not None:
        print(f"\ngallery in {reproduction.gallery(parsed.gallery)}")
    return 0
