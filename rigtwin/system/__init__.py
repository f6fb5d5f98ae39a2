"""All that differs from one operating system to the next: locks, keys, signals, other processes,
priority, memory, clocks, folders. `posix` and `windows` have the same names; nothing else of the
project asks which system it is on.

What Windows' side does is written from its documented calls and tested against stand-ins of them.
"""

import sys

if sys.platform == "win32":
    from rigtwin.system import windows as _here
else:
    from rigtwin.system import posix as _here

STOP_SIGNALS = _here.STOP_SIGNALS
"""Numbers of the signals by which an operator or the system ends a program."""
RENDERER = _here.RENDERER
"""Kind of offscreen OpenGL that MuJoCo uses here unless MUJOCO_GL says another."""
monotonic = _here.monotonic
"""s, of a clock that never steps and that all processes of this computer share."""
RESOLUTION = _here.RESOLUTION
"""s, of that clock."""
lock_file = _here.lock_file
no_interrupts = _here.no_interrupts
read_keys = _here.read_keys
leave_terminal = _here.leave_terminal
watch_process = _here.watch_process
freeze_process = _here.freeze_process
kill_process = _here.kill_process
raise_signal = _here.raise_signal
limit_files = _here.limit_files
lock_memory = _here.lock_memory
unlock_memory = _here.unlock_memory
return_memory = _here.return_memory
raise_priority = _here.raise_priority
lower_priority = _here.lower_priority
count_cores = _here.count_cores
cache_folder = _here.cache_folder
is_superuser = _here.is_superuser
