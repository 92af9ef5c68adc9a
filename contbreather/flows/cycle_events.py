"""What happens to cycles along a branch: LP, BP, PD, NS, and HB where they shrink to a point."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..continuation import defining_systems, normal_forms
from ..continuation.branch_points import bordered_matrix, crossing_event
from ..continuation.curve import Curve
from ..continuation.defining_systems import Singular, signed_smallest
from ..continuation.equilibria import fold
from ..continuation.newton import OUT_OF_DOMAIN, Array, Undefined
from ..continuation.point import CodimensionTwo, DefiningSystem, Event, Examined, Point
from ..continuation.sparse import Dense, Factors, Matrix, any_vector, factorised, null_vectors
from .equations import Equations
from .homoclinic import HOMOCLINIC
from .multipliers import closing_matrix
from .orbit import Cycle, equations_of
from .walls import GRAZING, IMPACT

Values = NDArray[np.complex128]
Triplet = tuple[float, Array, Array]  # the least singular value and its vectors

_NEAR = 1e-5  # how far off its place a multiplier of a located event may be
_REAL = 1e-6  # imaginary part below which a pair of multipliers is real
_ROUNDING = 1e-12  # relative error of a product of two multipliers
_BORDERINGS = 2  # far from where a curve began its borders are no null vectors any more
_TURNS = 4  # of inverse iteration for singular vectors; two are enough where the value vanishes
_SAME = 1 - 1e-15  # cosine of the angle between directions that are the same
_STEP = 1e-5  # of differences along a null vector, relative to what that moves
_NOTHING = 1e-300  # the imaginary part of one may vanish
_ROUGHLY = 1e-7  # error of differences in coefficients that are asked for all along a curve
_BESIDE = 1e-12  # how far off -1 a multiplier is taken to be where the cycle is singular with it
_AT_REST = 1e-5  # an orbit that swings by this, relative to its size, ends at an equilibrium


# --- doubled periods ---------------------------------------------------------------------------


def _others(point: Point) -> Values:
    """The multipliers but for the trivial one."""
    others: Values = point.base_point.solution.others
    return others


def _least_beside(wanted: float, multipliers: Callable[[Point], Values], point: Point) -> float:
    """How far off a value the nearest multiplier is, with the sign of the product of all."""
    values = multipliers(point)
    if not (values.size and np.isfinite(values).all()):  # as at VI
        return math.nan
    return defining_systems.least_with_sign(values - wanted, 0.0)


def _examine_flip(point: Point) -> Examined:
    off = abs(_others(point) + 1)
    if not off.min(initial=math.inf) < _NEAR * max(1.0, float(abs(_others(point)).max())):
        return f"no multiplier is -1: the nearest is {off.min(initial=math.inf):.2g} off"
    if np.count_nonzero(off < _NEAR) > 1:
        return "two multipliers are -1: not a simple period doubling"
    return normal_forms.criticality("c", lambda: normal_forms.flip(point), stable_if_negative=False)


def _flip_locus(point: Point) -> DefiningSystem:
    flip = _Flip(equations_of(point.base_point))
    ends = (_GENERALISED_FLIP, _beside("R2", -1.0, -1.0, ROTATION))
    return DefiningSystem({}, flip.conditions, flip.derivative, events=ends, meets=MEETINGS["PD"])


def _inverse_iteration(factors: Any, size: int, **how: bool) -> Triplet:
    """The least singular value, with the sign of the determinant, and its vectors w and v:
    w* B v = value."""
    left = right = any_vector(size)
    # v = B^-1 w and w = B^-* v, each to length 1: 1/|B^-1 w| tends to the least singular value
    for _ in range(_TURNS):
        right, before = factors.solve(left, **how), left
        value = 1 / math.sqrt(right @ right)
        right = value * right
        left = factors.transposed(right)
        left = left / math.sqrt(left @ left)
        if abs(left @ before) >= _SAME:
            break
    return factors.sign() * value, factors.sign() * left, right


@dataclass(frozen=True, eq=False)
class _Flip:
    """The least singular value of the cycle closed with -1, with the sign of the determinant, is
    zero."""

    equations: Equations

    def _weak(self, curve: Curve, z: Array) -> Triplet:
        weak: Triplet = curve.cached("flip", z, lambda z: self._least(curve.jacobian(z)))
        return weak

    def _least(self, matrix: Matrix) -> Triplet:
        # where a pivot is 0 nothing tells on which side the vectors are: beside it they do
        closings = (
            Factors(closing_matrix(self.equations, matrix, mu)) for mu in (-1.0, -1.0 - _BESIDE)
        )
        factors = next((factors for factors in closings if factors.sign()), None)
        if factors is None:
            raise Undefined("the cycle is singular whatever multiplies its start")
        return _inverse_iteration(factors, matrix.shape[0], refined=False)

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        return np.array([self._weak(curve, z)[0]])

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        _, left, right = self._weak(curve, z)
        # Second derivatives are symmetric: d/dz (F_x v) is the derivative of F_z along v. Rows in
        # which the closing is not F_x are linear.
        return _turned(curve, z, left, right)[None, :]


def _turned(curve: Curve, z: Array, left: NDArray[Any], right: Array) -> NDArray[Any]:
    """``left @ curve.along(z, right)`` by one central difference: eight digits, and a row of
    Newton's iteration needs no more."""
    way = np.append(right, np.zeros(z.size - right.size))
    size = float(np.linalg.norm(way / np.maximum(curve.scales, abs(z))))
    step = _STEP / max(size, _NOTHING)
    change = left @ curve.jacobian(z + step * way) - left @ curve.jacobian(z - step * way)
    return np.asarray(change / (2 * step))


# --- pairs on the unit circle --------------------------------------------------------------------


def _least_of_pairs(multipliers: Callable[[Point], Values], point: Point) -> float:
    """The smallest ``mu_i mu_j - 1`` of multipliers, with the sign of the product of all."""
    values = multipliers(point)
    first, second = defining_systems.pairs(values)
    if not (first.size and np.isfinite(values).all()):
        return math.nan
    return defining_systems.least_with_sign(
        first * second - 1, np.asarray(_ROUNDING * (1 + abs(first * second)), dtype=float)
    )


def _examine_pair(point: Point) -> Examined:
    first, second = defining_systems.pairs(_others(point))
    nearest = int(abs(first * second - 1).argmin())
    mu = complex(first[nearest])
    if abs(mu.imag) < _REAL:
        return f"a neutral saddle: the multipliers {mu.real:.4g} and {second[nearest].real:.4g}"
    angle = abs(math.atan2(mu.imag, mu.real))
    return {"angle": angle} | normal_forms.criticality(
        "d", lambda: normal_forms.rotation_coefficient(point, angle), stable_if_negative=True
    )


def _pair_locus(point: Point) -> DefiningSystem:
    values = _others(point)
    upper = values[values.imag > _REAL]
    if not upper.size:
        raise Undefined("no complex pair of multipliers is there: a neutral saddle")
    mu = complex(upper[abs(abs(upper) - 1).argmin()])
    equations = equations_of(point.base_point)
    right, left = null_vectors(closing_matrix(equations, point.base_point.jacobian(), mu / abs(mu)))
    rotation = _Rotation(equations, left, right)
    angle = math.atan2(mu.imag, mu.real)
    ends = (
        Event("R1", partial(_angle_from, 0.0, 1.0), ends="branch"),
        Event("R2", partial(_angle_from, math.pi, -1.0), ends="branch"),
        Event("R3", partial(_angle_from, 2 * math.pi / 3, 1.0)),
        Event("R4", partial(_angle_from, math.pi / 2, 1.0)),
        Event("CH", _rotation_coefficient, examine=_examine_chenciner),
    )
    locus = DefiningSystem({"angle": angle}, rotation.conditions, rotation.derivative)
    return replace(locus, events=ends, meets=MEETINGS["NS"])


def _angle_from(level: float, sign: float, point: Point) -> float:
    return sign * (float(point["angle"]) - level)


@dataclass(frozen=True, eq=False)
class _Rotation:
    """The scalar of the cycle closed with exp(i angle), bordered by its own null vectors as vectors
    that stay the same tell them."""

    equations: Equations
    left: NDArray[Any]
    right: NDArray[Any]

    def _bordered(
        self, curve: Curve, z: Array, angle: float
    ) -> tuple[Any, NDArray[Any], NDArray[Any]]:
        """The scalar g, and vectors v and w with ``g' = -w* B' v`` where g is zero."""
        from scipy.sparse import block_array, csc_array

        closed = csc_array(closing_matrix(self.equations, curve.jacobian(z), np.exp(1j * angle)))
        unit = np.eye(1, len(self.left) + 1, len(self.left), dtype=complex)[0]
        v, w = self.right, self.left
        for _ in range(_BORDERINGS):
            # ( B   w ) (x)   (0)
            # ( v*  0 ) (g) = (1),  g = det B / det of all: it vanishes with det B
            blocks: Any = [[closed, csc_array(w[:, None])], [csc_array(v.conj()[None, :]), None]]
            lu = factorised(block_array(blocks).tocsc())
            right, left = lu.solve(unit), lu.solve(unit, "H")
            v, w = (way[:-1] / np.linalg.norm(way[:-1]) for way in (right, left))
        return right[-1], right[:-1], left[:-1]

    def conditions(self, curve: Curve, z: Array, extra: Array) -> Array:
        g = self._bordered(curve, z, extra[0])[0]
        return np.array([g.real, g.imag])

    def derivative(self, curve: Curve, z: Array, extra: Array) -> Array:
        _, v, w = self._bordered(curve, z, extra[0])
        row = w.conj()
        slope = -_turned(curve, z, row, v.real) - 1j * _turned(curve, z, row, v.imag)
        # of the closing mu - 1 on the rows of the first state, 1 - mu on that of the phase
        first, turn = self.equations.layout.nodes[0][0], 1j * np.exp(1j * extra[0])
        turned = turn * (w.conj()[first] @ v[first])
        if self.equations.phased:
            turned -= turn * w[-1].conj() * v[-1]
        slope = np.append(slope, -turned)
        return np.array([slope.real, slope.imag])


# --- where a cycle shrinks to an equilibrium ---------------------------------------------------


def _swing(point: Point) -> float:
    """How far the orbit swings the way it did at first, relative to its size, less what counts as
    an equilibrium: beyond one the curve goes on as the same cycles half a turn later."""
    equations = equations_of(point.base_point)
    first, states = equations.start[0].states, point.base_point.x[equations.layout.nodes[0]].T
    way = first - first.mean(axis=1, keepdims=True)
    swing = (states - states.mean(axis=1, keepdims=True)) * way
    size = np.linalg.norm(way) * np.linalg.norm(first)
    return float(swing.sum() / size) - _AT_REST


def _examine_swing(point: Point) -> Examined:
    orbit: Cycle = point.base_point.solution
    states = orbit.flights[0].states
    extent, size = float(np.ptp(states, axis=1).max()), float(abs(states).max())
    first = orbit.equations.start[0].states
    if extent < 100 * _AT_REST * max(size, float(np.linalg.norm(first))):
        return ""
    return f"it swings by {extent:.2g}: no equilibrium"


# --- what their curves in two parameters meet -------------------------------------------------


def _without(mu: float | None, point: Point) -> Values:
    """The multipliers but for those that the curve has everywhere: one that is known, or the pair
    of a curve of NS."""
    others = _others(point)
    if mu is not None:
        return defining_systems.without(others, mu)
    pair = complex(math.cos(point["angle"]), math.sin(point["angle"]))
    return defining_systems.without(others, pair, pair.conjugate())


def _beside(kind: str, mu: float | None, wanted: float, base: Event) -> CodimensionTwo:
    """Another multiplier of a certain value on a curve that has one already."""
    return CodimensionTwo(kind, partial(_least_beside, wanted, partial(_without, mu)), base=base)


def _pair_beside(kind: str, mu: float | None) -> CodimensionTwo:
    """A pair on the unit circle on a curve that has a multiplier there."""
    test = partial(_least_of_pairs, partial(_without, mu))
    return CodimensionTwo(kind, test, examine=partial(_examine_pair_beside, mu), base=ROTATION)


def _examine_pair_beside(mu: float | None, point: Point) -> Examined:
    first, second = defining_systems.pairs(_without(mu, point))
    nearest = int(abs(first * second - 1).argmin())
    real = abs(first[nearest].imag) < _REAL
    return "a neutral saddle: no pair on the unit circle" if real else {}


def _fold_locus(point: Point) -> DefiningSystem:
    assert _PLAIN.locus is not None
    locus = _PLAIN.locus(point)
    ends = (*locus.events, _beside("R1", 1.0, 1.0, ROTATION))
    return replace(locus, events=ends, meets=MEETINGS["LP"])


# --- where normal forms degenerate ---------------------------------------------------------------


def _flip_coefficient(point: Point) -> float:
    """c without its poles, at R2 and fold-flips."""
    c = normal_forms.value_or_nan(lambda: normal_forms.flip(point, _ROUGHLY))
    return c * math.prod(_pole(-1.0, wanted, point) for wanted in (-1.0, 1.0))


def _rotation_coefficient(point: Point) -> float:
    """Re d without its pole where it meets a fold; no value at R1, R2 and R3."""
    d = normal_forms.value_or_nan(
        lambda: normal_forms.rotation_coefficient(point, point["angle"], _ROUGHLY)
    )
    return d * _pole(None, 1.0, point)


def _pole(mu: float | None, wanted: float, point: Point) -> float:
    """Zero where another multiplier is there, 1 where there is no other."""
    others = partial(_without, mu)
    return _least_beside(wanted, others, point) if others(point).size else 1.0


def _examine_generalised_flip(point: Point) -> str:
    return normal_forms.not_zero("the coefficient c =", normal_forms.flip(point), point)


def _examine_chenciner(point: Point) -> str:
    d = normal_forms.rotation_coefficient(point, point["angle"])
    return normal_forms.not_zero("Re d =", d, point)


# --- the events -----------------------------------------------------------------------------


def _examine(examine: Callable[[Point], Examined] | None, point: Point) -> Examined:
    """No event is believed where the mesh resolves no multiplier."""
    coarse: str = point.base_point.solution.coarse
    return coarse or (examine(point) if examine else {})


def _branches(point: Point) -> float:
    """About the least singular value with the row of the tangent below, by one factorisation."""
    matrix = bordered_matrix(point)
    if not isinstance(matrix, np.ndarray):
        return signed_smallest(matrix)
    factors = Dense(matrix)
    return _inverse_iteration(factors, len(matrix))[0] if factors.exact else 0.0


def _examine_fold(point: Point) -> Examined:
    examined = _examine(_PLAIN.examine, point)
    if isinstance(examined, str) and examined:
        return examined
    with suppress(*OUT_OF_DOMAIN):  # u -> u + b u^2, and the direction of u is free
        examined = {**(examined or {}), "b": abs(normal_forms.cubic_at_cusp(point)[0].value)}
    return examined


_PLAIN = fold()
FOLD = replace(_PLAIN, locus=_fold_locus, examine=_examine_fold)
_CROSSING = crossing_event({})
BRANCH_POINT = replace(
    _CROSSING,
    test=Singular(bordered_matrix, _branches),
    count=None,
    examine=partial(_examine, _CROSSING.examine),
)
_GENERALISED_FLIP = Event("GPD", _flip_coefficient, examine=_examine_generalised_flip)
_flips, _pairs = partial(_least_beside, -1.0, _others), partial(_least_of_pairs, _others)
FLIP = Event("PD", _flips, locus=_flip_locus, examine=partial(_examine, _examine_flip))
ROTATION = Event("NS", _pairs, locus=_pair_locus, examine=partial(_examine, _examine_pair))
SHRUNK = Event("HB", _swing, examine=_examine_swing, ends="branch")

# On the boundary of one kind, what the meeting with another is called; walls end it as they are.
MEETINGS: dict[str, dict[str, tuple[Event, ...]]] = {
    "LP": {"PD": (_beside("LPPD", 1.0, -1.0, FLIP),), "NS": (_pair_beside("LPNS", 1.0),)},
    "PD": {"LP": (_beside("LPPD", -1.0, 1.0, FOLD),), "NS": (_pair_beside("PDNS", -1.0),)},
    "NS": {"LP": (_beside("LPNS", None, 1.0, FOLD),), "PD": (_beside("PDNS", None, -1.0, FLIP),)},
}


def events_of(equations: Equations) -> tuple[Event, ...]:
    """What can happen to a cycle of these flows."""
    events = [FOLD, BRANCH_POINT, FLIP, ROTATION]
    if equations.autonomous and equations.smooth and equations.flows[0].reset is None:
        events.append(SHRUNK)
    if equations.autonomous:
        events.append(HOMOCLINIC)
    if any(flow.until for flow in equations.flows):
        events.append(IMPACT)
    if any(flow.until or flow.walls for flow in equations.flows):
        events.append(GRAZING)
    return tuple(events)
