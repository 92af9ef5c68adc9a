"""What happens to a shot orbit on its branch: LP, BP, PF, PD, NS and GR.

The shooting equations themselves are singular where the section has the multiplier that it closes
with: +1, or -1 on half a symmetric orbit. Folds and branch points are the engine's own. All other
multipliers are looked for in the monodromy matrix of the section (`multipliers`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.grazing import Crest, grazing, merging
from contbreather.breathers.lifts import from_arms
from contbreather.breathers.modal_flight import ModalFlight
from contbreather.breathers.multipliers import (
    Conditions,
    beyond,
    by_differences,
    pair_beyond,
    real_multiplier,
)
from contbreather.breathers.normal_form import bends
from contbreather.breathers.orbit import Orbit
from contbreather.breathers.section import Section
from contbreather.continuation import Event, Locus, Point, branch_point, fold
from contbreather.continuation.branch_points import bordered
from contbreather.continuation.curve import Curve
from contbreather.continuation.derivatives import RELATIVE, directional
from contbreather.continuation.loci import Singular
from contbreather.continuation.newton import Undefined
from contbreather.stability.verdict import THRESHOLD

FloatArray = NDArray[np.float64]

SLOW = 0.1  # velocity before an impact below which a saltation changes within such a step
STEP = 1e-3  # of velocities and accelerations at impacts, relative, for differences
ADRIFT = 1e-6  # coupling below which idle sites cannot be told from free ones


def events_of(section: Section, threshold: float = THRESHOLD) -> tuple[Event, ...]:
    """All events of an orbit with these impacts."""
    own = symmetry_breaking() if section.symmetric else real_multiplier("PD", -1.0, _slopes)
    pair = pair_beyond(threshold, _slopes)
    return (fold(), branching(), own, pair, contact(), *merging(section))


def symmetry_breaking() -> Event:
    """PF, on half a symmetric orbit: its half map has the multiplier +1."""
    return replace(_PITCHFORK, locus=_symmetry_locus, examine=bends)


def _symmetry_locus(point: Point) -> Locus:
    assert _PITCHFORK.locus is not None
    own = _PITCHFORK.locus(point)
    return replace(own, domain={"gamma": (ADRIFT, math.inf)}) if _loose(point) else own


def _loose(point: Point) -> bool:
    """Whether idle sites are held by their neighbours alone."""
    orbit: Orbit = point.solution
    return orbit.spring < ADRIFT and orbit.lattice.sites > 1


def branching() -> Event:
    """BP: another curve of solutions of the same equations crosses; as the engine's own, but with
    a determinant for its test, which large rings can afford."""
    test = Singular(bordered, _branching_test)
    return from_arms(replace(branch_point(), test=test, count=_beyond_closing))


def _branching_test(point: Point) -> float:
    if point.tangent is None:
        return math.nan
    flight = _flight(point)
    whole = np.vstack([point.curve.jacobian(point.z), point.curve.dual(point.tangent)])
    return flight.map.in_units_of_flight(whole, flight.section.sign)


def _beyond_closing(point: Point) -> float:
    return beyond(point.solution.section.sign, point)


def contact() -> Event:
    """GR: a site comes to touch a wall without an impact; VI: an impact loses its velocity."""
    return grazing(_crest, shallow=_shallow_locus)


def _flight(point: Point) -> ModalFlight:
    flight: ModalFlight = point.solution.flight
    return flight


# --- derivatives ------------------------------------------------------------------------------


def _slopes(conditions: Conditions, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    """By differences: one perturbation flown once is cheap, and smooth.

    Of the state the map knows velocities and accelerations at the impacts, and these are linear in
    it: one direction for each of them tells what all modes do.
    """
    flight = _flight(Point(curve, z))
    m, size = flight.t.size, 2 * flight.q.size

    def near(z: FloatArray) -> FloatArray:
        return conditions(curve, z, extra)

    others = [*range(m), *range(m + size, z.size + extra.size)]
    slow = min(abs(one.velocity) for one in flight.arrivals)
    step = RELATIVE * min(1.0, slow / SLOW)
    columns = by_differences(conditions, curve, z, extra, others, step)
    rows = np.zeros((len(columns), z.size + extra.size))
    rows[:, others] = columns
    values = [(abs(one.velocity), abs(one.acceleration)) for one in flight.arrivals]
    sizes = [max(pair[: 1 + i]) for pair in values for i in range(2)]
    for shown, moved, large in zip(
        flight.impact_slopes, np.linalg.pinv(flight.impact_slopes).T, sizes, strict=True
    ):
        along = np.zeros(z.size)
        along[m : m + size] = STEP * large * moved
        rows[:, m : m + size] += np.multiply.outer(
            directional(near, z, along), shown / (STEP * large)
        )
    return rows


_PITCHFORK = real_multiplier("PF", 1.0, _slopes)


# --- contacts -------------------------------------------------------------------------------


def _crest(orbit: Orbit, site: int) -> Crest:
    return Crest(site, partial(_slopes_at, site))


def _slopes_at(site: int, curve: Curve, orbit: Orbit, t: float) -> FloatArray:
    found: FloatArray = orbit.flight.slopes_at(site, t, curve.free)
    return found


def _shallow_locus(orbit: Orbit) -> Locus:
    """An impact whose incoming velocity vanishes."""
    if orbit.k == 0.0:
        raise Undefined("with k = 0 a site rests on its wall: no orbit of impacts continues")
    j = int(abs(orbit.incoming).argmin())
    # of multipliers there are none at velocity 0
    meets: dict[str, tuple[Event, ...]] = dict.fromkeys(("BP", "PF", "PD", "NS"), ())
    other = Event("VI-VI", partial(_others_last, j), ends="domain")
    conditions, slope = partial(_velocity, j), partial(_velocity_slope, j)
    return Locus({}, conditions, slope, events=(other,), meets=meets)


def _velocity(j: int, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    velocity: FloatArray = Point(curve, z).solution.incoming[j : j + 1]
    return velocity


def _velocity_slope(j: int, curve: Curve, z: FloatArray, extra: FloatArray) -> FloatArray:
    slopes: FloatArray = _flight(Point(curve, z)).tangents(curve.free).speeds[j : j + 1]
    return slopes


def _others_last(j: int, point: Point) -> float:
    """Where one impact vanishes, the least velocity of another."""
    orbit: Orbit = point.ground.solution
    walls = [wall for _, wall in orbit.section.impacts]
    return float(np.delete(walls * orbit.incoming, j).min(initial=1.0))
