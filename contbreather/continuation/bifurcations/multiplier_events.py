"""PD and NS of whatever comes back after a turn, and what their curves and those of LP meet.

Its problem says what the multipliers are but for a trivial one (`multipliers`), and, unless it is
``G(x) - x = 0`` of a map G, which matrix is singular where mu is one of them (`closing`): fixed
points and cycles of maps, and periodic orbits of flows.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..algebra.derivatives import IMAGINARY
from ..algebra.linear_algebra import by_inverses, least_singular, solved
from ..algebra.newton import FEW, Array, Undefined
from ..algebra.sparse import Dense, Factors, Matrix, above, any_vector, beside, is_large
from ..curve.curve import Curve
from ..curve.point import CodimensionTwo, DefiningSystem, Event, Examined, Point
from ..systems import normal_forms
from ..systems.branch_points import RANK, crossed
from ..systems.defining_systems import along_by_difference, rank_locus
from ..systems.normal_forms import closed
from ..systems.spectrum import Multipliers, Values
from .stability_border import Border

_NEAR = 1e-5  # how far off its place a multiplier of a located event may be


def multipliers_at(point: Point) -> Multipliers:
    """Multipliers but a trivial one."""
    base = point.base_point
    ask = base.curve.problem.multipliers
    return base.curve.cached("multipliers", base.z, lambda _: Multipliers(*ask(base)))


def _flipped(point: Point) -> int:
    return multipliers_at(point).beyond_minus_one


def _pair_followed(point: Point) -> complex:
    return cmath.exp(1j * abs(math.remainder(point["angle"], 2 * math.pi)))


def linked(fold: Event, flips: Callable[[Point], float] | None = None) -> Border:
    """LP as it is given, PD by its test, and NS; on the curve of each the others are known."""
    circle = Border(
        "multipliers", "unit circle", {"BP": 1.0, "LP": 1.0, "PD": -1.0}, "NS",
        multipliers_at, _pair_followed, ("angle", cmath.phase),
    )  # fmt: skip
    circle.events["LP"] = replace(
        fold, locus=partial(meeting, fold, partial(circle.meetings, "LP"))
    )
    circle.events["PD"] = Event(
        "PD", flips or partial(circle.least_beside, "", -1.0), count=None if flips else _flipped,
        locus=partial(_flip_locus, circle), examine=_examine_flip,
    )  # fmt: skip
    circle.events["NS"] = Event(
        "NS", partial(circle.least_of_pairs, ""), count=circle.unstable_pairs,
        locus=partial(_rotation_locus, circle), examine=partial(_examine_rotation, circle),
    )  # fmt: skip
    for on in ("BP", "LP", "PD"):  # where that multiplier is there all along
        sign = circle.real[on]
        circle.double[on] = CodimensionTwo(
            "R1" if sign == 1 else "R2",
            partial(circle.least_beside, on, sign),
            examine=partial(_examine_double, sign),
            base=circle.events["NS"],
        )
    return circle


def _distances(values: Values, wanted: float) -> tuple[Values, float]:
    """Measure how far multipliers are off one value, the nearest first, and the size of all. Beside
    large ones others may be off by as much as all of themselves: none is there that is nearer 0."""
    off, size = values - wanted, max(1.0, abs(values).max(initial=0.0))
    off = off[abs(off) < abs(values)]
    return off[abs(off).argsort()], size


def _count(values: Values, wanted: float) -> int:
    """Count the multipliers at one value. Rounding moves two of them that are one by its root, but
    their sum and their product by no more than itself: so with all symmetric functions of them."""
    off, size = _distances(values, wanted)
    off = off / size
    # the most of which all are small: of two that a root splits neither one is there alone
    counts = range(off.size, 0, -1)
    return next((k for k in counts if abs(np.poly(off[:k])[1:]).max() < _NEAR), 0)


def _units(curve: Curve) -> Array:
    """Units in which `closed` has its unknowns."""
    plain = curve.problem.closing is None
    return curve.scales[: curve.size] if plain else np.ones(curve.size)


def _eigenvectors(mu: float, point: Point) -> int:
    """Count those of a multiplier that is there, one or two."""
    base = point.base_point
    matrix, moved = closed(base.curve, base.jacobian(), mu), base.curve.problem.perturbed
    # meshes have no multipliers: that of an orbit that rests is all but free
    weak = least_singular(matrix if moved is None else matrix[moved][:, moved])
    return 2 if weak.second < RANK * max(1.0, weak.largest) else 1


# --- on a branch ------------------------------------------------------------------------------


def unresolved(point: Point) -> str:
    """Say why no event is believed, where a mesh resolves no multiplier."""
    return str(point.curve.problem.unresolved(point))


def _examine_flip(point: Point) -> Examined:
    if coarse := unresolved(point):
        return coarse
    off, size = _distances(multipliers_at(point).values, -1.0)
    if not abs(off).min(initial=math.inf) < (near := _NEAR * size):
        least = abs(multipliers_at(point).values + 1).min(initial=math.inf)
        return f"no multiplier is -1: the nearest is {least:.2g} off"
    if np.count_nonzero(abs(off) < near) > 1 and _eigenvectors(-1.0, point) > 1:
        return "two multipliers are -1, with two eigenvectors: not a simple period doubling"
    make = partial(normal_forms.flip, point)
    return normal_forms.criticality("c", make, stable_if_negative=False)


def _examine_rotation(circle: Border, point: Point) -> Examined:
    upper = unresolved(point) or circle.pair_at(point)
    if not isinstance(upper, complex):
        return upper
    angle = cmath.phase(upper)
    make = partial(normal_forms.rotation_coefficient, point, angle)
    return normal_forms.criticality("d", make, stable_if_negative=True, angle=angle)


# --- as equations -----------------------------------------------------------------------------


def singular_with(mu: float, curve: Curve, z: Array) -> tuple[float, Array, Array]:
    """Least singular value closed with mu, and vectors; of a small problem times the next."""

    def make(z: Array) -> tuple[float, Array, Array]:
        matrix, units = curve.jacobian(z), _units(curve)
        B = closed(curve, matrix, mu)
        if B.shape[0] <= FEW:
            weak = least_singular(B)
            value, left, right = weak.sign * weak.size, weak.sign * weak.left, weak.right
            weight = min(1.0, weak.second)
            return weight * value, weight * left / units, right * units
        kind, how = (Factors, {"refined": False}) if is_large(B) else (Dense, {})
        # where a pivot is 0 nothing tells on which side the vectors are: beside it they do, of a
        # double multiplier farther off, as the determinant grows with the square of that
        off = (0.0, 1e-12, 1e-6)
        factors = (kind(closed(curve, matrix, mu * (1.0 + more))) for more in off)
        regular = next((each for each in factors if each.sign()), None)
        if regular is None:
            raise Undefined("the cycle is singular whatever multiplies its start")
        value, left, right = by_inverses(regular, B.shape[0], **how)
        return value, left / units, right * units

    return curve.cached(f"singular with {mu}", z, make)


def bordered(curve: Curve, z: Array, extra: Array) -> tuple[Any, NDArray[Any], NDArray[Any]]:
    """A number g that vanishes where the problem closed with exp(i angle) is singular, and vectors
    v and w with ``g' = -w* B' v``."""

    def make(place: Array) -> tuple[Any, NDArray[Any], NDArray[Any]]:
        return vanishing(closed(curve, curve.jacobian(z), _on_circle(place[-1])))

    return curve.cached("pair", np.append(z, extra), make)


def vanishing(B: Matrix) -> tuple[Any, NDArray[Any], NDArray[Any]]:
    """The number g that vanishes where B is singular, with the vectors v and w."""
    # ( B   a ) (v)   (0)  g = det B / det of all, for any a that is not at right angles to both
    # ( a*  0 ) (g) = (1)  parts of a null vector
    n = B.shape[0]
    a, unit = any_vector(n), np.eye(1, n + 1, n, dtype=B.dtype)[0]
    whole = above(beside(B, a[:, None]), np.append(a, 0.0)[None, :])
    turned = whole.conj().T
    if is_large(whole):  # of a cycle, where most entries are 0
        from scipy.sparse import csc_array

        whole, turned = csc_array(whole), csc_array(turned)
    why = "a second pair is where one is followed"
    right, left = solved(whole, unit, why), solved(turned, unit, why)
    return right[-1], right[:-1], left[:-1]


def _on_circle(angle: float) -> complex:
    """The multiplier exp(i angle), never real."""
    return complex(math.cos(angle), math.sin(angle) or IMAGINARY)


def _on_circle_with(curve: Curve, z: Array, extra: Array) -> Array:
    """Re g, and Im g over the sine, or folds and doublings would solve both where the angle is 0 or
    pi: what is left there is the derivative of g, by a complex step."""
    g = bordered(curve, z, extra)[0]
    return np.array([g.real, g.imag / _on_circle(extra[0]).imag])


def _slope_of_pair(curve: Curve, z: Array, extra: Array) -> Array:
    slope, mu = slope_of_bordered(curve, z, extra), _on_circle(extra[0])
    below = slope.imag / mu.imag
    # even in the angle about 0 and pi: next to these what is left of a difference is rounding
    turned = slope.imag[-1] - mu.real * _on_circle_with(curve, z, extra)[1]
    below[-1] = turned * mu.imag / (mu.imag**2 + np.finfo(float).eps)
    return np.array([slope.real, below])


def slope_of_bordered(curve: Curve, z: Array, extra: Array) -> NDArray[np.complex128]:
    """The derivative of that number in all unknowns and the angle."""
    _, v, w = bordered(curve, z, extra)
    units, matrix = _units(curve), curve.jacobian(z)
    left, right = w.conj() / units, v * units
    real, imaginary = (
        along_by_difference(curve, z, left, part) for part in (right.real, right.imag)
    )
    # affine in mu: the derivative of the closing is the difference of any two
    in_mu = closed(curve, matrix, 1.0) - closed(curve, matrix, 0.0)
    turned = -1j * _on_circle(extra[0]) * (w.conj() @ (in_mu @ v))
    return np.append(-real - 1j * imaginary, turned)


def meeting(plain: Event, meets: Callable[[], Mapping[str, Any]], point: Point) -> DefiningSystem:
    """The locus of an event, on which other events are looked for where it meets some."""
    assert plain.locus is not None
    return replace(plain.locus(point), meets=meets())


def _flip_locus(circle: Border, point: Point) -> DefiningSystem:
    ends = (circle.degenerate("GPD", "PD", (-1.0, 1.0), "the coefficient c =", normal_forms.flip),)
    return replace(
        rank_locus(partial(singular_with, -1.0)), events=ends, meets=circle.meetings("PD")
    )


def _rotation_locus(circle: Border, point: Point) -> DefiningSystem:
    ends = (
        # beyond R1 and R2 the multipliers are real, their product still 1: neutral saddles
        *(
            CodimensionTwo(
                f"R{k}", partial(_from_angle, k), base=circle.events[base],
                examine=partial(_examine_double, sign), ends="branch",
            )
            for k, sign, base in ((1, 1.0, "LP"), (2, -1.0, "PD"))
        ),
        *(
            Event(f"R{k}", partial(_from_angle, k), examine=partial(circle.examine, ("NS",)))
            for k in (3, 4)
        ),
        # no value at R1, R2 and R3, where the normal form is another
        circle.degenerate("CH", "NS", (1.0,), "Re d =", _rotation),
        circle.two_pairs("NSNS"),
    )  # fmt: skip
    start = {"angle": _angle(point)}
    return DefiningSystem(
        start, _on_circle_with, _slope_of_pair, events=ends, meets=circle.meetings("NS")
    )


def _angle(point: Point) -> float:
    """Angle of the pair that is known, or nearest the unit circle; beside 0 or pi where it is a
    double +1 or -1, as there a curve of folds or doublings has this angle."""
    values = multipliers_at(point).values
    for double, angle in ((1.0, 1e-2), (-1.0, math.pi - 1e-2)):
        if _count(values, double) == 2:
            return angle
    upper = values[values.imag > 0]
    if not upper.size:
        raise Undefined("no complex pair of multipliers is there: a neutral saddle")
    return point.detail.get("angle", cmath.phase(upper[abs(abs(upper) - 1).argmin()]))


def _from_angle(k: int, point: Point) -> float:
    """Vanish where the angle is 1/k of a turn to either side, whatever turns it has made beyond R2
    of a symmetric orbit. It is an unknown of the curve: no eigenvalue has to be asked for."""
    half, part = point["angle"] / 2, math.pi / k
    return math.sin(half - part) * (math.sin(half + part) if k > 2 else 1.0)


# --- resonances -------------------------------------------------------------------------------


def _examine_double(sign: float, point: Point) -> Examined:
    """Two multipliers there with one eigenvector, at +1 whether branches cross as well. With two,
    as held by a symmetry, the curve goes on."""
    values = multipliers_at(point).values
    count = _count(values, sign)
    if count != 2:
        return f"{count} multipliers are {sign:g}; two were expected"
    if _eigenvectors(sign, point) > 1:
        return f"two multipliers are {sign:g}, with two eigenvectors"
    return crossed(point.base_point) if sign == 1 else {}


def _rotation(point: Point, agreed: float) -> normal_forms.Coefficient:
    return normal_forms.rotation_coefficient(point, point["angle"], agreed)
