"""A twin beside a test that is running: the gap as it arises, and an alarm."""

from rigtwin.watching.alarm import Alarm, Suspect
from rigtwin.watching.watch import Watch

__all__ = ["Alarm", "Suspect", "Watch"]
