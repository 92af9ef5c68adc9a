"""Results on disk, of every kind: the engine's files, with the readers of what is in them."""

from __future__ import annotations

import contbreather.orbits  # noqa: F401 - enters the equations of orbits
from contbreather.continuation.run import Run, load, save
from contbreather.storage.serialise import later


def _simulation() -> None:
    import contbreather.simulation  # noqa: F401 - enters runs and motions


later(_simulation)

__all__ = ["Run", "load", "save"]
