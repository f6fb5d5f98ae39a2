"""Recordings: one MCAP file a test.

`Writer` makes them, `load` reads them, `export` turns them into CSV and MAT.
"""

from rigtwin.recording.inputs import Inputs
from rigtwin.recording.reader import Recording, load
from rigtwin.recording.writer import Writer, twin_values

__all__ = ["Inputs", "Recording", "Writer", "load", "twin_values"]
