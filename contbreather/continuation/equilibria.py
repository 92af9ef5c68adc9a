"""LP, BP and HB of any equations, or of a flow ``x' = F``, and what their curves meet.

On curves of folds CP, where two of them meet; for a flow also BT (a double zero eigenvalue), ZH (a
zero and a pair on the imaginary axis), GH (the first Lyapunov coefficient vanishes) and HH (two
pairs). Each is verified by the eigenvalues, and by coefficients of its normal form.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import branch_points, normal_forms, spectrum
from . import defining_systems as systems
from .boundary import codim_two
from .branch import Points
from .linear_algebra import least_singular
from .newton import OUT_OF_DOMAIN
from .point import CodimensionTwo, DefiningSystem, Event, Examined, Many, Point, UnstableDimension
from .problem import Problem
from .sparse import Matrix, is_sparse

Array = NDArray[np.float64]
Values = NDArray[np.complex128]

_EXACT = 1e-14  # relative rounding of singular values
_ZERO = 1e-6  # relative size of eigenvalues that are both zero: a double zero splits by a root
_CLOSE = 1e-5  # and where two curves meet
_FINE = 10.0  # the same where few are known, relative to what rounding makes of a double one


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

    A pair of real eigenvalues of opposite sign (a neutral saddle) is distinguished. A located point
    knows ``detail["omega"]``, the first Lyapunov coefficient ``detail["l1"]`` (for the eigenvector
    of length 1; negative: a stable limit cycle is born) and what its sign means,
    ``detail["criticality"]``. Where it is looked for, branches of up to 250 unknowns have a column
    ``unstable``, the number of eigenvalues to the right of the axis, by which `plot` dashes what is
    unstable; it is counted when it is read. As a curve in two parameters it meets GH, ZH, HH, and
    ends at BT, where ``detail["degenerate"]`` says so if the normal form is another: by symmetry,
    for instance.

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


# --- folds ------------------------------------------------------------------------------------


def _fold_tests(points: Points) -> tuple[Array, None]:
    """Test of LP at many points: dp/ds."""
    return points.tangent[:, -1], None


def _fold_test(point: Point) -> float:
    if point.tangent is not None:
        # dp/ds: zero where the parameter turns back
        return float(point.tangent[-1])
    return systems.signed_smallest(branch_points.balanced(point)[:, : point.curve.size])


def _fold_locus(point: Point) -> DefiningSystem:
    curve, matrix = point.curve, branch_points.balanced(point)[:, : point.curve.size]
    if is_sparse(matrix):
        null = systems.least_in_unknowns(curve, point.z).right * curve.scales[: curve.size]
        cusps = replace(cusp(), test=partial(_cusp_beside, null))
        return replace(systems.rank_locus(), events=(cusps,), meets=MEETINGS["LP"])
    null = systems.null_vector(matrix, curve.scales[: curve.size])
    return replace(systems.null_locus(null), events=(cusp(),), meets=MEETINGS["LP"])


def _vanish(point: Point, left: Array, by_params: Array, reach: Array) -> bool:
    """Whether derivatives in the parameters vanish within a short way, too: where a fold is narrow
    beside the size of its unknowns, or they are tiny, those in the unknowns alone do."""
    curve = point.curve
    for value, unit in zip(by_params, np.diag(curve.scales)[curve.size :], strict=True):
        change = left @ curve.balanced(curve.along(point.z, unit))
        if abs(value) > branch_points.GAP + np.linalg.norm(change * reach):
            return False
    return True


def _examine_fold(point: Point) -> str:
    curve, z, n = point.curve, point.z, point.curve.size
    whole = branch_points.balanced(point)
    weak = systems.least_in_unknowns(curve, z)
    change = weak.left @ curve.balanced(curve.along(z, weak.right * curve.scales[:n]))
    # what vanishes within a short way along any direction vanishes here, whatever its units
    reach = branch_points.GAP * (1 + abs(z) / curve.scales)
    small = np.linalg.norm(change * reach) + _EXACT * weak.largest
    by_params = weak.left @ whole[:, n:]
    if abs(by_params).max(initial=0.0) <= small and _vanish(point, weak.left, by_params, reach):
        return "a branch point, not a fold: the whole derivative loses rank"
    if weak.size > small:
        return f"the derivative in the unknowns is regular: least singular value {weak.size:.2g}"
    return ""


def _cusp_test(point: Point) -> float:
    return _quadratic(point.base_point, np.atleast_1d(point["null"]))


def _cusp_beside(reference: Array, point: Point) -> float:
    """The same with the null vector that is no unknown here, on the side of another."""
    base = point.base_point
    weak = systems.least_in_unknowns(base.curve, base.z)
    null = weak.right * base.curve.scales[: base.curve.size]
    return _quadratic(base, math.copysign(1.0, null @ reference) * null)


def _quadratic(base: Point, null: Array) -> float:
    """w . F_xx v v / 2 with the left null vector w as in the adjugate, so that no sign jumps."""
    curve, n = base.curve, base.curve.size
    # <p, B(q, q)> / 2 of the fold's normal form (Yu. A. Kuznetsov, Elements of Applied
    # Bifurcation Theory, chapter 5), of a unit p whose sign follows the curve
    weak = least_singular(base.jacobian()[:, :n])
    sign = weak.sign * np.sign(weak.right @ null)
    return float(sign * weak.left @ (curve.along(base.z, null)[:, :n] @ null) / 2)


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
    return Event("CP", _cusp_test, examine=_examine_cusp)


def _examine_cusp(point: Point) -> Examined:
    base = point.base_point
    quadratic, cubic = normal_forms.cubic_at_cusp(point)
    # where two folds are mirror images both vanish, and location is good to a few 1e-6 only
    if abs(cubic.value) <= 1e-4 * cubic.size:
        return f"the cubic coefficient vanishes as well: c = {cubic.value.real:.2g}"
    if abs(quadratic.value) > 1e-4 * quadratic.size:
        return f"the quadratic coefficient {quadratic.value.real:.2g} is not zero"
    return {"c": cubic.value.real, **branch_points.crossed(base)}


# --- Hopf points ------------------------------------------------------------------------------


def _hopf_test(point: Point) -> float:
    rounding = 0.0 if _large(point) else _rounding(point)
    return _off_axis(point, _eigenvalues(point), rounding)


def _hopf_tests(points: Points) -> Many | None:
    """Tests and counts of HB at several points of a small problem."""
    curve = points.curve
    matrices, values = curve.jacobians(points.z), curve.spectra(points.z)
    if matrices is None or values is None:
        return None
    scales = curve.scales[: curve.size]
    flows = matrices[:, :, : curve.size] / scales[:, None] * scales
    rounding = systems.ROUNDING * np.linalg.norm(flows, axis=(1, 2))
    counts = np.count_nonzero(values.real > rounding[:, None], axis=1) // 2
    first, second = systems.pairs(values.T)
    sums = (first + second).T
    if not sums.size:
        return np.full(len(points), math.nan), counts
    sizes = abs(sums)
    if (sizes > rounding[:, None]).all():
        sides = np.prod(sums / sizes, axis=1).real
        return np.copysign(sizes.min(axis=1), sides), counts
    pairs = zip(sums, rounding, strict=True)
    return np.array([systems.least_with_sign(*pair) for pair in pairs]), counts


def _off_axis(point: Point, values: Values, rounding: float = 0.0) -> float:
    """By how much the pair nearest the imaginary axis is off it: the smallest sum of two of these
    eigenvalues, with the sign of the product of all such sums."""
    if _large(point):
        # complex pairs alone: of all others, and of those further to the left, some are not known
        nearest = _near(point)
        upper = values[values.imag > nearest.rounding]
        sums, rounding = (-upper.real).astype(complex), nearest.rounding**2
    else:
        first, second = systems.pairs(values)
        # the eigenvalues of the bialternate product of 2 F_x and 1, singular at Hopf points
        # (W. Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM, 2000)
        sums = first + second
    return systems.least_with_sign(sums, rounding) if sums.size else math.nan


def _large(point: Point) -> bool:
    """Whether only a few of the eigenvalues are known."""
    return is_sparse(point.base_point.curve.jacobian(point.base_point.z))


def _near(point: Point) -> spectrum.NearestEigenvalues:
    return spectrum.near_axis(point.base_point.curve, point.base_point.z)


def _eigenvalues(point: Point) -> Values:
    """Of the flow; of a large one those that are known."""
    return (
        _near(point).values
        if _large(point)
        else point.base_point.curve.spectrum(point.base_point.z)
    )


def _flow(point: Point) -> Matrix:
    return spectrum.flow(point.base_point.curve, point.base_point.z)


def _rounding(point: Point) -> float:
    matrix = _flow(point)
    return systems.ROUNDING * float(np.linalg.norm(matrix.data if is_sparse(matrix) else matrix))


def _small(point: Point) -> float:
    """How small an eigenvalue must be to be zero."""
    if _large(point):
        return _FINE * _near(point).rounding
    return _CLOSE * float(np.linalg.norm(_flow(point), 2))


def unstable(point: Point) -> int:
    """The number of eigenvalues to the right of the imaginary axis, by more than rounding."""
    values = point.base_point.curve.spectrum(point.base_point.z)
    return int(np.count_nonzero(values.real > _rounding(point)))


@dataclass(frozen=True, repr=False)
class _OfFlow(Event):
    """An event of flows: where it is looked for, eigenvalues say which equilibria are unstable."""

    def columns(self, problem: Problem) -> Mapping[str, UnstableDimension]:
        # of more unknowns some are known only, of sparse ones, or they take seconds
        return {"unstable": UnstableDimension(unstable)} if problem.x.size <= spectrum.FEW else {}


def _unstable_pairs(point: Point) -> int:
    """Half the number of eigenvalues to the right of the imaginary axis, by more than rounding."""
    if _large(point):
        nearest = _near(point)
        return int(np.count_nonzero(nearest.pairs.real > nearest.rounding**2))
    return int(np.count_nonzero(_eigenvalues(point).real > _rounding(point))) // 2


def _hopf_locus(point: Point) -> DefiningSystem:
    """``(F_x^2 + omega^2) v = 0`` in the plane of the pair."""
    ends = (_BT_ON_HOPF, _GENERALISED, _DOUBLE_HOPF)
    if _large(point):
        # one unknown, in place of a vector as long as x, and of F_x^2, which is less sparse
        in_plane = spectrum.conditions_in_plane(spectrum.square_of_pair(point.curve, point.z))
        return replace(in_plane, events=ends, meets=MEETINGS["HB"])
    matrix, scales = _flow(point), point.curve.scales[: point.curve.size]
    small = _ZERO * float(np.linalg.norm(matrix, 2))
    value, first, second = systems.critical_plane(matrix, small)
    locus = systems.pair_locus(value.imag**2, (first * scales, second * scales))
    return replace(locus, events=ends, meets=MEETINGS["HB"])


def _examine_hopf(point: Point) -> Examined:
    """omega, l1 and what the sign of l1 means; why not, where there is no l1."""
    verdict = _pair_on_axis(point)
    if isinstance(verdict, str):
        return verdict
    return verdict | normal_forms.criticality(
        "l1",
        lambda: normal_forms.lyapunov_coefficient(point, verdict["omega"]),
        stable_if_negative=True,
    )


def _pair_on_axis(point: Point) -> str | dict[str, float]:
    """Of the two eigenvalues that add up to nothing: are they a complex pair? On a boundary they
    may be both zero, where it meets a fold curve."""
    if _large(point):
        nearest = _near(point)
        square = point.detail.get("omega2", point.values.get("omega2", math.nan))
        if not square > nearest.rounding**2:
            return (
                "no pair of eigenvalues on the imaginary axis was solved for: a real pair, or none"
            )
        return {"omega": math.sqrt(square), "reach": nearest.reach}
    values = _eigenvalues(point)
    first, second = systems.pairs(values)
    least = int(abs(first + second).argmin())
    pair = np.array([first[least], second[least]])
    zero = abs(pair).max() <= _ZERO * np.linalg.norm(_flow(point), 2)
    if zero and point.tangent is not None:
        return "a double zero eigenvalue: no pair on the imaginary axis"
    if not zero and not pair.imag.any():
        return (
            f"a neutral saddle: the eigenvalues {pair[0].real:.3g} and {pair[1].real:.3g} are real"
        )
    square = point.detail.get("omega2")
    return {"omega": math.sqrt(square) if square and square > 0 else _frequency(values)}


# --- where a pair or a second zero joins the one that a curve has everywhere --------------------


def _hopf_beside_zero(point: Point) -> float:
    """The test of a Hopf point for all eigenvalues but the one that is zero."""
    values = _eigenvalues(point)
    return _off_axis(point, values if _large(point) else systems.without(values, 0.0))


def _examine_takens(point: Point) -> Examined:
    verdict = _examine_double_zero(point)
    return verdict if isinstance(verdict, str) else verdict.get("degenerate", verdict)


def _examine_double_zero(point: Point) -> Examined:
    """A double zero with one eigenvector, whatever the normal form: there a curve of Hopf points
    ends, and one of branch points meets it. Both coefficients, and why it is another if it is."""
    base = point.base_point
    try:
        a, b = normal_forms.takens_bogdanov(point)
    except OUT_OF_DOMAIN as error:
        return str(error)
    coefficients: dict[str, Any] = {"a": a.value.real, "b": b.value.real}
    if a.degenerate or b.degenerate:
        coefficients["degenerate"] = f"degenerate: a = {a.value.real:.2g}, b = {b.value.real:.2g}"
    return coefficients | branch_points.crossed(base)


def _examine_zero_hopf(point: Point) -> Examined:
    """One eigenvalue zero in a fold, one pair on the axis and away from zero, no other on it."""
    if branch_points.branches_cross(point.base_point):
        return "a branch point, not a fold"
    return _examine_zero_and_pair(point)


def _examine_zero_and_pair(point: Point) -> Examined:
    values, small = _eigenvalues(point), _small(point)
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


def _frequency(values: Values) -> float:
    """Of the pair nearest the imaginary axis."""
    pairs = values[values.imag > 0]
    return float(pairs[abs(pairs.real).argmin()].imag)


# --- on curves of Hopf points -----------------------------------------------------------------


def _lyapunov_on_hopf(point: Point) -> float:
    """l1 without its pole at ZH."""
    square = point["omega2"]
    if not square > 0:
        return math.nan  # beyond BT
    # det F_x vanishes at ZH as 1 / l1 does
    l1 = normal_forms.value_or_nan(
        lambda: normal_forms.lyapunov_coefficient(point, math.sqrt(square))
    )
    return l1 * systems.signed_smallest(_flow(point))


def _examine_generalised(point: Point) -> str:
    l1 = normal_forms.lyapunov_coefficient(point, math.sqrt(point["omega2"]))
    reason = normal_forms.not_zero("the first Lyapunov coefficient", l1, point)
    if not reason and (abs(_eigenvalues(point).real) < _small(point)).sum() != 2:
        return "more than one pair of eigenvalues on the imaginary axis"
    return reason


def _beside_pair(point: Point) -> Values:
    """All eigenvalues but the pair on the axis; none beyond BT."""
    square, values = point["omega2"], _eigenvalues(point)
    if not square > 0 or values.size < 2:
        return np.empty(0, dtype=complex)
    # omega2 is solved for, more exactly than by the eigenvalues
    axis = 1j * math.sqrt(square)
    return systems.without(values, axis, -axis)


def _second_pair(point: Point) -> float:
    """The test of a Hopf point for all eigenvalues but the pair on the axis."""
    return _off_axis(point, _beside_pair(point))


def _zero_beside_pair(point: Point) -> float:
    if _large(point):
        return systems.signed_smallest(_flow(point))
    values = _beside_pair(point)
    return systems.least_with_sign(values, 0.0) if values.size else math.nan


def _examine_second_pair(point: Point) -> str:
    values, small = _eigenvalues(point), _small(point)
    on_axis = values[abs(values.real) < small]
    if on_axis.size != 4 or not (abs(on_axis.imag) > small).all():
        return f"not two pairs on the imaginary axis, but {on_axis}"
    return ""


# --- the events -------------------------------------------------------------------------------

_FOLD = Event(
    "LP",
    _fold_test,
    many=_fold_tests,
    locus=_fold_locus,
    examine=_examine_fold,
)
_HOPF = _OfFlow(
    "HB",
    _hopf_test,
    many=_hopf_tests,
    count=_unstable_pairs,
    locus=_hopf_locus,
    examine=_examine_hopf,
)
_GENERALISED = Event("GH", _lyapunov_on_hopf, examine=_examine_generalised)
_DOUBLE_HOPF = Event("HH", _second_pair, examine=_examine_second_pair)
# Beyond it omega^2 is negative: a neutral saddle, no Hopf point any more.
_BT_ON_HOPF = CodimensionTwo(
    "BT", itemgetter("omega2"), examine=_examine_double_zero, ends="domain", base=_FOLD
)
_BT = CodimensionTwo("BT", systems.overlap, examine=_examine_takens, base=_HOPF)


def _zero_hopf(on: str, event: Event, test: Callable[[Point], float]) -> CodimensionTwo:
    return replace(codim_two(on, event), kind="ZH", test=test, examine=_examine_zero_hopf)


# On the boundary of one kind, what the meeting with another is called.
MEETINGS: dict[str, Mapping[str, tuple[Event, ...]]] = {
    "LP": {"HB": (_BT, _zero_hopf("LP", _HOPF, _hopf_beside_zero))},
    "HB": {"LP": (_zero_hopf("HB", _FOLD, _zero_beside_pair),)},
    "BP": {
        "HB": (
            replace(_BT, examine=_examine_double_zero),
            replace(codim_two("BP", _HOPF), test=_hopf_beside_zero, examine=_examine_zero_and_pair),
        )
    },
}
_BRANCH_POINT = branch_points.crossing_event(MEETINGS["BP"])
