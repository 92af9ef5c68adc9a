"""python bare.py FOLDER ...: the compiler, where there is nothing but numpy and numba.

The packages that kernels are in are not imported, only the modules with their texts: so it works
before what the package depends on is installed, and begins at once.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

PACKAGE = Path(__file__).resolve().parent


def main() -> None:
    # this folder's `files` or `errors` are not everybody's
    sys.path[:] = [entry for entry in sys.path if Path(entry or ".").resolve() != PACKAGE]
    for folder in [PACKAGE, *(path for path in PACKAGE.iterdir() if path.is_dir())]:
        package = ModuleType(".".join(folder.relative_to(PACKAGE.parent).parts))
        package.__path__ = [str(folder)]
        sys.modules[package.__name__] = package
    import_module("contbreather.compiler").main(sys.argv[1:])


if __name__ == "__main__":
    main()
