"""Results on disk, of every kind: the engine's files, with the readers of what is in them."""

from __future__ import annotations

from contbreather.continuation.files.result_files import Run, load, save
from contbreather.storage.serialise import later

later(
    "contbreather.orbits.by_impacts",
    "contbreather.orbits.orbit_events",
    "contbreather.orbits.zone_diagram",
    "contbreather.oscillators.breather_problem",
    "contbreather.simulation.periodic",
    "contbreather.simulation.simulate",
)

__all__ = ["Run", "load", "save"]
