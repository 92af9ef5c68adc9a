"""Results on disk, of every kind: the engine's files, with the makers of what is in them."""

from __future__ import annotations

import contbreather.breathers  # noqa: F401 - enters the equations of orbits
from contbreather.continuation import Run, load, save
from contbreather.continuation.recipes import elsewhere


def _dynamics() -> None:
    import contbreather.dynamics.kept  # noqa: F401 - enters runs and motions


elsewhere(_dynamics)

__all__ = ["Run", "load", "save"]
