"""The command `contbreather`, also as `python -m contbreather`.

Ctrl-C is heard before anything of weight is imported: an exception in the middle of an import
would come out of it as an ImportError, or as the traceback of whatever was imported.
"""

from __future__ import annotations

import os
import signal
import sys


def _leave(number: int, frame: object) -> None:
    try:
        os.write(2, b"contbreather: interrupted\n")
    finally:
        os._exit(130)  # 128 + SIGINT, as shells have it


def main() -> int:
    """Run the command line of this process and return its exit status."""
    signal.signal(signal.SIGINT, _leave)
    from contbreather.cli import main as command

    return command()


if __name__ == "__main__":
    sys.exit(main())
