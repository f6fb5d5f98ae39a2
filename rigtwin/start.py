"""Start of the program: Ctrl-C ends it in silence until the packages are imported."""

from __future__ import annotations

import _signal  # pyright: ignore[reportMissingImports]

# Python's own handler would print the import that was under way; `signal` itself imports more.
if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)


def main() -> int:
    """Run the command line. Returns the exit code, as `rigtwin.cli.main`."""
    from rigtwin import cli

    return cli.main()
