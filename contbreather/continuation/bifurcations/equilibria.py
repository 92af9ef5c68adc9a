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
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np

from ...errors import BadInput
from ..algebra.linear_algebra import LOST, least_singular, sense
from ..algebra.newton import OUT_OF_DOMAIN, Array, Undefined
from ..algebra.sparse import is_sparse
from ..curve.branch import Points
from ..curve.point import (
    NOTHING,
    CodimensionTwo,
    DefiningSystem,
    Event,
    Examined,
    Many,
    Point,
    UnstableDimension,
)
from ..curve.problem import Problem
from ..systems import branch_points, normal_forms, spectrum
from ..systems import defining_systems as systems
from ..systems.spectrum import eigenvalues_at
from .stability_border import Border


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


def _fold_tests(points: Points) -> Many:
    # dp/ds: zero where the parameter turns back
    return points.tangent[:, -1], None


def _fold_test(point: Point) -> float:
    if point.tangent is not None:
        return float(point.tangent[-1])
    return systems.singular_in_unknowns(point.curve, point.z)[0]


def _fold_locus(point: Point, weak: Any = None) -> DefiningSystem:
    curve, n, cusps = point.curve, point.curve.size, _CUSP
    null = (weak or systems.singular_in_unknowns)(curve, point.z)[2][:n]
    if weak is None and is_sparse(curve.jacobian(point.z)):
        weak = systems.singular_in_unknowns
    if weak:
        cusps = replace(_CUSP, test=partial(_cusp_beside, weak, null))
        locus = systems.rank_locus(weak)
    else:
        null = null / curve.scales[:n]
        unit = null / (sense(null) * np.linalg.norm(null))
        locus = DefiningSystem({"null": unit}, systems.null_conditions, systems.null_slopes)
    return replace(locus, events=(cusps,), meets=_AXIS.meetings("LP"))


def _examine_fold(point: Point) -> str:
    curve, z, n = point.curve, point.z, point.curve.size
    weak = systems.least_in_unknowns(curve, z)
    # what vanishes within a short way along any direction vanishes here, whatever its units
    reach = branch_points.GAP * (1 + abs(z) / curve.scales)

    def changes(way: Array) -> float:
        change = weak.left @ curve.balanced(curve.along(z, way))
        return float(np.linalg.norm(change * reach))

    small = changes(weak.right * curve.scales[:n]) + 1e-14 * weak.largest  # which rounds
    by_params = abs(weak.left @ curve.balanced(curve.jacobian(z))[:, n:])
    # derivatives in the parameters, too: where a fold is narrow beside the size of its unknowns, or
    # they are tiny, those in the unknowns alone vanish
    if by_params.max(initial=0.0) <= small and all(
        value <= branch_points.GAP + changes(unit)
        for value, unit in zip(by_params, np.diag(curve.scales)[n:], strict=True)
    ):
        return "a branch point, not a fold: the whole derivative loses rank"
    # so it does where another mode is lost a short way along the curve, the fold's null vector
    whole = least_singular(curve.balanced(curve.jacobian(z)))
    bent = curve.balanced(curve.along(z, weak.right * curve.scales[:n])) @ whole.right
    way = np.linalg.norm(weak.right * reach[:n])
    if whole.size <= way * abs(whole.left @ bent) + 1e-14 * whole.largest:
        return "a branch point, not a fold: the whole derivative loses rank"
    if weak.size > small:
        return f"the derivative in the unknowns is regular: least singular value {weak.size:.2g}"
    return ""


def _cusp_beside(weak: Callable[..., Any], reference: Array, point: Point) -> float:
    """The test of CP where the null vector is no unknown: on the side of another. NaN where
    branches all but cross, and rounding decides the sign."""
    base, curve, n = point.base_point, point.base_point.curve, point.base_point.curve.size
    matrix = base.jacobian()
    if not is_sparse(matrix) and least_singular(curve.balanced(matrix)).size < branch_points.RANK:
        return math.nan
    _, left, right = weak(curve, base.z)
    null = right[:n]
    side = math.copysign(1.0, null @ reference)
    return float(side * left @ (curve.along(base.z, null)[:, :n] @ null) / 2)


def _cusp_test(point: Point) -> float:
    """w . F_xx v v / 2 with the left null vector w as in the adjugate, so that no sign jumps."""
    base, curve, n = point.base_point, point.base_point.curve, point.base_point.curve.size
    null = np.atleast_1d(point["null"])
    # <p, B(q, q)> / 2 of the fold's normal form (Yu. A. Kuznetsov, Elements of Applied
    # Bifurcation Theory, chapter 5), of a unit p whose sign follows the curve
    weak = least_singular(curve.in_units(base.jacobian()[:, :n]))
    sign = weak.sign * np.sign(weak.right @ null)
    bent = curve.in_units(curve.along(base.z, curve.scales[:n] * null)[:, :n]) @ null
    return float(sign * weak.left @ bent / 2)


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
    return _CUSP


def _examine_cusp(point: Point) -> Examined:
    base = point.base_point
    if systems.least_in_unknowns(base.curve, base.z).second <= LOST:
        return "the derivative in the unknowns loses two ranks: two null vectors"
    quadratic, cubic = normal_forms.cubic_at_cusp(point)
    # where two folds are mirror images both vanish, and location is good to a few 1e-6 only
    if abs(cubic.value) <= 1e-4 * cubic.size:
        c = f"c = {cubic.value.real:.2g}, beside {cubic.size:.2g}"
        return f"the cubic coefficient vanishes as well: {c}; small parameters need scales"
    if abs(quadratic.value) > 1e-4 * quadratic.size:
        return f"the quadratic coefficient {quadratic.value.real:.2g} is not zero"
    return {"c": cubic.value.real, **branch_points.crossed(base)}


# --- Hopf points ------------------------------------------------------------------------------


def _hopf_tests(points: Points) -> Many | None:
    """Tests and counts of HB at several points of a small problem."""
    curve = points.curve
    matrices, values = curve.jacobians(points.z), curve.spectra(points.z)
    if matrices is None or values is None:
        return None
    flows, _ = spectrum.in_sizes(curve, points.z, matrices)
    rounding = spectrum.ROUNDING * np.linalg.norm(flows, axis=(1, 2))
    first, second = spectrum.pairs(values.T)
    rounding = rounding[:, None]
    counts = spectrum.pairs_beyond(values, partial(spectrum.right_of_axis, rounding))
    if not first.size:
        return np.full(len(points), math.nan), counts
    return spectrum.least_with_sign((first + second).T, rounding), counts


def unstable(point: Point) -> int:
    """The number of eigenvalues to the right of the imaginary axis, by more than rounding."""
    found = spectrum.all_eigenvalues(point.base_point.curve, point.base_point.z)
    return int(np.count_nonzero(found.values.real > found.rounding))


def has_multipliers(problem: Problem) -> bool:
    """Tell whether a problem is of a map or an orbit, which have NS and no HB."""
    # somebody's own NS, of neutral saddles, has no locus
    return any(event.kind == "NS" and event.locus for event in problem.events)


@dataclass(frozen=True, repr=False)
class _OfFlow(Event):
    """An event of flows: where it is looked for, eigenvalues say which equilibria are unstable."""

    def of(self, problem: Problem) -> Event:
        if has_multipliers(problem):
            for event in problem.events:
                if event.kind == self.kind:  # where cycles end
                    return event
            raise BadInput(
                f"no {self.kind} of this problem ({problem.kinds}): it has multipliers, and where "
                "a pair of them passes the unit circle is NS."
            )
        return self

    def columns(self, problem: Problem) -> Mapping[str, UnstableDimension]:
        # of more unknowns some are known only, of sparse ones, or they take seconds
        return {"unstable": UnstableDimension(unstable)} if problem.x.size <= spectrum.FEW else {}


def _hopf_locus(point: Point) -> DefiningSystem:
    omega = point.detail.get("omega")
    start = {"omega2": omega**2 if omega else eigenvalues_at(point).square_of_pair()}
    # trace and determinant within the plane of a pair are 0 and omega2: smooth at zero
    return DefiningSystem(
        start, spectrum.plane_conditions, spectrum.plane_slopes, events=_ON_HOPF,
        meets=_AXIS.meetings("HB"),
    )  # fmt: skip


def _examine_hopf(point: Point) -> Examined:
    """omega, l1 and what the sign of l1 means; why not, where there is no l1."""
    upper, square = _AXIS.pair_at(point), point.detail.get("omega2", math.nan)
    if not isinstance(upper, complex):
        return upper
    known, omega = eigenvalues_at(point), math.sqrt(square) if square > 0 else upper.imag
    reach = {"reach": known.reach} if is_sparse(known.matrix) else {}
    make = partial(normal_forms.lyapunov_coefficient, point, omega)
    return normal_forms.criticality("l1", make, stable_if_negative=True, omega=omega, **reach)


# --- where a second zero joins the one that a curve has everywhere ------------------------------


def _examine_takens(point: Point) -> Examined:
    verdict = _examine_double_zero(point)
    return verdict if isinstance(verdict, str) else verdict.get("degenerate", verdict)


def _examine_double_zero(point: Point) -> Examined:
    """A double zero with one eigenvector: its coefficients, and whether they are degenerate."""
    base = point.base_point
    try:
        a, b = normal_forms.takens_bogdanov(point)
    except OUT_OF_DOMAIN as error:
        return str(error)
    coefficients: dict[str, Any] = {"a": a.value.real, "b": b.value.real}
    if a.degenerate or b.degenerate:
        coefficients["degenerate"] = f"degenerate: a = {a.value.real:.2g}, b = {b.value.real:.2g}"
    return coefficients | branch_points.crossed(base)


def _examine_on_branch_points(point: Point) -> Examined:
    base = point.base_point
    if systems.least_in_unknowns(base.curve, base.z).second <= LOST:
        return NOTHING  # another curve of branch points crosses: two zeros with a vector each
    return _examine_double_zero(point)


def _lyapunov(point: Point, agreed: float) -> normal_forms.Coefficient:
    if not point["omega2"] > 0:
        raise Undefined("beyond BT are neutral saddles")
    return normal_forms.lyapunov_coefficient(point, math.sqrt(point["omega2"]), agreed)


# --- the events -------------------------------------------------------------------------------


def _pair_followed(point: Point) -> complex | None:
    # omega2 is solved for, more exactly than by the eigenvalues; it is negative beyond BT
    return 1j * math.sqrt(point["omega2"]) if point["omega2"] > 0 else None


_AXIS = Border(
    "eigenvalues", "imaginary axis", {"BP": 0.0, "LP": 0.0}, "HB", eigenvalues_at, _pair_followed,
    ("omega", attrgetter("imag")), names={("LP", "HB"): "ZH"},
)  # fmt: skip
_CUSP = Event("CP", _cusp_test, examine=_examine_cusp)
_FOLD = Event(
    "LP", _fold_test, many=_fold_tests, locus=_fold_locus, examine=_examine_fold, turns=True
)
# where parts that are alike have a fold each all but together, and only their common motion turns
FOLD_OF_ALIKE = replace(_FOLD, locus=partial(_fold_locus, weak=systems.turning))
_HOPF = _OfFlow(
    "HB", partial(_AXIS.least_of_pairs, ""), many=_hopf_tests, count=_AXIS.unstable_pairs,
    locus=_hopf_locus, examine=_examine_hopf, may_jump=_AXIS.may_jump,
)  # fmt: skip
_AXIS.events.update(LP=_FOLD, HB=_HOPF)
# where another eigenvalue passes zero the signs of null vectors jump
_BT = CodimensionTwo("BT", systems.overlap, examine=_examine_takens, may_jump=True, base=_HOPF)
_AXIS.double.update(LP=_BT, BP=replace(_BT, examine=_examine_on_branch_points))
_ON_HOPF = (
    # beyond it omega^2 is negative: a neutral saddle, no Hopf point any more
    CodimensionTwo(
        "BT", itemgetter("omega2"), examine=_examine_double_zero, ends="domain", base=_FOLD
    ),
    _AXIS.degenerate("GH", "HB", (0.0,), "the first Lyapunov coefficient", _lyapunov),
    _AXIS.two_pairs("HH"),
)
_BRANCH_POINT = branch_points.crossing_event(_AXIS.meetings("BP"))
