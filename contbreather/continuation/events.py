"""What can happen on a curve: test functions with a zero or a jump, and how each is traced on.

An event comes from its problem; the engine asks ``event.test(point)`` and never for its kind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import derivatives
from .branch import Point
from .newton import Solution, Undefined, newton
from .problem import Curve

Array = NDArray[np.float64]

# A matrix is taken as rank deficient when its smallest singular value, relative to the size of the
# derivative at the start of the branch, is below this; a located point has it at about 1e-12.
_RANK = 1e-7


@dataclass(frozen=True)
class Locus:
    """Where an event happens, as equations: what `boundary` adds to the problem's own.

    Parameters
    ----------
    extra : dict
        Name and start value of each unknown that the conditions bring, in all m numbers.
    conditions : callable
        ``conditions(curve, z, extra) -> (m + 1,) array``; `curve` is the problem with its one or
        two freed parameters, ``z`` its unknowns and these parameters, ``extra`` an (m,) array.
    derivative : callable, optional
        ``(curve, z, extra) -> (m + 1, len(z) + m) array``; differences are taken without it.
    events : tuple of Event
        What can happen on the boundary itself, a cusp on a fold curve for instance.
    """

    extra: Mapping[str, Any]
    conditions: Callable[[Curve, Array, Array], Array]
    derivative: Callable[[Curve, Array, Array], Array] | None = None
    events: tuple[Event, ...] = ()


@dataclass(frozen=True)
class Event:
    """A test function along a curve, and what its zero means.

    Parameters
    ----------
    kind : str
        The field's label: LP, BP, PF, NS, PD, GR, HB, UZ.
    test : callable
        ``test(point)`` returns a float with a zero at the event, or an int (or bool) that jumps
        there. It may return NaN where it has no meaning: nothing is looked for there.
    terminal : bool
        The branch ends at the event.
    positive : bool
        Points are meant only where the test is positive: a start beyond is refused.
    locus : callable, optional
        ``locus(point) -> Locus`` at a point close to the event. Needed to trace the event in two
        parameters, and to locate one whose test jumps beyond what bisection gives.
    verify : callable, optional
        ``verify(point) -> str``: empty if the located point is what the kind says, else why not.
    polish : callable, optional
        ``polish(point) -> (Solution, detail)`` sharpens a located point that has no locus.
    met : Event, optional
        On a boundary of another kind: the event of the original problem that was met.

    Examples
    --------
    >>> Event("UZ", lambda point: point["x"] - 0.5).terminal
    False
    """

    kind: str
    test: Callable[[Point], float | int]
    terminal: bool = field(default=False, kw_only=True)
    positive: bool = field(default=False, kw_only=True)
    locus: Callable[[Point], Locus] | None = field(default=None, kw_only=True)
    verify: Callable[[Point], str] | None = field(default=None, kw_only=True)
    polish: Callable[[Point], tuple[Solution, Mapping[str, Any]]] | None = field(
        default=None, kw_only=True
    )
    met: Event | None = field(default=None, kw_only=True)


def user(name: str, value: float, *, terminal: bool = False) -> Event:
    """UZ: a named value passes `value`.

    Examples
    --------
    >>> user("mu", 0.3).kind
    'UZ'
    """
    return Event("UZ", lambda point: point[name] - value, terminal=terminal)


def fold() -> Event:
    """LP: the curve turns back in its free parameter.

    Verified by a rank check: at a fold the derivative in the unknowns is singular, the one in
    unknowns and parameter together is not (there it would be a branch point).

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> mine = cb.Problem(lambda x, p: np.array([x[0] ** 2 - p["mu"]]), {"x": 1.0}, {"mu": 1.0})
    >>> branch = cb.trace(mine, "mu", towards="down", events=[fold()], within={"x": (-1, 2)})
    >>> abs(branch.first("LP")["mu"]) < 1e-12
    True
    """
    return Event("LP", _fold_test, locus=_fold_locus, verify=_fold_verify)


def branch_point() -> Event:
    """BP: another curve of solutions crosses this one; the derivative in unknowns and parameter
    together loses rank."""
    return Event("BP", _branch_point_test, verify=_branch_point_verify, polish=_branch_point_polish)


def hopf() -> Event:
    """HB: a complex pair of eigenvalues of the derivative in the unknowns crosses the imaginary
    axis. A pair of real eigenvalues of opposite sign (a neutral saddle) is told apart."""
    return Event("HB", _hopf_test, locus=_hopf_locus, verify=_hopf_verify)


def cusp() -> Event:
    """CP, on a fold curve: two folds meet, the quadratic coefficient of the fold vanishes."""
    return Event("CP", _cusp_test)


# --- folds ------------------------------------------------------------------------------------


def _fold_test(point: Point) -> float:
    if point.tangent.size:
        return float(point.tangent[-1])
    return signed_smallest(point.jacobian()[:, : point.curve.size])


def _fold_locus(point: Point) -> Locus:
    null = np.linalg.svd(point.jacobian()[:, : point.curve.size])[2][-1]
    return Locus({"null": null}, _fold_conditions, _fold_derivative, events=(cusp(),))


def _fold_conditions(curve: Curve, z: Array, null: Array) -> Array:
    return np.append(curve.jacobian(z)[:, : curve.size] @ null, null.dot(null) - 1)


def _fold_derivative(curve: Curve, z: Array, null: Array) -> Array:
    n = curve.size
    rows = np.zeros((n + 1, z.size + n))
    # second derivatives are symmetric: d/dz (F_x v) is the derivative of F_z along v
    rows[:n, : z.size] = _along(curve, z, null)
    rows[:n, z.size :] = curve.jacobian(z)[:, :n]
    rows[n, z.size :] = 2 * null
    return rows


def _fold_verify(point: Point) -> str:
    whole = point.jacobian()
    values = np.linalg.svd(whole, compute_uv=False)
    scale = _RANK * point.curve.scale
    if values[-1] < scale:
        return "a branch point, not a fold: the whole derivative loses rank"
    least = np.linalg.svd(whole[:, : point.curve.size], compute_uv=False)[-1]
    if least > scale:
        return f"the derivative in the unknowns is regular: least singular value {least:.2g}"
    return ""


def _along(curve: Curve, z: Array, vector: Array) -> Array:
    """Derivative of the Jacobian along a vector in the space of the unknowns."""
    h = 1e-3 * max(1.0, float(abs(z).max())) / max(float(np.linalg.norm(vector)), 1e-300)
    step = np.zeros(z.size)
    step[: vector.size] = h * vector
    return derivatives.directional(curve.jacobian, z, step) / h


def _cusp_test(point: Point) -> float:
    """w . F_xx v v / 2 with the left null vector w as in the adjugate, so that no sign jumps."""
    ground, null = point.ground, np.atleast_1d(point["null"])
    n = ground.curve.size
    left, _, right = np.linalg.svd(ground.jacobian()[:, :n])
    sign = np.linalg.det(left) * np.linalg.det(right) * np.sign(right[-1] @ null)
    return float(sign * left[:, -1] @ _along(ground.curve, ground.z, null)[:, :n] @ null / 2)


# --- branch points ----------------------------------------------------------------------------


def _branch_point_test(point: Point) -> float:
    if not point.tangent.size:
        return float("nan")  # of codimension two on a boundary: nothing to look for
    whole = np.vstack([point.jacobian(), point.curve.dual(point.tangent)])
    return signed_smallest(whole)


def _branch_point_verify(point: Point) -> str:
    values = np.linalg.svd(point.jacobian(), compute_uv=False)
    scale = _RANK * point.curve.scale
    if values[-1] > scale:
        return f"the derivative keeps its rank: smallest singular value {values[-1]:.2g}"
    if values.size > 1 and values[-2] < scale:
        return "the derivative loses more than one rank: not a simple branch point"
    return ""


def _branch_point_polish(point: Point) -> tuple[Solution, Mapping[str, Any]]:
    """Newton on H + beta w = 0, w^T H_z = 0, w . w = 1, regular at a simple branch point.

    Along the curve itself Newton's iteration is singular there and good to 1e-8 only.
    """
    curve, n = point.curve, point.curve.size
    size = point.z.size

    def equations(y: Array) -> Array:
        z, beta, left = y[:size], y[size], y[size + 1 :]
        own = curve.equations(z) + beta * left
        return np.concatenate([own, curve.jacobian(z).T @ left, [left.dot(left) - 1]])

    def jacobian(y: Array) -> Array:
        return derivatives.differences(equations, y)

    left = np.linalg.svd(point.jacobian())[0][:, -1]
    found = newton(equations, jacobian, np.concatenate([point.z, [0.0], left]))
    return (
        Solution(
            found.z[:size], found.converged, found.iterations, found.residual, found.correction
        ),
        {"left": found.z[size + 1 :], "n": n},
    )


# --- Hopf points ------------------------------------------------------------------------------


def _hopf_test(point: Point) -> float:
    """The smallest sum of two eigenvalues, with the sign of the product of all such sums: it
    vanishes where that product does, smoothly, and cannot overflow."""
    values = np.linalg.eigvals(point.jacobian()[:, : point.curve.size])
    if values.size < 2:
        return float("nan")
    first, second = np.triu_indices(values.size, 1)
    sums = values[first] + values[second]
    sign = float(np.prod(sums / np.maximum(abs(sums), 1e-300)).real)
    return float(np.copysign(abs(sums).min(), sign))


def _hopf_locus(point: Point) -> Locus:
    values, vectors = np.linalg.eig(point.jacobian()[:, : point.curve.size])
    complex_ones = np.flatnonzero(abs(values.imag) > 1e-12 * abs(values).max())
    if not complex_ones.size:
        raise Undefined("no complex pair of eigenvalues: a neutral saddle, not a Hopf point")
    nearest = complex_ones[np.argmin(abs(values[complex_ones].real))]
    real, imaginary = vectors[:, nearest].real, vectors[:, nearest].imag
    null = real / np.linalg.norm(real)
    reference = imaginary - (imaginary @ null) * null
    reference /= np.linalg.norm(reference)

    def conditions(curve: Curve, z: Array, extra: Array) -> Array:
        null, square = extra[:-1], extra[-1]
        matrix = curve.jacobian(z)[:, : curve.size]
        own = matrix @ (matrix @ null) + square * null
        return np.concatenate([own, [null.dot(null) - 1, reference.dot(null)]])

    return Locus({"null": null, "omega2": float(values[nearest].imag ** 2)}, conditions)


def _hopf_verify(point: Point) -> str:
    square = point.detail.get("omega2")
    if square is None:
        return "a neutral saddle or an unresolved pair: no complex eigenvalues on the axis"
    if square <= 0:
        return f"a neutral saddle: omega^2 = {square:.3g} is not positive"
    return ""


# --- linear algebra that events share ---------------------------------------------------------


def signed_smallest(matrix: Array) -> float:
    """Smallest singular value with the sign of the determinant: smooth through a simple zero."""
    left, values, right = np.linalg.svd(matrix)
    return float(np.linalg.det(left) * np.linalg.det(right) * values[-1])
