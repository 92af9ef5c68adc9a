"""An orbit as a problem to trace: what that has on every road, besides its equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.images import images_of, simpler_than
from contbreather.breathers.lifts import lift
from contbreather.breathers.orbit import Orbit, with_parameters
from contbreather.breathers.road import Road
from contbreather.breathers.section import Section
from contbreather.continuation import Point, Problem
from contbreather.continuation.point import Counting
from contbreather.lattice.conditions import Conditions
from contbreather.stability.orbit import OrbitMap
from contbreather.stability.verdict import beyond
from contbreather.stability.winding import Count
from contbreather.storage.serialise import serialised

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]
At = Callable[[FloatArray, Params], Road]
Make = TypeVar("Make", bound=Callable[..., Problem])


def orbit_problem(kind: str, at: At, orbit: Orbit, threshold: float, **equations: Any) -> Problem:
    """A `Problem` with orbits for its points.

    Parameters
    ----------
    kind : str
        By which files make it again, see `read_by`.
    at : callable
        The road with given unknowns and parameters.
    orbit : Orbit
    threshold : float
        Of its events, on finite lattices.
    **equations
        What else a `Problem` takes: the equations, their start, events and columns.
    """
    shared: dict[str, Any] = {
        "interpret": partial(_interpreted, at),
        "images": partial(_images, at),
        "simpler": _simpler,
        "lifts": {"PF" if orbit.symmetric else "PD": lift},
        "wider": partial(with_parameters, threshold),
        "serialised": {
            "kind": kind,
            "conditions": orbit.conditions,
            "section": orbit.section,
            "threshold": threshold,
        },
    }
    return Problem(**{**shared, **equations})


def on_ring(lattice: Any, threshold: float) -> str:
    """The ring in a label; nothing for the infinite chain, whose counts have no threshold."""
    sites = lattice.sites
    return "" if sites is None else f" (ring of {sites}, threshold {threshold:g})"


def read_by(kind: str, of: Callable[..., Road]) -> Callable[[Make], Make]:
    """Enter what reads the serialised form of a kind: conditions, a section, unknowns and
    parameters are a road by `of`, and that is a problem."""

    def entered(problem: Make) -> Make:
        serialised(kind)(partial(_from_dict, of, problem))
        return problem

    return entered


def _from_dict(
    of: Callable[..., Road],
    problem: Callable[..., Problem],
    *,
    conditions: Conditions,
    section: Mapping[str, Any],
    threshold: float,
    start: Mapping[str, Any],
    params: Params,
) -> Problem:
    x = np.concatenate([np.ravel(value) for value in start.values()])
    return problem(Orbit(of(conditions, Section(**section), x, params)), threshold)


def _interpreted(at: At, point: Point) -> Orbit:
    return Orbit(at(point.x, point.params))


def _images(at: At, x: FloatArray, params: Params) -> tuple[FloatArray, ...]:
    return tuple(image.flight.x for image in images_of(Orbit(at(x, params))))


def _simpler(point: Point) -> Problem | None:
    """With fewer impacts; or as any two of one site by the four equations that they have."""
    orbit: Orbit = point.solution
    found = (simpler_than(orbit) or orbit).problem
    return found if len(found.start) < len(point.curve.problem.start) else None


def unstable_by(threshold: float) -> Counting:
    """The column of the multipliers outside: isolated ones on the infinite chain, those beyond the
    threshold on a finite lattice."""
    return Counting(partial(_unstable, threshold))


def _unstable(threshold: float, point: Point) -> float:
    found = point.solution.map
    return counted(found).count if isinstance(found, OrbitMap) else beyond(found, threshold)


@lru_cache(maxsize=512)
def counted(map: OrbitMap) -> Count:
    """Kept: an event asks at every step, the column of a table after the walk for the same."""
    return map.count()
