"""Events of cycles where something is conserved: multipliers come in pairs mu and 1/mu.

A pair leaves the unit circle at +1 (LP, BP), at -1 (PD), or where it meets another one of opposite
Krein signature (KC), which is the sign of ``i v* Omega v`` for the eigenvector v of the upper one,
with Omega the inverse of J in ``f = J grad H``; pairs of equal signature pass through each other
(V. I. Arnold, Mathematical Methods of Classical Mechanics, section 42 and appendix 29).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial, reduce
from operator import attrgetter
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..continuation.algebra.linear_algebra import solved
from ..continuation.algebra.newton import Array
from ..continuation.algebra.sparse import Dense, Factors, any_vector, dense, is_sparse
from ..continuation.bifurcations.equilibria import fold
from ..continuation.bifurcations.multiplier_events import meeting, unresolved
from ..continuation.branches.boundary import codim_two
from ..continuation.curve.curve import Curve
from ..continuation.curve.point import NOTHING, DefiningSystem, Event, Examined, Point
from .cycle_problem import Cycle
from .equations import equations_of

STEP = 1e-5  # of differences along solutions, in the metric of a curve
NEAR = 1e-6  # how far off its place the index of a located event may be
_MET = 1e-5  # the form of a unit vector that has no sign; and the overlap of two that is none


# --- at +1 and -1 -------------------------------------------------------------------------------


def nearest_to_minus_one(count: int, point: Point) -> float:
    """Multiply how far off -1 as many of the nearest indices are, with a sign that tells how many
    are beyond. Of two that is smooth where both are -1, too, and two curves of PD cross."""
    off = point.base_point.solution.indices + 1
    sides = np.sign(off.real[off.imag == 0])
    return float(sides.prod() * np.sort(abs(off))[:count].prod()) if off.size else math.nan


def examine_place(place: float, found: Examined, point: Point) -> Examined:
    off = abs(point.base_point.solution.indices - place).min(initial=math.inf)
    far = f"no multiplier is {place:+g}: the nearest index is {off:.2g} off"
    return unresolved(point) or (found if off < NEAR else far)


def event_at(place: float, kind: str, test: Any, found: Examined, **how: Any) -> Event:
    """Make the event of a test that vanishes where a pair is at a place; it is followed by that."""
    examine, locus = partial(examine_place, place, found), partial(followed, test)
    return Event(kind, test, examine=examine, locus=locus, **how)


def _examine_flip(point: Point) -> Examined:
    """Tell that nothing happens where -1 has two eigenvectors, as of an orbit that is its own
    image: a pair touches it and stays on the circle."""
    if why := examine_place(-1.0, "", point):
        return why
    from scipy.linalg import schur

    orbit, near = point.base_point.solution, math.sqrt(2 * NEAR)
    M = orbit.monodromy

    def first(mu: Any) -> bool:
        return bool(abs(mu + 1) < near)

    T, vectors, count = cast("Any", schur)(M, output="complex", sort=first)
    known = NEAR * np.linalg.norm(M, 2)
    if not orbit.equations.sparse:  # by a mesh of twice as many points
        off = replace(orbit, equations=orbit.doubled).monodromy - M
        among = vectors[:, :count]
        known = max(known, np.linalg.norm(among.conj().T @ off @ among))
    flat = np.linalg.norm(np.triu(T[:count, :count], 1)) < known
    return NOTHING if flat else ""


def turn_of_energy(point: Point) -> float:
    """Solve for the change of the energy along the family at given parameters, for a change of the
    period: it vanishes where a pair is at +1 and branches do not cross. It is times how the free
    parameter moves, at the folds of which it has no pole then."""
    base, curve, n = point.base_point, point.base_point.curve, point.base_point.curve.size
    equations, along = equations_of(base), base.tangent
    if (places := equations.longer(base.x, base.params)) is None:
        return math.nan
    if along is None:  # as if one of the parameters were free that are not the period
        free = next((k for k, name in enumerate(curve.free) if name != equations.held), 0)
        matrix, row = curve.jacobian(base.z)[:, [*range(n), n + free]], any_vector(n + 1)
        factors = Factors(matrix) if is_sparse(matrix) else Dense(matrix, row)
        null, side = factors.tangent(row)
        if null is None:
            return math.nan
        along = side * null / np.linalg.norm(null)
    else:
        row = curve.metric * along
        factors = curve.factors(base.z, row)
    way, _ = factors.correction(np.eye(1, n, places[0])[0], row)
    change = along[-1] * way[:-1] - way[-1] * along[:-1]
    return float(places[1] @ change)


def _examine_turn(found: Examined, point: Point) -> Examined:
    base = point.base_point
    # where an arm leaves its branch the parameter turns, and the test vanishes with it; next to a
    # fold, where it turns as well, the energy has a turn of its own
    turns = base.tangent is not None and abs(base.direction[-1]) < NEAR
    if turns and cast("Any", fold()).examine(base):
        return NOTHING
    return examine_place(1.0, found, point)


# --- on the circle ------------------------------------------------------------------------------


def signatures(orbit: Cycle) -> tuple[Array, Array]:
    """List the indices that are on the unit circle, and the Krein signatures of their pairs: +1 or
    -1, 0 where they are not known."""
    on, signs = _signed(orbit.indices, *orbit.index_form)
    return orbit.indices.real[on], signs[on]


def _signed(
    indices: NDArray[np.complex128], matrix: Array, form: Array | None
) -> tuple[NDArray[np.bool_], Array]:
    """Tell which indices are on the unit circle, and the signatures of all pairs, 0 off it."""
    on, signs = (indices.imag == 0) & (abs(indices.real) < 1), np.zeros(indices.size)
    if form is None:
        return on, signs
    from scipy.optimize import linear_sum_assignment

    values, vectors = np.linalg.eig(matrix)
    # where two meet each has a vector of its own, perhaps of a pair just off the axis: without sign
    which, places = linear_sum_assignment(abs(values[:, None] - indices.real[on]))
    x = vectors[:, which[places.argsort()]]
    turned = form @ x
    forms = (x.conj() * turned).sum(axis=0).real
    sizes = np.sqrt((abs(x) ** 2).sum(axis=0) * (abs(turned) ** 2).sum(axis=0))
    # next to where opposite ones meet their vectors do, too, and rounding decides
    signs[on] = np.where(abs(forms) > _MET * sizes, np.sign(forms), 0.0)
    return on, signs


def _apart_by_symmetry(matrix: Array, indices: NDArray[Any], each: int) -> NDArray[np.bool_]:
    """Tell of each two indices whether a symmetry keeps their pairs apart: eigenvectors, as many of
    each, are orthogonal all along then."""
    values, vectors = np.linalg.eig(matrix)
    of = vectors[:, abs(values[:, None] - indices).argsort(axis=0)[:each]]
    overlaps = abs(np.einsum("kai,kbj->abij", of.conj(), of)).max(axis=(0, 1))
    return np.asarray(overlaps <= _MET)


def _nearest_two(point: Point) -> tuple[float, float]:
    """Square of the distance of the nearest two indices that may leave the real axis together, less
    than zero where an odd number of twos has left it; and what is halfway between them."""
    indices, matrix, form, _ = point.base_point.solution.passing
    (on, signs), x = _signed(indices, matrix, form), indices.real
    i, j = np.triu_indices(indices.size, 1)
    may, left = on[i] & on[j] & (signs[i] * signs[j] <= 0), indices[indices.imag > 0]
    if may.any():
        may &= ~_apart_by_symmetry(matrix, indices, len(matrix) // (indices.size + 1))[i, j]
    squares = np.concatenate([(x[i] - x[j])[may] ** 2, 4 * left.imag**2])
    if not squares.size:
        return math.nan, math.nan
    middles, k = np.concatenate([0.5 * (x[i] + x[j])[may], left.real]), squares.argmin()
    return float((-1) ** left.size * squares[k]), float(middles[k])


def _about(point: Point, index: float) -> tuple[Array, NDArray[np.complex128]]:
    """Measure how far above the two indices that meet at it one is, and above others that may meet
    them, in the order of their distances."""
    indices, matrix, form, _ = point.base_point.solution.passing
    (_, signs), off, size = _signed(indices, matrix, form), index - indices, indices.size
    may = ~_apart_by_symmetry(matrix, indices, len(matrix) // (size + 1))
    twos = may & (np.multiply.outer(signs, signs) <= 0) & ~np.eye(size, dtype=bool)
    if not twos.any():
        return np.full(2, math.nan), off[:0]
    far = np.where(twos, np.add.outer(abs(off) ** 2, abs(off) ** 2), math.inf)
    two = np.array(np.unravel_index(far.argmin(), far.shape))
    others = np.setdiff1d(np.flatnonzero(may[two].any(axis=0)), two)
    return off[two], off[others[abs(off[others]).argsort(kind="stable")]]


def _angle(point: Point) -> float:
    """Find the angle at which multipliers of the whole orbit are; where those of half of it pass i
    it passes pi, at which curves of collisions go on."""
    middle = max(-1.0, min(_nearest_two(point)[1], 1.0))
    return float(point.base_point.solution.passing[-1] * math.acos(middle))


def _double(point: Point, angle: float) -> tuple[float, float]:
    """Evaluate the polynomial of the two indices that meet at an angle, and its slope: with the
    next one that may meet them, so that both are smooth where all three do; and where two come to
    +1 or -1."""
    two, others = _about(point, math.cos(angle / point.base_point.solution.passing[-1]))
    if others.size:
        others = others[(others == others[0]) | (others == others[0].conjugate())]
    factors, beside = np.append(two, others), float(others.prod().real)
    slope = float(sum(np.delete(factors, k).prod() for k in range(factors.size)).real)
    # less what it is for being off the middle of two, so that Newton's iteration keeps to its side
    # of where two curves cross
    off = slope**2 * beside / (4 * (beside**2 + STEP**2))
    return float(factors.prod().real) - off, slope


def _collisions(point: Point) -> DefiningSystem:
    """The curve of collisions, to where both pairs are at +1 (R1) or -1 (R2): beyond they are real,
    and it comes back on itself with an angle of the other sign. Other events there are theirs."""
    meets: dict[str, tuple[Event, ...]] = {}
    for event in point.curve.problem.events:
        if event.kind in ("LP", "BP", "PF", "PD"):
            met = codim_two("KC", event)
            met = replace(met, examine=partial(_examine_beside, met.examine))
            meets[event.kind] = (*meets.get(event.kind, ()), met)
    ends = Event("R1", _at_an_end, examine=_examine_end, ends="branch")
    cusp = Event("CP", _beyond_others, examine=_examine_cusp)
    return replace(followed(_double, point, angle=_angle(point)), events=(ends, cusp), meets=meets)


def _at_an_end(point: Point) -> float:
    return math.sin(point["angle"] / point.base_point.solution.passing[-1])


def _examine_end(point: Point) -> Examined:
    kind, place = ("R1", "+1") if math.cos(point["angle"]) > 0 else ("R2", "-1")
    return {"kind": kind, "said": f"both pairs are {place} there, and beyond it real"}


def _examine_beside(examine: Any, point: Point) -> Examined:
    return NOTHING if _at_an_end(point) ** 2 < 2 * NEAR else examine(point)


def _beyond_others(point: Point) -> float:
    """Vanish where a third pair that may meet the two is there, too."""
    turns = point.base_point.solution.passing[-1]
    others = _about(point, math.cos(point["angle"] / turns))[1]
    return float(others.prod().real) if others.size else math.nan


def _examine_cusp(point: Point) -> Examined:
    return unresolved(point) or {"said": "three pairs meet: the curve turns back with two of them"}


def _in_order(point: Point) -> Array:
    """Sum the signatures of pairs from each to the last, in the order of their indices. Where
    two leave the axis together one of these changes by 1, and by 2 where they come past each other,
    however close together the two events are. From the first on, which may leave at -1, none is
    taken. Without signatures how many have left the axis."""
    orbit = point.base_point.solution
    indices, *about, _ = orbit.passing
    sums = _signed(indices, *about)[1][(-indices.real).argsort(kind="stable")].cumsum()[:-1]
    if about[1] is None:
        sums[-1:] = orbit.quadruplets
    return sums


def _apart(point: Point) -> float:
    return _nearest_two(point)[0]


def _examine_collision(point: Point) -> Examined:
    square, middle = _nearest_two(point)
    if not abs(square) < NEAR or not abs(middle) < 1.0:
        return unresolved(point) or "no two pairs of multipliers meet on the unit circle"
    values, vectors = np.linalg.eig(point.base_point.solution.passing[1])
    each, met = _nearest(point, values, middle)
    # where pairs collide their vectors are one; of those that pass each other by, but for what is
    # less than rounding, they stay apart
    if np.linalg.svd(vectors[:, met], compute_uv=False)[each] > 0.5:
        return NOTHING
    return unresolved(point) or {"angle": _angle(point), "signatures": _met(point, middle)}


def _nearest(point: Point, values: NDArray[Any], middle: float) -> tuple[int, NDArray[np.intp]]:
    """Tell how often a matrix has each index, and which eigenvalues belong to the nearest two."""
    each = len(values) // (point.base_point.solution.indices.size + 1)
    return each, abs(values - middle).argsort()[: 2 * each]


def _met(point: Point, middle: float) -> str:
    """The Krein signatures of two pairs that meet, on the space of both."""
    _, matrix, form, _ = point.base_point.solution.passing
    if form is None:
        return "unknown: the field is no constant matrix times the gradient of what is conserved"
    values = np.linalg.eigvals(matrix)
    each, which = _nearest(point, values, middle)
    met = values[which]
    off = reduce(np.matmul, [matrix - value * np.eye(len(matrix)) for value in met[::each]])
    space = np.linalg.svd(off.real)[2][-2 * each :]  # what it takes to 0
    signs = np.linalg.eigvalsh(space @ form @ space.T)[::-each]
    return " ".join("+" if sign > 0 else "-" for sign in signs)


# --- as equations -------------------------------------------------------------------------------


def followed(test: Callable[..., Any], point: Point, **extra: float) -> DefiningSystem:
    """Equations for where a test of orbits, and of further unknowns, vanishes."""
    return DefiningSystem(extra, partial(_left, test), partial(_slopes, test))


def _left(test: Callable[..., Any], curve: Curve, z: Array, extra: Array) -> Array:
    """Evaluate it at the nearest orbit, so that across solutions nothing changes."""
    return np.atleast_1d(test(Point(curve, _beside(curve, z)[1]), *extra))


def _slopes(test: Callable[..., Any], curve: Curve, z: Array, extra: Array) -> Array:
    (ways, nearest), units = _beside(curve, z), np.sqrt(curve.metric)
    # what solutions are off their tangents cancels, as it is the same ahead and behind
    places = (nearest + sign * STEP * way / units for sign in (1, -1) for way in ways)
    ahead, behind = np.split(
        np.array([np.atleast_1d(test(Point(curve, at), *extra)) for at in places]), 2
    )
    slopes = (ahead - behind).T / (2 * STEP) @ (ways * units)
    here, steps = Point(curve, nearest), STEP * np.eye(extra.size)
    along = [
        (np.array(test(here, *(extra + s))) - test(here, *(extra - s))) / (2 * STEP) for s in steps
    ]
    return np.column_stack([slopes, *along])


def _beside(curve: Curve, z: Array) -> tuple[Array, Array]:
    """Directions along solutions near by, orthonormal in the metric, and the nearest solution."""

    def make(z: Array) -> tuple[Array, Array]:
        n, units = curve.size, np.sqrt(curve.metric)
        right = np.column_stack([-dense(curve.jacobian(z)[:, n:]), curve.equations(z)])
        both = np.eye(z.size, right.shape[1], -n)
        both[:n] = solved(curve.in_unknowns(z), right, "a fold in both parameters")
        ways, off = np.linalg.qr(units[:, None] * both[:, :-1])[0], units * both[:, -1]
        return ways.T, z - (off - ways @ (ways.T @ off)) / units

    return curve.cached("beside", z, make)


def conservative_events(branch_point: Event) -> tuple[Event, ...]:
    """List the events of pairs of multipliers, with that of crossing branches among them."""
    plain, beside = fold(), {"said": "a fold in the energy, not in the period"}
    lp = replace(plain, locus=partial(meeting, plain, dict))
    turn = Event(
        "LP", turn_of_energy, locus=partial(followed, turn_of_energy),
        examine=partial(_examine_turn, beside), may_jump=True,
    )  # fmt: skip
    inverse = attrgetter("base_point.solution.inverse_hyperbolic")
    nearest, two = (partial(nearest_to_minus_one, count) for count in (1, 2))
    pd = event_at(-1.0, "PD", nearest, "", count=inverse)
    pd = replace(pd, locus=partial(followed, two), examine=_examine_flip)
    kc = Event("KC", _apart, count=_in_order, locus=_collisions, examine=_examine_collision)
    return lp, turn, branch_point, pd, kc
