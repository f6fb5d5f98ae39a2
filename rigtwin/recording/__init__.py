"""Recordings: one MCAP file per test, with a `Writer`, `load`, and export to CSV and MAT."""

from rigtwin.recording.inputs import Inputs
from rigtwin.recording.reader import load
from rigtwin.recording.recorded_test import RecordedTest
from rigtwin.recording.writer import Writer, twin_values

__all__ = ["Inputs", "RecordedTest", "Writer", "load", "twin_values"]
