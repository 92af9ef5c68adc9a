"""Events of cycles where something is conserved: multipliers come in pairs mu and 1/mu.

A pair leaves the unit circle at +1 (LP, BP), at -1 (PD), or where it meets another one of opposite
Krein signature (KC), which is the sign of ``i v* Omega v`` for the eigenvector v of the upper one,
with Omega the inverse of J in ``f = J grad H``; pairs of equal signature pass through each other
(V. I. Arnold, Mathematical Methods of Classical Mechanics, section 42 and appendix 29).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial, reduce

import numpy as np

from ..continuation.algebra.linear_algebra import solved
from ..continuation.algebra.newton import Array
from ..continuation.algebra.sparse import is_sparse
from ..continuation.bifurcations.equilibria import fold
from ..continuation.bifurcations.multiplier_events import (
    bordered,
    singular_with,
    slope_of_bordered,
    unresolved,
)
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import DefiningSystem, Event, Examined, Point
from ..continuation.systems.defining_systems import rank_locus
from .cycle_problem import Cycle, equations_of
from .multipliers import around

_LOST = 1e-9  # relative singular value of a matrix that has lost rank
_OFF, _BY_SIDE = 1e-6, 1e-2  # of the angle of a meeting: where both multipliers are, and neither
_NEAR = 1e-6  # how far off its place the index of a located event may be
_UNKNOWN = "unknown: the field is no constant matrix times the gradient of what is conserved"


# --- at +1 and -1 -------------------------------------------------------------------------------


def _beside(place: float, point: Point) -> float:
    """Measure the index nearest to a place, with a sign that tells how many are beyond."""
    off = point.base_point.solution.indices - place
    sides = np.sign(off.real[off.imag == 0])
    return float(sides.prod() * abs(off).min()) if off.size else math.nan


def _beyond(place: float, point: Point) -> int:
    indices = point.base_point.solution.indices
    return int(((indices.imag == 0) & (indices.real * place > 1)).sum())


def _examine_place(place: float, point: Point) -> Examined:
    off = abs(point.base_point.solution.indices - place).min(initial=math.inf)
    far = "" if off < _NEAR else f"no multiplier is {place:+g}: the nearest index is {off:.2g} off"
    return unresolved(point) or far


def _pair_at(place: float, point: Point) -> DefiningSystem:
    return rank_locus(partial(singular_with, place))


def _energy_over_period(point: Point) -> float:
    """Solve for the change of the energy along the family at given parameters, for a change of the
    period that is given: it vanishes where a pair is at +1 and branches do not cross."""
    base = point.base_point
    kept, layout = equations_of(base).conservation, equations_of(base).layout
    if kept is None or kept.held != "period":
        return math.nan
    longer = np.zeros(layout.size)
    longer[layout.lambdas[0]] = 1.0  # the equation T = period
    matrix = base.curve.in_unknowns(base.z)
    if is_sparse(matrix):
        change = solved(matrix, longer, "a fold in the period")
    else:  # where branches cross the shortest change is well defined; at a fold there is none
        change = np.linalg.lstsq(matrix, longer, rcond=_LOST)[0]
        if abs(matrix @ change - longer).max() > math.sqrt(_LOST):
            return math.inf
    return float(change[layout.levels[0]])


def _examine_turn(point: Point) -> Examined:
    return _examine_place(1.0, point) or {"said": "a fold in the energy, not in the period"}


def _examine_fold(plain: Event, point: Point) -> Examined:
    assert plain.examine is not None
    return unresolved(point) or plain.examine(point)


def _fold_locus(plain: Event, point: Point) -> DefiningSystem:
    assert plain.locus is not None
    return replace(plain.locus(point), meets={})


# --- on the circle ------------------------------------------------------------------------------


def _symplectic(orbit: Cycle) -> tuple[Array, Array | None]:
    """The derivative of the turn where it begins, and the symplectic form, where it is known."""
    (factors,), _ = around(orbit.equations, orbit.x, orbit.params)
    kept = orbit.equations.conservation
    assert kept is not None
    states = orbit.flights[0].states.T
    J = kept.poisson(orbit.equations.flows[0].f, states, orbit.params)
    return reduce(np.matmul, factors[::-1]), None if J is None else np.linalg.inv(J)


def signatures(orbit: Cycle) -> tuple[Array, Array]:
    """The indices that are on the unit circle, and the Krein signatures of their pairs: +1 or -1, 0
    where they are not known."""
    indices = orbit.indices
    on = indices.real[(indices.imag == 0) & (abs(indices.real) < 1)]
    whole, form = _symplectic(orbit)
    if form is None:
        return on, np.zeros(on.size)
    mu, vectors = np.linalg.eig(whole)
    signs, left = [], np.ones(mu.size, dtype=bool)
    for place in on + 1j * np.sqrt(1 - on**2):
        nearest = int(np.where(left, abs(mu - place), np.inf).argmin())
        left[nearest] = False
        v = vectors[:, nearest]
        signs.append(np.sign((1j * (v.conj() @ form @ v)).real))
    return on, np.array(signs)


def _apart(point: Point) -> float:
    """Square of the distance of the nearest two indices that may leave the real axis together, less
    than zero where an odd number of twos has left it."""
    orbit = point.base_point.solution
    on, signs = signatures(orbit) if orbit.indices.size > 1 else (np.empty(0), np.empty(0))
    i, j = np.triu_indices(on.size, 1)
    meeting = (on[i] - on[j])[signs[i] * signs[j] <= 0]
    left = orbit.indices.imag[orbit.indices.imag > 0]
    squares = np.concatenate([meeting**2, 4 * left**2])
    return float((-1) ** left.size * squares.min()) if squares.size else math.nan


def _nearest(point: Point) -> tuple[float, float]:
    """The distance of the nearest two indices, and where they are, on the circle."""
    indices = point.base_point.solution.indices
    i, j = np.triu_indices(indices.size, 1)
    closest = int(abs(indices[i] - indices[j]).argmin())
    middle = 0.5 * (indices[i] + indices[j])[closest].real
    return float(abs(indices[i] - indices[j])[closest]), max(-1.0, min(middle, 1.0))


def _examine_collision(point: Point) -> Examined:
    distance, middle = _nearest(point)
    if distance > math.sqrt(_NEAR) or abs(middle) == 1:
        return unresolved(point) or "no two pairs of multipliers meet on the unit circle"
    angle = math.acos(middle)
    signs = _signatures_at(point.base_point.solution, angle)
    return unresolved(point) or {"angle": angle, "signatures": signs}


def _signatures_at(orbit: Cycle, angle: float) -> str:
    """The signatures of two pairs that meet: those of the form on the plane of both upper ones."""
    from scipy.linalg import schur

    whole, form = _symplectic(orbit)
    if form is None:
        return _UNKNOWN
    place = complex(math.cos(angle), math.sin(angle))
    off = np.sort(abs(np.linalg.eigvals(whole) - place))
    reach = 0.5 * (off[1] + off[2])
    plane = schur(whole, output="complex", sort=lambda mu: abs(mu - place) < reach)[1][:, :2]
    signs = np.linalg.eigvalsh(1j * plane.conj().T @ form @ plane)
    return " ".join("+" if sign > 0 else "-" for sign in signs[::-1])


@dataclass(frozen=True)
class _Meeting:
    """Equations for two multipliers that meet: both are at one angle, but for a little.

    On the circle ``det(M - exp(i angle))`` is real but for a factor that does not vanish, and so is
    the number that stands for it here: its `phase` is that beside the meeting. Next to where it
    has a double zero in the angle it has two of them, 2e-6 apart.
    """

    phase: complex

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        one, other = (self.phase * bordered(curve, z, extra + off)[0] for off in (_OFF, -_OFF))
        return np.array([(one + other).real / 2, (one - other).real / (2 * _OFF)])

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        one, other = (
            self.phase * slope_of_bordered(curve, z, extra + off) for off in (_OFF, -_OFF)
        )
        return np.array([(one + other).real / 2, (one - other).real / (2 * _OFF)])


def _meeting(point: Point) -> DefiningSystem:
    angle, base = math.acos(_nearest(point)[1]), point.base_point
    g = bordered(base.curve, base.z, np.array([angle + _BY_SIDE]))[0]
    meeting = _Meeting(abs(g) / g)
    return DefiningSystem({"angle": angle}, meeting.conditions, meeting.derivative)


def conservative_events(branch_point: Event) -> tuple[Event, ...]:
    """List the events of pairs of multipliers, with that of crossing branches among them."""
    plain = fold()
    lp = replace(plain, locus=partial(_fold_locus, plain), examine=partial(_examine_fold, plain))
    turn = Event(
        "LP", _energy_over_period, locus=partial(_pair_at, 1.0), examine=_examine_turn,
        may_jump=True,  # at a fold in the period
    )  # fmt: skip
    pd = Event(
        "PD", partial(_beside, -1.0), count=partial(_beyond, -1.0), locus=partial(_pair_at, -1.0),
        examine=partial(_examine_place, -1.0),
    )  # fmt: skip
    kc = Event("KC", _apart, locus=_meeting, examine=_examine_collision)
    return lp, turn, branch_point, pd, kc
