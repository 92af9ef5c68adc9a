"""Results on disk, of every kind: the engine's files, with the makers of what is in them."""

from __future__ import annotations

import contbreather.breathers.recipes  # noqa: F401 - enters the equations of orbits
from contbreather.continuation import Run, load, save

__all__ = ["Run", "load", "save"]
