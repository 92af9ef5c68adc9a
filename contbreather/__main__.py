"""`python -m contbreather` is the command `contbreather`."""

from __future__ import annotations

import sys

from contbreather.cli import main

if __name__ == "__main__":
    sys.exit(main())
