"""`python -m rigtwin` is the command line."""

import sys

from rigtwin.start import main

if __name__ == "__main__":
    sys.exit(main())
