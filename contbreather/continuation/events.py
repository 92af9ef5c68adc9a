"""What can happen on a curve: test functions with a zero or a jump, and how each is traced on.

An event comes from its problem; the engine asks ``event.test(point)`` and never for its kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..checks import number
from ..errors import BadInput, NotConverged
from .branch import Point
from .crossing import GAP, along, crossing
from .newton import Solution, Undefined, solve
from .problem import Curve

Array = NDArray[np.float64]

_NEARLY = 0.1  # how far off the real axis, relative, two zeros that are not quite real may be
_EDGE = 1e-9  # how far outside of a step its ends still belong to it
_EXACT = 1e-14  # relative rounding of singular values
_RANK = 1e-7  # balanced singular value of a matrix that loses rank; at a located point about 1e-12
_ZERO = 1e-6  # relative size of eigenvalues that are both zero: a double zero splits by a root
# Sums of eigenvalues this small against the derivative are rounding: twice what differences leave
# where they are zero all along a branch, as in conservative systems.
_ROUNDING = 2e-13
_PARTING = 1e-5  # and of a second derivative that vanishes along a curve of branch points
# Branches that miss each other by a distance d solve the equations up to d^2 between them: what is
# left after Newton's iteration with differences, and what `crossing` takes for one.
_SPLIT = 1e-10
_NONE = 1e-100  # the size of what has a sign only


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
    domain : dict, optional
        ``{name: (low, high)}``, bounds of parameters, where they are freed, within which the
        conditions can be followed, as far as they are narrower than those of the problem.
    meets : dict, optional
        ``{kind: events}`` to look for on the boundary in place of the meeting with an event of that
        kind, where that has names of its own: on a fold curve HB is met at BT and ZH.
    unfolding : callable, optional
        ``unfolding(extra) -> (value, slope)``, shapes (n,) and (n, m): what is added to the
        problem's own equations, and its derivative. Needed where these alone are singular along
        the curve, as they are at branch points; where the event is met it vanishes.
    """

    extra: Mapping[str, Any]
    conditions: Callable[[Curve, Array, Array], Array]
    derivative: Callable[[Curve, Array, Array], Array] | None = None
    events: tuple[Event, ...] = ()
    domain: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    meets: Mapping[str, tuple[Event, ...]] = field(default_factory=dict)
    unfolding: Callable[[Array], tuple[Array, Array]] | None = None


Examined = str | Mapping[str, Any]


@dataclass(frozen=True, repr=False)
class Event:
    """A test function along a curve, and what its zero means.

    Parameters
    ----------
    kind : str
        The field's label: LP, BP, PF, NS, PD, GR, HB, UZ.
    test : callable or None
        ``test(point)`` returns a float with a zero at the event, or an int (or bool) that jumps
        there. It may return NaN where it has no meaning: nothing is looked for there. A `Singular`
        looks ahead as well. None where there is a `count` alone, of what all other events change:
        where it changes without one, the place is kept among the doubtful.
    count : callable, optional
        ``count(point) -> int``, a number that changes by one where the test has a simple zero, of
        unstable eigenvalues for instance. Two zeros within a step, which leave no change of sign,
        are seen by it.
    locus : callable, optional
        ``locus(point) -> Locus`` at a point close to the event, its curve with both parameters
        free where a boundary sets out. Needed to trace the event in two parameters, and to locate
        one whose test jumps beyond what bisection gives.
    examine : callable, optional
        ``examine(point)`` returns a str, the reason why a located point is not what the kind says,
        empty if it is; or a dict of what else to know of it, coefficients of its normal form for
        instance. That is kept in ``point.detail``, but for "kind", a better name.
    ends : {'', 'branch', 'domain'}
        Whether the branch ends at the event, and whether solutions mean something on the positive
        side of the test only: then a start beyond is refused.

    Examples
    --------
    >>> Event("UZ", lambda point: point["x"] - 0.5).ends
    ''
    """

    kind: str
    test: Callable[[Point], float | int] | None
    count: Callable[[Point], int | float] | None = field(default=None, kw_only=True)
    locus: Callable[[Point], Locus] | None = field(default=None, kw_only=True)
    examine: Callable[[Point], Examined] | None = field(default=None, kw_only=True)
    ends: Literal["", "branch", "domain"] = field(default="", kw_only=True)

    def __post_init__(self) -> None:
        if self.ends not in ("", "branch", "domain"):
            raise BadInput(f"ends={self.ends!r}: '', 'branch' or 'domain' was wanted")
        if self.test is None and self.count is None:
            raise BadInput(f"an event of kind {self.kind} needs a test, or at least a count")

    @property
    def crosses(self) -> bool:
        """Whether curves cross there: the equations are singular, and solved for otherwise."""
        return isinstance(self.locus, Crossings)

    @property
    def walls(self) -> bool:
        """Whether solutions mean nothing beyond it."""
        return self.ends == "domain"

    @property
    def bifurcates(self) -> bool:
        """Whether counts of unstable directions are decided by rounding there: not at a wall, at a
        level that a user asked for, and where a count changes for no reason that is known."""
        return not (self.walls or self.test is None or isinstance(self.test, Level))

    def of(self, problem: Any) -> Event:
        """The event as it is for one problem: itself, unless only its kind is known so far."""
        return self

    def value(self, point: Point) -> float | int:
        """What is looked at along the curve: the test, or the count where there is no test."""
        look = self.test or self.count
        assert look is not None
        return look(point)

    def __repr__(self) -> str:
        return f"<Event {self.kind}{', terminal' if self.ends else ''}>"


@dataclass(frozen=True, repr=False)
class Judged(Event):
    """An event with a rule of its own for who counts as unstable: the columns that go with it.

    Parameters
    ----------
    record : dict
        Columns in place of those of the problem of the same names.
    about : str
        What these columns are about, shown with the label of the problem.
    """

    record: Mapping[str, Callable[[Point], float]] = field(default_factory=dict, kw_only=True)
    about: str = field(default="", kw_only=True)


@dataclass(frozen=True, repr=False)
class Meeting(Event):
    """An event on a boundary; `met` is the event of the original problem that happens there too,
    so that a meeting can be the start of either curve."""

    met: Event = field(kw_only=True)

    @property
    def bifurcates(self) -> bool:
        return self.met.bifurcates


@dataclass(frozen=True)
class Singular:
    """A test by a matrix that is singular at the event.

    Its smallest singular value, with the sign of the determinant, is the test, unless `size` is
    given; and where between two points the matrix should be singular is looked at, so that two
    zeros within a step leave their changes of sign.
    """

    matrix: Callable[[Point], Array]
    size: Callable[[Point], float] | None = None

    def __call__(self, point: Point) -> float:
        return signed_smallest(self.matrix(point)) if self.size is None else self.size(point)


@dataclass(frozen=True)
class Level:
    """A test by a named value that passes a level."""

    name: str
    value: float

    def __call__(self, point: Point) -> float:
        return float(point[self.name] - self.value)

    def __str__(self) -> str:
        return f"{self.name} = {self.value:.12g}"


def user(name: str, value: float, *, terminal: bool = False) -> Event:
    """UZ: a named value (an unknown, a parameter, a recorded number) passes `value`.

    Traced in two parameters it is a contour line of that value. A located point says which of
    several levels it is on: ``point.detail["level"]`` is ``"mu = 0.3"``, and so do tables.

    Examples
    --------
    >>> user("mu", 0.3)
    <Event UZ>
    """

    if not isinstance(name, str):
        raise BadInput(f"user({name!r}, ...): the name of an unknown or a parameter was wanted")
    value = number("value", value, -1e300, 1e300, "the level to stop at")

    def conditions(curve: Curve, z: Array, extra: Array) -> Array:
        return np.array([Point(curve, z.copy())[name] - value])

    return Event(
        "UZ",
        Level(name, value),
        locus=lambda point: Locus({}, conditions),
        ends="branch" if terminal else "",
    )


# --- folds ------------------------------------------------------------------------------------


def fold_test(point: Point) -> float:
    if point.tangent is not None:
        return float(point.tangent[-1])
    return signed_smallest(_balanced(point)[:, : point.curve.size])


def fold_locus(point: Point) -> Locus:
    null = _null_vector(point)
    return Locus({"null": null}, _fold_conditions, _fold_derivative)


def _fold_conditions(curve: Curve, z: Array, null: Array) -> Array:
    return np.append(curve.jacobian(z)[:, : curve.size] @ null, null.dot(null) - 1)


def _fold_derivative(curve: Curve, z: Array, null: Array) -> Array:
    n = curve.size
    rows = np.zeros((n + 1, z.size + n))
    # second derivatives are symmetric: d/dz (F_x v) is the derivative of F_z along v
    rows[:n, : z.size] = along(curve, z, null)
    rows[:n, z.size :] = curve.jacobian(z)[:, :n]
    rows[n, z.size :] = 2 * null
    return rows


def examine_fold(point: Point) -> str:
    if point.tangent is not None and "null" not in point.detail:
        return "a degenerate fold or a branch point: no null vector could be solved for"
    curve, z, n = point.curve, point.z, point.curve.size
    whole = _balanced(point)
    left, sizes, right = np.linalg.svd(whole[:, :n])
    change = left[:, -1] @ curve.balanced(along(curve, z, right[-1] * curve.scales[:n]))
    # what vanishes within a short way along any direction vanishes here, whatever its units
    near = GAP * (1 + curve.length(z)) * np.linalg.norm(change) + _EXACT * sizes[0]
    if abs(left[:, -1] @ whole[:, n:]).max(initial=0.0) <= near:
        return "a branch point, not a fold: the whole derivative loses rank"
    if sizes[-1] > near:
        return f"the derivative in the unknowns is regular: least singular value {sizes[-1]:.2g}"
    return ""


def cusp_test(point: Point) -> float:
    """w . F_xx v v / 2 with the left null vector w as in the adjugate, so that no sign jumps."""
    ground, null = point.ground, np.atleast_1d(point["null"])
    n = ground.curve.size
    left, _, right = np.linalg.svd(ground.jacobian()[:, :n])
    sign = np.linalg.det(left) * np.linalg.det(right) * np.sign(right[-1] @ null)
    return float(sign * left[:, -1] @ along(ground.curve, ground.z, null)[:, :n] @ null / 2)


# --- branch points ----------------------------------------------------------------------------


def branch_point_test(point: Point) -> float:
    if point.tangent is None:
        return float("nan")  # of codimension two on a boundary: nothing to look for
    return signed_smallest(bordered(point))


def bordered(point: Point) -> Array:
    curve, whole = point.curve, np.empty((point.z.size, point.z.size))
    whole[:-1], whole[-1] = curve.jacobian(point.z), curve.dual(point.direction)
    whole *= curve.scales
    return whole


def examine_branch_point(point: Point) -> str:
    return "" if "tangents" in point.detail else "no two curves were found to cross here"


@dataclass(frozen=True)
class Crossings:
    """The locus of an event where curves cross.

    Along one of them the equations are singular there: it is located by `solve`, and its locus is
    one in two parameters only.
    """

    meets: Mapping[str, tuple[Event, ...]] = field(default_factory=dict)

    def __call__(self, point: Point) -> Locus:
        # all along a curve of branch points the derivative in the unknowns is singular
        return replace(_branch_point_locus(point), meets={"LP": (), **self.meets})

    @staticmethod
    def solve(point: Point) -> tuple[Solution, Mapping[str, Any]]:
        found = crossing(point.curve, point.z)
        if found.double:
            reason = "the derivative loses more than one rank: not a simple branch point"
            return found.solution, {"tangents": found.tangents, "reason": reason}
        return found.solution, {"tangents": found.tangents}


def branches_cross(ground: Point) -> bool:
    """Whether the derivative in unknowns and both parameters loses one rank: solutions then are
    no smooth surface, and branches cross for other values of the parameters as well."""
    sizes = np.linalg.svd(_balanced(ground), compute_uv=False)
    return bool(sizes[-1] < _RANK and (sizes.size == 1 or sizes[-2] > _RANK))


def _branch_point_locus(point: Point) -> Locus:
    """``H + split b = 0`` and rank n - 1 of ``A = (H_x, H_p d)``, where the direction d of the two
    parameters leaves the curve of branch points.

    H alone is singular at every branch point, so it is unfolded by `split`: by how much branches
    that do not quite cross miss each other. Curves of branch points need three parameters in
    general. With two there are some where a symmetry or an invariant subspace holds the branches
    together, and then `split` stays 0.
    """
    b, null, direction = _held_together(point)

    def bordered(curve: Curve, z: Array) -> Array:
        A = _columns(curve.jacobian(z), direction)
        return np.block([[A, b[:, None]], [null, np.zeros((2, 1))]])

    def conditions(curve: Curve, z: Array, extra: Array) -> Array:
        return _solved(bordered(curve, z), np.eye(curve.size + 2)[:, -2:])[-1]

    def derivative(curve: Curve, z: Array, extra: Array) -> Array:
        matrix, n = bordered(curve, z), curve.size
        unit = np.eye(n + 2)
        vectors, w = _solved(matrix, unit[:, -2:])[:-1].T, _solved(matrix.T, unit[-1])[:n]
        # - w^T A'(u) v for all u at once: second derivatives are symmetric
        rows = [w @ along(curve, z, np.append(v[:n], v[n] * direction)) for v in vectors]
        return -np.hstack([rows, np.zeros((2, 1))])

    stays = Event("BP", _refuse_to_part)
    return Locus(
        {"split": 0.0},
        conditions,
        derivative,
        events=(stays,),
        unfolding=lambda extra: (extra[0] * b, b[:, None]),
    )


def _columns(rows: Array, direction: Array) -> Array:
    """Columns of the unknowns, and of the parameters along a direction."""
    n = rows.shape[1] - 2
    return np.hstack([rows[:, :n], (rows[:, n:] @ direction)[:, None]])


def _solved(matrix: Array, right: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError as error:
        raise Undefined("more than one rank is lost at a branch point") from error


def _held_together(point: Point) -> tuple[Array, Array, Array]:
    """Left and right null vectors of A, and the direction d across the curve of branch points: to
    first order nothing changes along the null vector of ``w^T H_zz`` in the null space of H_z."""
    curve, z = point.curve, point.z
    one, other = curve.free
    left, sizes, right = np.linalg.svd(_balanced(point))
    refusal = (
        f"the branches cross at these values of {one} and {other} only, and come apart beside "
        "them; a curve of such branch points needs a third parameter"
    )
    if sizes[-1] > _RANK:
        raise Undefined(refusal)
    null = right[-3:]
    bent = np.stack([curve.balanced(along(curve, z, v * curve.scales)) for v in null])
    form = left[:, -1] @ bent @ null.T
    values, axes = np.linalg.eigh((form + form.T) / 2)
    least = int(abs(values).argmin())
    if abs(values[least]) > _PARTING * abs(values).max():
        raise Undefined(refusal)
    tangent = (axes[:, least] @ null * curve.scales)[-2:]
    if not np.linalg.norm(tangent) > _RANK:
        raise Undefined(f"the branch point does not move with {one} and {other}")
    direction = np.array([-tangent[1], tangent[0]]) / np.linalg.norm(tangent)
    w = left[:, -1] / curve.rows
    return (
        w / np.linalg.norm(w),
        np.linalg.svd(_columns(point.jacobian(), direction))[2][-2:],
        direction,
    )


def _refuse_to_part(point: Point) -> float:
    """No test: the curve is analytic, so that branches either cross all along it or nowhere else
    but at its start."""
    ground = point.ground
    split = abs(point["split"]) / float(ground.curve.rows.max())
    if split > _SPLIT * (1 + ground.curve.length(ground.z)) ** 2:
        values = ", ".join(f"{name} = {point[name]:.6g}" for name in ground.curve.free)
        raise NotConverged(
            f"no curve of branch points: at {values} the branches have come apart (they miss each "
            f"other by {split:.2g} in the equations); it needs a third parameter",
            residual=split,
        )
    return float("nan")


# --- Hopf points ------------------------------------------------------------------------------


def hopf_test(point: Point) -> float:
    """The smallest sum of two eigenvalues, with the sign of the product of all such sums."""
    values = point.curve.spectrum(point.z)
    if values.size < 2:
        return float("nan")
    first, second = np.triu_indices(values.size, 1)
    return least_with_sign(values[first] + values[second], _rounding(point))


def least_with_sign(factors: NDArray[np.complex128], rounding: Array | float) -> float:
    """The size of the smallest factor with the sign of the product of all: it vanishes where the
    product does, smoothly, and cannot overflow.

    A factor that is rounding, as it is all along the branches of conservative systems, is zero.
    Several of them have no size, and the sign that the others have: a zero of even order.
    """
    sizes = abs(factors)
    clear = sizes > rounding
    least = sizes.min() if clear.all() else 0.0 if np.count_nonzero(~clear) == 1 else _NONE
    return float(np.copysign(least, np.prod(factors[clear] / sizes[clear]).real))


def _rounding(point: Point) -> float:
    return _ROUNDING * float(np.linalg.norm(_flow(point)))


def unstable_pairs(point: Point) -> int:
    """Half the number of eigenvalues to the right of the imaginary axis, by more than rounding."""
    beyond = point.curve.spectrum(point.z).real > _rounding(point)
    return int(np.count_nonzero(beyond)) // 2


def hopf_locus(point: Point) -> Locus:
    square, real, imaginary = _axis_pair(_flow(point))
    real, imaginary = (vector * point.curve.scales[: vector.size] for vector in (real, imaginary))
    null, reference = frame(real, imaginary)

    def conditions(curve: Curve, z: Array, extra: Array) -> Array:
        null, square = extra[:-1], extra[-1]
        matrix = curve.jacobian(z)[:, : curve.size]
        own = matrix @ (matrix @ null) + square * null
        return np.concatenate([own, [null.dot(null) - 1, reference.dot(null)]])

    def derivative(curve: Curve, z: Array, extra: Array) -> Array:
        null, square, n = extra[:-1], extra[-1], curve.size
        matrix = curve.jacobian(z)[:, :n]
        rows = np.zeros((n + 2, z.size + n + 1))
        rows[:n, : z.size] = along(curve, z, matrix @ null) + matrix @ along(curve, z, null)
        rows[:n, z.size : -1] = matrix @ matrix + square * np.eye(n)
        rows[:n, -1] = null
        rows[n, z.size : -1], rows[n + 1, z.size : -1] = 2 * null, reference
        return rows

    return Locus({"null": null, "omega2": square}, conditions, derivative)


def _flow(point: Point) -> Array:
    """The derivative between unknowns in their scales, which keeps the eigenvalues."""
    scales = point.curve.scales[: point.curve.size]
    return np.asarray(point.jacobian()[:, : scales.size] * scales / scales[:, None])


def _axis_pair(matrix: Array) -> tuple[float, Array, Array]:
    """omega^2 of the eigenvalues nearest the imaginary axis, and two vectors of their plane."""
    values, vectors = np.linalg.eig(matrix)
    size = _ZERO * np.linalg.norm(matrix, 2)
    if np.count_nonzero(abs(values) < size) == 2:  # both zero, with one eigenvector
        null = np.linalg.svd(matrix)[2][-1]
        return 0.0, np.linalg.lstsq(matrix, null)[0], null
    pairs = np.flatnonzero(values.imag > 0)
    if not pairs.size:
        raise Undefined("no complex pair of eigenvalues: a neutral saddle, not a Hopf point")
    nearest = pairs[np.argmin(abs(values[pairs].real))]
    vector = vectors[:, nearest]
    return float(values[nearest].imag ** 2), vector.real, vector.imag


def frame(one: Array, other: Array) -> tuple[Array, Array]:
    """Orthonormal vectors of the plane of a pair, the first between both that are given: where the
    pair becomes a double eigenvalue its eigenvector must not be that one, as it satisfies the
    conditions of a pair by itself."""
    null = one / np.linalg.norm(one) + other / np.linalg.norm(other)
    null /= np.linalg.norm(null)
    reference = one - (one @ null) * null
    return null, reference / np.linalg.norm(reference)


def not_hopf(point: Point) -> str:
    """Of the two eigenvalues that add up to nothing: are they a complex pair? On a boundary they
    may be both zero, where it meets a fold curve."""
    matrix = _flow(point)
    values = np.linalg.eigvals(matrix)
    first, second = np.triu_indices(values.size, 1)
    nearest = np.argmin(abs(values[first] + values[second]))
    pair = values[[first[nearest], second[nearest]]]
    zero = abs(pair).max() <= _ZERO * np.linalg.norm(matrix, 2)
    if zero and point.tangent is not None:
        return "a double zero eigenvalue: no pair on the imaginary axis"
    if not zero and not pair.imag.any():
        return (
            f"a neutral saddle: the eigenvalues {pair[0].real:.3g} and {pair[1].real:.3g} are real"
        )
    return ""


# --- linear algebra that events share ---------------------------------------------------------


def unstable(point: Point) -> int:
    """Number of eigenvalues of the derivative in the unknowns with positive real part."""
    return int(np.count_nonzero(point.curve.spectrum(point.z).real > 0))


def _balanced(point: Point) -> Array:
    return point.curve.balanced(point.jacobian())


def _null_vector(point: Point) -> Array:
    """Unit vector of the unknowns that the derivative annihilates, or nearly so."""
    n = point.curve.size
    vector = np.linalg.svd(_balanced(point)[:, :n])[2][-1] * point.curve.scales[:n]
    return vector / np.linalg.norm(vector)


def singular_between(first: Array, *others: Array) -> Array:
    """Where from the first of several matrices, 0, to the last, 1, they are singular, in order, by
    linear interpolation of two or quadratic of three.

    Of steep and shallow singular values side by side the smallest alone shows no two zeros.
    """
    change = _pencil(first, *others)
    if change is None:  # an event is where the first is: seen from the other end
        change = _pencil(*others[::-1], first)
        return np.empty(0) if change is None else 1 - _inverses(change)[::-1]
    return _inverses(change)


def _pencil(first: Array, *others: Array) -> Array | None:
    """A matrix whose eigenvalues are the inverses of these places."""
    middle, last = (others[0], others[-1]) if len(others) > 1 else (None, others[-1])
    if middle is None:
        return solve(first, first - last)
    bend = 2 * (first - 2 * middle + last)
    change = solve(first, np.hstack([first + bend - last, -bend]))
    return change if change is None else np.vstack([change, np.eye(*change.shape)])


def _inverses(matrix: Array) -> Array:
    """The inverses of the eigenvalues, as far as they are real and from 0 to 1, in order."""
    if not (1.0 - _EDGE) ** 2 <= (matrix * matrix).sum() < math.inf:
        return np.empty(0)  # no eigenvalue of a smaller matrix reaches 1
    values = np.linalg.eigvals(matrix)
    places = values.real / np.maximum(abs(values) ** 2, 1e-300)
    near = (abs(values.imag) < _NEARLY * abs(values)) & (abs(places - 0.5) <= 0.5 + _EDGE)
    return np.sort(places[near])


def signed_smallest(matrix: Array) -> float:
    """Smallest singular value with the sign of the determinant: smooth through a simple zero."""
    left, values, right = np.linalg.svd(matrix)
    return float(np.linalg.det(left) * np.linalg.det(right) * values[-1])
