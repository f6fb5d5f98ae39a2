"""Everything that differs between operating systems: locks, keys, signals, processes, priority,
memory, clocks and folders.

`posix` and `windows` define the same names. No other module of the project asks for the system. The
Windows side follows the documented calls, and is tested against stand-ins of them.
"""

import sys

if sys.platform == "win32":
    from rigtwin.system import windows as _platform
else:
    from rigtwin.system import posix as _platform

STOP_SIGNALS = _platform.STOP_SIGNALS
"""Signals by which an operator or the system ends a program."""
RENDERER = _platform.RENDERER
"""Offscreen OpenGL of MuJoCo on this system, unless MUJOCO_GL names another."""
monotonic = _platform.monotonic
"""Clock in s that never steps, and that all processes of this computer share."""
RESOLUTION = _platform.RESOLUTION
"""Resolution of that clock, in s."""
lock_file = _platform.lock_file
no_interrupts = _platform.no_interrupts
read_keys = _platform.read_keys
leave_terminal = _platform.leave_terminal
watch_process = _platform.watch_process
freeze_process = _platform.freeze_process
kill_process = _platform.kill_process
raise_signal = _platform.raise_signal
limit_files = _platform.limit_files
lock_memory = _platform.lock_memory
unlock_memory = _platform.unlock_memory
return_memory = _platform.return_memory
raise_priority = _platform.raise_priority
lower_priority = _platform.lower_priority
count_cores = _platform.count_cores
cache_folder = _platform.cache_folder
is_superuser = _platform.is_superuser
