"""Folds and Hopf points as curves in two parameters, and what happens on these curves.

CP where two folds meet; for a flow ``x' = F`` also BT (a double zero eigenvalue), ZH (a zero and a
pair on the imaginary axis), GH (the first Lyapunov coefficient vanishes) and HH (two pairs). Each
is verified by the eigenvalues, and by coefficients of its normal form, before it is labelled.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from . import events, normal_forms
from .boundary import meeting
from .branch import Point
from .events import Crossings, Event, Examined, Locus, Meeting, Singular
from .newton import OUT_OF_DOMAIN

Array = NDArray[np.float64]

CROSSED = "branches cross here, held together by a symmetry or an invariant subspace"
_ZERO = 1e-5  # eigenvalues this small, relative to the derivative, are zero: double ones split


def fold() -> Event:
    """LP: the curve turns back in its free parameter.

    Verified by a rank check: at a fold the derivative in the unknowns is singular, the one in
    unknowns and parameter together is not (there it would be a branch point). As a curve in two
    parameters it meets cusps (CP), and, where Hopf points are looked for too, BT and ZH.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> mine = cb.Problem(lambda x, p: np.array([x[0] ** 2 - p["mu"]]), {"x": 1.0}, {"mu": 1.0})
    >>> branch = cb.trace(mine, "mu", towards="down", events=[fold()], within={"x": (-1, 2)})
    >>> abs(branch.first("LP")["mu"]) < 1e-12
    True
    """
    return _FOLD


def hopf() -> Event:
    """HB: a complex pair of eigenvalues of the derivative in the unknowns crosses the imaginary
    axis, for a flow ``x' = F(x, p)``.

    A pair of real eigenvalues of opposite sign (a neutral saddle) is told apart. A located point
    knows ``detail["omega"]``, the first Lyapunov coefficient ``detail["l1"]`` (for the eigenvector
    of length 1; negative: a stable limit cycle is born) and what its sign means,
    ``detail["criticality"]``. As a curve in two parameters it meets GH, ZH, HH, and ends at BT,
    where ``detail["degenerate"]`` says so if the normal form is another: by symmetry, for instance.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> def residual(u, p):
    ...     x, y = u
    ...     return np.array([p["A"] - (p["B"] + 1) * x + x * x * y, p["B"] * x - x * x * y])
    >>> brusselator = cb.Problem(residual, {"x": 1.0, "y": 1.0}, {"A": 1.0, "B": 1.0})
    >>> point = cb.trace(brusselator, "B", within={"B": (0.5, 3)}, events=[hopf()]).first("HB")
    >>> round(point["B"], 12), round(point.detail["l1"], 9), point.detail["criticality"]
    (2.0, -0.5, 'supercritical')
    """
    return _HOPF


def branch_point() -> Event:
    """BP: another curve of solutions crosses this one.

    Verified: the derivative in unknowns and parameter together loses one rank, and the equations
    do vanish where it does. ``point.detail["tangents"]`` are those of both curves. Curves that pass
    each other at a distance below 1e-6 (relative to the solution) are taken to cross: the point
    then has a residual of up to 1e-12, and two folds are missed.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> mine = cb.Problem(lambda x, p: x * (p["mu"] - x), {"x": 0.0}, {"mu": -1.0})
    >>> branch = cb.trace(mine, "mu", events=[branch_point()], within={"mu": (-2, 2)})
    >>> abs(branch.first("BP")["mu"]) < 1e-12
    True
    """
    return _BRANCH_POINT


# --- on curves of folds -----------------------------------------------------------------------


def _fold_locus(point: Point) -> Locus:
    locus = events.fold_locus(point)
    return replace(locus, events=(cusp(),), meets={"HB": (_BT_ON_FOLD, _ON_FOLD_HOPF)})


def cusp() -> Event:
    """CP, on a fold curve: two folds meet. The quadratic coefficient of the fold vanishes, and the
    cubic one, ``detail["c"]``, does not.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> surface = cb.Problem(lambda x, p: p["h"] + p["mu"] * x - x**3, {"x": 1.0},
    ...                      {"mu": 1.0, "h": 0.0})
    >>> first = cb.trace(surface, "h", within={"x": (-2, 2)}, events=[cb.fold()]).first("LP")
    >>> line = cb.boundary(first, ("mu", "h"), within={"mu": (-1, 2)})  # looks for cusps by itself
    >>> abs(line.first("CP")["mu"]) < 1e-12
    True
    """
    return Event("CP", events.cusp_test, examine=_examine_cusp)


def _examine_cusp(point: Point) -> Examined:
    ground = point.ground
    quadratic, cubic = normal_forms.cubic_at_cusp(ground.curve, ground.z)
    # its terms may all vanish at once (h + mu x + x^5): then it is small against the equations
    unit = float(ground.curve.rows.max()) / normal_forms.Forms(ground.curve, ground.z).reach ** 2
    # where two folds are mirror images both vanish, and location is good to 1e-6 only
    small = 1e-5 * (cubic.size + quadratic.size) + 1e-6 * unit
    if abs(cubic.value) <= small:
        return f"the cubic coefficient vanishes as well: c = {cubic.value.real:.2g}"
    if abs(quadratic.value) > 1e-4 * (quadratic.size + abs(cubic.value)):
        return f"the quadratic coefficient {quadratic.value.real:.2g} is not zero"
    c = cubic.value.real
    return {"c": c, "degenerate": CROSSED} if events.branches_cross(ground) else {"c": c}


def oriented_overlap(matrix: Array) -> float:
    """``w . v`` of the left and right null vector as in the adjugate, so that no sign jumps: zero
    where the eigenvalue 0 is double with one eigenvector."""
    if len(matrix) < 2:
        return math.nan
    left, _, right = np.linalg.svd(matrix)
    return float(np.linalg.det(left) * np.linalg.det(right) * left[:, -1] @ right[-1])


def without(values: NDArray[np.complex128], *known: complex) -> NDArray[np.complex128]:
    """Eigenvalues but for those that the curve has everywhere: where a second one joins them the
    meeting has another name, BT for a flow."""
    for one in known:
        values = np.delete(values, int(abs(values - one).argmin()))
    return values


def _hopf_beside_zero(point: Point) -> float:
    """The test of a Hopf point for all eigenvalues but the one that is zero."""
    return _least_sum(without(_eigenvalues(point)[0], 0.0))


def _least_sum(values: NDArray[np.complex128]) -> float:
    if values.size < 2:
        return math.nan
    one, other = np.triu_indices(values.size, 1)
    return events.least_with_sign(values[one] + values[other], 0.0)


def _overlap(point: Point) -> float:
    """The test of BT where one eigenvalue is zero all along the curve."""
    ground = point.ground
    return oriented_overlap(ground.jacobian()[:, : ground.curve.size])


def _examine_takens(point: Point) -> Examined:
    found = _examine_double_zero(point)
    return found if isinstance(found, str) else found.get("degenerate", found)


def _examine_double_zero(point: Point) -> Examined:
    """A double zero with one eigenvector, whatever the normal form: there a curve of Hopf points
    ends, and one of branch points meets it. Both coefficients, and why it is another if it is."""
    ground = point.ground
    try:
        a, b = normal_forms.takens_bogdanov(ground.curve, ground.z)
    except OUT_OF_DOMAIN as error:
        return str(error)
    found = {"a": a.value.real, "b": b.value.real}
    if events.branches_cross(ground):
        return {**found, "degenerate": CROSSED}
    if a.degenerate or b.degenerate:
        reason = f"degenerate: a = {a.value.real:.2g}, b = {b.value.real:.2g}"
        return {**found, "degenerate": reason}
    return found


def _examine_zero_hopf(point: Point) -> Examined:
    """One eigenvalue zero in a fold, one pair on the axis and away from zero, no other on it."""
    if events.branches_cross(point.ground):
        return "a branch point, not a fold"
    return _examine_zero_and_pair(point)


def _examine_zero_and_pair(point: Point) -> Examined:
    values, small = _eigenvalues(point)
    zero = abs(values) < small
    pair = (abs(values.real) < small) & ~zero
    if zero.sum() >= 2:
        return "a double zero eigenvalue: BT, not ZH"
    if zero.sum() != 1:
        return "no eigenvalue is zero"
    if pair.sum() != 2:
        real = values[~zero & (abs(values.imag) < small)].real
        return f"no pair on the imaginary axis; real eigenvalues {real}: a neutral saddle"
    return {"omega": _frequency(values)}


def _frequency(values: NDArray[np.complex128]) -> float:
    """Of the pair nearest the imaginary axis."""
    pairs = values[values.imag > 0]
    return float(pairs[abs(pairs.real).argmin()].imag)


def _eigenvalues(point: Point) -> tuple[NDArray[np.complex128], float]:
    """Eigenvalues of the flow, and how small one must be to be zero."""
    ground = point.ground
    matrix = normal_forms.Forms(ground.curve, ground.z).A
    return np.linalg.eigvals(matrix).astype(complex), _ZERO * float(np.linalg.norm(matrix, 2))


# --- on curves of Hopf points -----------------------------------------------------------------


def _hopf_locus(point: Point) -> Locus:
    locus = events.hopf_locus(point)
    ends = (_BT_ON_HOPF, _GENERALISED, _DOUBLE_HOPF)
    return replace(locus, events=ends, meets={"LP": (_ON_HOPF_ZERO,)})


def _examine_hopf(point: Point) -> Examined:
    """omega, l1 and what the sign of l1 means, at a Hopf point; why not, where there is no l1."""
    reason = events.not_hopf(point)
    if reason:
        return reason
    ground = point.ground
    square = point.detail.get("omega2")
    omega = math.sqrt(square) if square and square > 0 else _frequency(_eigenvalues(point)[0])
    try:
        l1 = normal_forms.lyapunov(ground.curve, ground.z, omega)
    except OUT_OF_DOMAIN as error:
        return {"omega": omega, "criticality": f"unknown: {error}"}
    kind = normal_forms.criticality(l1, stable_if_negative=True)
    return {"omega": omega, "l1": l1.value.real, "criticality": kind}


def _lyapunov_on_hopf(point: Point) -> float:
    """l1 without its pole at ZH."""
    square = point["omega2"]
    if not square > 0:
        return math.nan  # beyond BT
    ground = point.ground
    l1 = normal_forms.value_or_nan(
        lambda: normal_forms.lyapunov(ground.curve, ground.z, math.sqrt(square))
    )
    return l1 * events.signed_smallest(normal_forms.Forms(ground.curve, ground.z).A)


def _examine_generalised(point: Point) -> str:
    ground = point.ground
    l1 = normal_forms.lyapunov(ground.curve, ground.z, math.sqrt(point["omega2"]))
    # its terms may all vanish at once: then it is small against a term of order one
    forms = normal_forms.Forms(ground.curve, ground.z)
    if abs(l1.value.real) > 1e-6 * (l1.size + forms.reach**-2):
        return f"the first Lyapunov coefficient {l1.value.real:.2g} is not zero"
    values, small = _eigenvalues(point)
    if (abs(values.real) < small).sum() != 2:
        return "more than one pair of eigenvalues on the imaginary axis"
    return ""


def _beside_pair(point: Point) -> NDArray[np.complex128]:
    """All eigenvalues but the pair on the axis; none beyond BT."""
    square = point["omega2"]
    if not square > 0:
        return np.empty(0, dtype=complex)
    axis = 1j * math.sqrt(square)
    return without(_eigenvalues(point)[0], axis, -axis)


def _second_pair(point: Point) -> float:
    """The test of a Hopf point for all eigenvalues but the pair on the axis."""
    return _least_sum(_beside_pair(point))


def _zero_beside_pair(point: Point) -> float:
    values = _beside_pair(point)
    return events.least_with_sign(values, 0.0) if values.size else math.nan


def _examine_second_pair(point: Point) -> str:
    values, small = _eigenvalues(point)
    on_axis = values[abs(values.real) < small]
    if on_axis.size != 4 or not (abs(on_axis.imag) > small).all():
        return f"not two pairs on the imaginary axis, but {on_axis}"
    return ""


# --- the events -------------------------------------------------------------------------------

_FOLD = Event("LP", events.fold_test, locus=_fold_locus, examine=events.examine_fold)
_HOPF = Event(
    "HB",
    events.hopf_test,
    count=events.unstable_pairs,
    locus=_hopf_locus,
    examine=_examine_hopf,
)
_GENERALISED = Event("GH", _lyapunov_on_hopf, examine=_examine_generalised)
_DOUBLE_HOPF = Event("HH", _second_pair, examine=_examine_second_pair)
# Beyond it omega^2 is negative: a neutral saddle, no Hopf point any more.
_BT_ON_HOPF = Meeting(
    "BT",
    lambda point: point["omega2"],
    examine=_examine_double_zero,
    ends="domain",
    met=_FOLD,
)
_ON_HOPF_ZERO = replace(
    meeting("HB", _FOLD), kind="ZH", test=_zero_beside_pair, examine=_examine_zero_hopf
)
_ON_FOLD_HOPF = replace(
    meeting("LP", _HOPF), kind="ZH", test=_hopf_beside_zero, examine=_examine_zero_hopf
)
_ON_BRANCH_POINTS = replace(
    meeting("BP", _HOPF), test=_hopf_beside_zero, examine=_examine_zero_and_pair
)
_BT_ON_FOLD = Meeting("BT", _overlap, examine=_examine_takens, met=_HOPF)
_BT_ON_BRANCH_POINTS = replace(_BT_ON_FOLD, examine=_examine_double_zero)
_BRANCH_POINT = Event(
    "BP",
    Singular(events.bordered, events.branch_point_test),
    count=events.unstable,
    locus=Crossings({"HB": (_BT_ON_BRANCH_POINTS, _ON_BRANCH_POINTS)}),
    examine=events.examine_branch_point,
)
