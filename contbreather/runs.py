"""Results on disk, of every kind: the engine's files, with the readers of what is in them."""

from __future__ import annotations

from contbreather.continuation.files.result_files import Run, load, save
from contbreather.storage.serialise import later


def _simulation() -> None:
    from contbreather.simulation import periodic, simulate  # noqa: F401 - runs and motions


def _orbits() -> None:  # their equations, events and zones
    from contbreather.orbits import by_impacts, orbit_events, zone_diagram  # noqa: F401


def _oscillators() -> None:
    from contbreather.oscillators import breather_problem  # noqa: F401


later(_simulation)
later(_oscillators)
later(_orbits)

__all__ = ["Run", "load", "save"]
