"""`python -m rigtwin.cli`."""

import sys

from rigtwin.cli import main

sys.exit(main())
