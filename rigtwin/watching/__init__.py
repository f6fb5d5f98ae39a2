"""Watch over a running test: its gap to the twin as it arises, and an alarm."""

from rigtwin.watching.alarm import Alarm, Suspect
from rigtwin.watching.watch import Watch

__all__ = ["Alarm", "Suspect", "Watch"]
