"""Results on disk, of every kind: the engine's files, with the readers of what is in them."""

from __future__ import annotations

from contbreather.continuation.run import Run, load, save
from contbreather.storage.serialise import later


def _orbits() -> None:
    from contbreather.orbits import (  # noqa: F401 - enters their equations, events and zones
        closed_form,
        exact_modes,
        green_function,
        orbit_events,
        zone_diagram,
    )


def _simulation() -> None:
    # enters runs and motions
    from contbreather.simulation import periodic, simulate, smooth  # noqa: F401


later(_simulation)
later(_orbits)

__all__ = ["Run", "load", "save"]
