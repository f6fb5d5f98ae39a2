"""`rigtwin export`: a recording for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from rigtwin.console import tell_notes

SUMMARY = "write a recording as CSV or MAT for other programs"
MORE = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path)
    parser.add_argument("--out", "-o", type=Path, required=True, metavar="F.csv|F.mat")


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin

    recording = rigtwin.load(parsed.recording)
    tell_notes(recording)
    print(f"written to {recording.export(parsed.out)}")
    return 0
