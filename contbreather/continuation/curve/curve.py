"""Curves H(z) = 0: a problem with named parameters set free, its derivatives and its measures."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from itertools import count
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...checks import check_call
from ...errors import BadInput
from ..algebra import derivatives
from ..algebra.linear_algebra import least_singular, sense
from ..algebra.newton import FEW, OUT_OF_DOMAIN, Array, Solution, Undefined, chord, newton
from ..algebra.sparse import (
    Dense,
    Factors,
    Matrix,
    Pattern,
    beside,
    canonical,
    checked_finite,
    dense,
    first_columns,
    is_large,
    is_sparse,
    row_sizes,
    scaled,
)
from ..algebra.walk_kernel import Pieces, Walker, at_a_place

T = TypeVar("T")
Params = Mapping[str, float]
Residual = Callable[[Any, Any], Any]  # f(x, p) of an array and a dict, however these are annotated

LEVEL = 1e-9  # a component of a unit vector that is smaller is rounding
TINY = 1e-10  # an unknown or a parameter that is smaller, in its scale, is zero
PASSED = 9  # latest places of a walk that say how large its equations are
AHEAD = 1e-3  # how far off, relative to 1 + |z|, where curves cross looks like any other place


class Curve:
    """A problem with named parameters set free: H(z) with ``z = (x, free parameters)``."""

    def __repr__(self) -> str:
        return f"<Curve in {', '.join(self.varied)} of {self.problem!r}>"

    def __init__(self, problem: Any, free: tuple[str, ...]) -> None:
        for name in free:
            if not isinstance(name, str) or name not in problem.params:
                has = [*problem.params, *problem.freed_in_turn]
                listed = isinstance(name, list | tuple)
                two = "; `boundary` follows a point in two of them" if listed else ""
                raise BadInput(f"{name!r} is not a parameter of this problem; it has {has}{two}")
        self.problem = problem  # a Problem, which is built on curves
        self.free = free
        # all that change along it: on a boundary the one that its locus determines is an unknown
        self.varied = free if problem.beneath is None else (*free, list(problem.start)[-1])
        self.size = problem.x.size
        self.fixed = {name: float(value) for name, value in problem.params.items()}
        self.start = np.append(problem.x, [self.fixed[name] for name in free])
        self.slots = {**problem.slots, **dict(zip(free, count(self.size), strict=False))}
        # typical sizes of the entries of z, and weights W of the squared arclength: t^T W is the
        # row whose product with z is the inner product with t.
        self.scales, self.metric = np.ones(self.start.size), np.ones(self.start.size)
        # |z|^2 = sum z_i^2 / (m_i s_i^2), with s the scales and m the size of the array of an
        # entry: of a mean square, so that a refined mesh keeps its steps
        for name, slot in self.slots.items():
            of = self.scales[slot]
            # fewer than there are entries repeat: those of states, at all times along an orbit
            self.scales[slot] = size = np.resize(problem.scales.get(name, 1.0), of.shape)
            self.metric[slot] = 1 / (of.size * size**2)
        self._scheme: derivatives.Scheme | None = None
        self._row_scales: Array | None = None
        self._passed: list[Array] = []
        self._places: dict[float, Pieces | None] = {}
        # events looked for on it, None for those of its problem: arms that set out look for them
        self.asked: tuple[Any, ...] | None = None
        self._known = defaultdict[Hashable, dict[bytes, Any]](dict)

    def __getstate__(self) -> dict[str, Any]:
        """Without what was made of the latest points: quickly made again, and large."""
        return {**self.__dict__, "_known": defaultdict(dict), "_places": {}}

    def length(self, z: Array) -> float:
        return math.sqrt(z.dot(self.metric * z))

    def turned(self, z: Array, near: Array) -> Array:
        """Turn the angles of a solution to where they are nearest to those of others."""
        periods = self.problem.modulo(z[: self.size], self.params(z))
        if not periods:
            return z
        turned = np.array(np.broadcast_to(z, near.shape))
        for name, period in periods.items():
            i = self.slots[name]
            laps = np.round((near[..., i] - z[i]) / np.where(period, period, np.inf))
            turned[..., i] += period * laps
        return turned

    def normalised(self, z: Array) -> Array:
        return z / self.length(z)

    @property
    def row_scales(self) -> Array:
        """Size of the derivative of each equation along the latest piece of curve: what is small
        against it counts as zero."""
        if self._row_scales is None:
            self._row_scales = self._first_sizes
        passed, self._passed = self._passed, []
        for z in passed:
            # halved, not forgotten: a row may vanish for a moment, as where curves cross
            self._row_scales = np.maximum(0.5 * self._row_scales, self.row_sizes(z))
        return self._row_scales

    @row_scales.setter
    def row_scales(self, sizes: Array) -> None:
        self._row_scales = sizes

    @cached_property
    def _first_sizes(self) -> Array:
        sizes = self.row_sizes(self.start)
        # a row of this relative size says nothing of its equation; those of x' = F are compared
        # as rates
        rates = sizes / self.scales[: self.size]
        if not (rates.size > 1 and rates.min() > 1e-9 * rates.max()):
            # where curves cross a whole row, or the only one, may vanish: it is seen aside
            z = self.start + AHEAD * (1 + self.length(self.start)) * self.scales
            with suppress(Undefined):
                checked_finite(self.jacobian(z))
                return np.maximum(sizes, self.row_sizes(z))
        return sizes

    @cached_property
    def row_units(self) -> Array:
        """Units of the equations, the same all along the curve: powers of a million, so that those
        of usual size stay as they are."""
        return np.asarray(2.0 ** (20 * np.round(np.log2(self._first_sizes) / 20)))

    def passes(self, z: Array) -> None:
        """Take note of a place of a walk, for `row_scales`: they are wanted on few of them."""
        self._passed = [*self._passed[1 - PASSED :], z]

    def row_sizes(self, z: Array) -> Array:
        sizes = row_sizes(self.jacobian(z), self.scales)
        sizes[sizes == 0] = 1.0
        return sizes

    def unlike_scales(self, z: Array) -> str:
        """Name unknowns and parameters far from 1 in size without `scales`."""
        problem, unlike = self.problem, {}
        largest = np.maximum(abs(self.start), abs(z))
        for name, slot in self.slots.items():
            size = float(np.max(largest[slot]))
            # what is between is walked along without
            far = TINY < size < 1e-3 or size > 1e4
            if far and name not in problem.internals and name not in problem.scales:
                unlike[name] = float(f"{size:.0e}")
        return f"sizes are far from 1: give the problem scales={unlike}" if unlike else ""

    def balanced(self, matrix: Matrix) -> Matrix:
        """A derivative, or its first columns, in units of `scales` and `row_scales`."""
        # R^-1 J S: singular values then do not depend on the units of equations and unknowns
        return scaled(matrix, 1 / self.row_scales, self.scales[: matrix.shape[1]])

    def in_units(self, matrix: Matrix) -> Matrix:
        """The same, or several, in units of `scales` and `row_units`."""
        return scaled(matrix, 1 / self.row_units, self.scales[: matrix.shape[-1]])

    def params(self, z: Array) -> dict[str, float]:
        values, real = self.fixed.copy(), z.dtype.kind != "c"
        for i, name in enumerate(self.free, self.size):
            # complex numbers stay those of numpy, which can be compared
            values[name] = float(z[i]) if real else z[i]
        return values

    def residual(self, z: Array, function: Residual | None = None) -> Array:
        """Evaluate the equations, or others, without any checks, at a possibly complex z."""
        # copies: equations that write to x do not move the point, and the same array may come back
        # each time, written anew
        x, function = z[: self.size].copy(), function or self.problem.residual
        value = np.array(function(x, self.params(z)), ndmin=1)
        if value.dtype.kind == "c" and z.dtype.kind != "c":  # what Python makes of (-1.0) ** 0.5
            raise Undefined("the equations are not real")
        return value

    def equations(self, z: Array, function: Residual | None = None) -> Array:
        """The residual, or `Undefined` where it has none."""
        value = self.call(self.residual, z, function)
        try:  # the sum is finite unless an entry is not (or all but overflows, which is as bad)
            total = np.add.reduce(value, axis=None)
            finite = isinstance(total, complex) or math.isfinite(total)
        except (TypeError, OverflowError) as error:
            raise BadInput(
                f"the residual is {value!r}; an array of numbers was expected"
            ) from error
        if value.shape != (self.size,):
            raise BadInput(
                f"the residual has shape {value.shape} for {self.size} unknowns; "
                f"as many equations as unknowns, {(self.size,)}, were expected"
            )
        if isinstance(total, complex) or not finite:  # complex numbers that are objects
            why = "finite" if not finite else "real"
            raise Undefined(f"the equations are not {why}")
        return value

    def call(self, function: Callable[..., Any], *given: Any) -> Any:
        """Ask a user's function, with `Undefined` where it has no value."""
        try:
            return function(*given)
        except OUT_OF_DOMAIN as error:
            raise Undefined(str(error)) from error
        except KeyError as error:
            params = self.problem.params
            if error.args and error.args[0] not in params:
                raise BadInput(
                    f"the equations ask for a parameter {error.args[0]!r}; this problem has "
                    f"{list(params)}"
                ) from error
            raise
        except TypeError:
            check_call("the residual", self.problem.residual, "x")
            raise

    def solved_near(
        self, near: Array | None, guess: Array, row: Array, tolerance: float, **how: int
    ) -> Solution:
        """The solution next to a guess: by the derivative at a place near by, if that is known and
        serves; or by Newton's method."""
        solution: Solution | None = None
        if near is not None:
            try:
                solution = self._chord(near, guess, row, tolerance)
            except Undefined:  # Newton's corrections may stay where there are values
                solution = None
        return solution or newton(self, guess, row, tolerance=tolerance, **how)

    def _chord(self, near: Array, guess: Array, row: Array, tolerance: float) -> Solution | None:
        known = self._known["jacobian"]
        if near.tobytes() not in known:
            return None
        here, ahead = known[near.tobytes()], row.dot(guess - near)
        factors: Dense | Factors | None = None
        for key in () if is_large(here) else [*known][::-1]:  # the latest first
            back = near - np.frombuffer(key)
            length = row.dot(back)
            # of a place about as far behind: how the derivative changes goes on beyond this one
            if 0.25 * ahead < length < 4.0 * ahead and self.length(back) < 2.0 * length:
                factors = Dense(here + ahead / length * (here - known[key]), row)
                break
        factors = factors or self.factors(near, row)
        roughly = self.problem.roughly and partial(self.equations, function=self.problem.roughly)
        return chord(self, roughly, factors, guess, row, tolerance, ahead)

    def kernels(self) -> tuple[Walker, Any] | None:
        """Kernels of its problem and what they ask for; None where there is no machine code."""
        walker = self.problem.walker
        known = None if walker is None else walker(self.free, self.fixed)
        return None if known is None or known[0].walk.code is None else known

    def corrected(
        self, guess: Array, row: Array, tolerance: float
    ) -> tuple[Array, Array, float] | None:
        """Newton's iteration across a row by machine code: solution, tangent, residual, or None."""
        if tolerance not in self._places:
            known = self.kernels()
            self._places[tolerance] = known and Pieces(*known, at_a_place(tolerance, self.metric))
        pieces = self._places[tolerance]
        return None if pieces is None else pieces.corrected(guess, row / self.metric)

    def cached(
        self, what: Hashable, z: Array, make: Callable[[Array], T], *, keep: bool = False
    ) -> T:
        """Make something of z once for the latest places: all events ask in turn. Or for any place,
        where it is to be kept."""
        recent, key = self._known[what], z.tobytes()
        value = recent.get(key)
        if value is None:
            value = recent[key] = make(z)
            most = 4 if self.size >= FEW else 64  # of few unknowns little is kept
            for oldest in () if keep else [*recent][:-most]:  # another thread may be at it as well
                recent.pop(oldest, None)
        made: T = value
        return made

    def jacobian(self, z: Array) -> Matrix:
        """Derivative of `equations`, ``(n, n + len(free))``; not to be written to."""
        return self.cached("jacobian", z, partial(self.call, self._derivatives))

    def prepare(self, places: Sequence[Array]) -> None:
        """Let the problem solve for several places at once, whose derivatives come next."""
        if self.problem.prepare is not None:
            known = [(z[: self.size].copy(), self.params(z)) for z in places]
            self.call(self.problem.prepare, known, self.free)

    def factors(self, z: Array, row: Array) -> Dense | Factors:
        """The derivative factorised, to be solved with a row below; once where that is dear."""
        matrix = self.jacobian(z)
        large = is_large(matrix)
        return self.cached("factors", z, lambda z: Factors(matrix)) if large else Dense(matrix, row)

    def tangent_at(
        self, z: Array, along: Array, factors: Dense | Factors | None = None
    ) -> tuple[Array, int]:
        """Unit tangent at z on the side of `along`, and the sign of the bordered determinant;
        by `factors` of the derivative with that direction below, where these are known.

        That sign is the same all along a curve and changes at branch points. Where the bordered
        matrix is singular it is 0, and the tangent is the null vector closest to `along`.
        """
        row = self.metric * along
        tangent, side = (factors or self.factors(z, row)).tangent(row)
        if tangent is not None and math.isfinite(tangent.sum()):
            return self.normalised(tangent), side
        weak = least_singular(checked_finite(self.jacobian(z)))
        # where the derivative has lost a rank, all of a plane are null vectors
        vectors = weak.plane if weak.lost else weak.null
        nearest = (vectors @ row) @ vectors
        if self.length(nearest) > LEVEL:
            return self.normalised(nearest), 0
        return self.normalised(vectors[-1] * sense(vectors[-1])), 0

    def in_unknowns(self, z: Array) -> Matrix:
        """The derivative in the unknowns alone; not to be written to."""
        known = z.tobytes() in self._known["jacobian"]
        # what is given for the unknowns needs no differences in the parameters
        if self.problem.jacobian is not None and self.problem.derivatives is None and not known:
            return self.cached("in unknowns", z, partial(self.call, self._given_in_unknowns))
        return first_columns(self.jacobian(z), self.size)

    def spectrum(self, z: Array) -> NDArray[np.complex128]:
        """Eigenvalues of the derivative in the unknowns; not to be written to."""

        def eigenvalues(z: Array) -> NDArray[np.complex128]:
            return np.linalg.eigvals(dense(self.jacobian(z)[:, : self.size])).astype(complex)

        return self.cached("spectrum", z, eigenvalues)

    def jacobians(self, rows: Array) -> Array | None:
        """Derivatives at several z; None of large ones, and of those on boundaries."""
        if rows.shape[1] > FEW or self.problem.beneath is not None:
            return None
        matrices = [*map(self.jacobian, rows)]
        return None if is_sparse(matrices[0]) else np.array(matrices)

    def spectra(self, rows: Array) -> NDArray[np.complex128] | None:
        """Eigenvalues of the derivative in the unknowns at several z, where `jacobians` are."""
        matrices, n = self.jacobians(rows), self.size
        if matrices is None:
            return None
        values = self.cached("spectra", rows, lambda _: np.linalg.eigvals(matrices[:, :, :n]))
        return values.astype(complex)

    def _derivatives(self, z: Array) -> Matrix:
        problem, n = self.problem, self.size
        if problem.derivatives is not None:
            whole = problem.derivatives(z[:n].copy(), self.params(z), self.free)
            return whole if is_sparse(whole) else np.asarray(whole)
        if problem.jacobian is None:
            return self._by_trying(self.residual, z, range(z.size), self.scales)
        jacobian = self._known["in unknowns"].get(z.tobytes())
        jacobian = self._given_in_unknowns(z) if jacobian is None else jacobian
        columns = np.empty((n, len(self.free)))  # in the parameters
        if problem.sensitivity is not None:
            for i, name in enumerate(self.free):
                columns[:, i] = problem.sensitivity(z[:n].copy(), self.params(z), name)
        elif self.free and is_sparse(jacobian):
            columns[:] = self._by_few(z, np.zeros(n), range(1, len(self.free) + 1))
        elif self.free:
            columns[:] = self._by_trying(self.residual, z, range(n, z.size), self.scales)
        if not is_sparse(jacobian):
            matrix = np.empty((n, z.size))
            matrix[:, :n], matrix[:, n:] = jacobian, columns
            return matrix
        return checked_finite(beside(jacobian, columns))

    def _given_in_unknowns(self, z: Array) -> Matrix:
        given: Any = self.problem.jacobian
        n = self.size
        if isinstance(given, Pattern):
            # unknowns of one colour move together, each in proportion to its size
            steps = np.maximum(self.scales, abs(z))[:n]
            few = partial(self._by_few, z, columns=range(1))
            return checked_finite(given.derivative(lambda way: few(way)[:, 0], steps))
        matrix: Any = given(z[:n].copy(), self.params(z))
        return checked_finite(canonical(matrix)) if is_sparse(matrix) else np.asarray(matrix)

    def _by_few(self, z: Array, way: Array, columns: range) -> Array:
        """Derivatives along one direction of the unknowns, column 0, and in the parameters."""
        n = self.size

        def shifted(t: Array) -> Array:
            return self.residual(np.concatenate([z[:n] + t[0] * way, t[1:]]))

        start, scales = np.append(0.0, z[n:]), np.append(1.0, self.scales[n:])
        return self._by_trying(shifted, start, columns, scales)

    def along(self, z: Array, vector: Array, *, ahead: bool = False) -> Array:
        """Derivative of the Jacobian along a vector of z or unknowns, with `ahead` on its side."""
        direction = np.zeros(z.size)
        direction[: vector.size] = vector
        how: dict[str, Any] = {"ahead": ahead, "prepare": self.prepare}
        return derivatives.along(self.jacobian, z, direction, self.scales, **how)

    def _by_trying(
        self, function: Callable[[Array], Array], z: Array, columns: range, scales: Array
    ) -> Array:
        """Columns of the derivative by the scheme that suits the residual."""
        if self._scheme is derivatives.complex_steps:
            try:
                return self._scheme(function, z, columns)
            except OUT_OF_DOMAIN:
                raise
            except Exception:  # noqa: BLE001 - as where the scheme is chosen
                self._scheme = None
        if self._scheme is None:
            # where a row vanishes, as at a branch point on x = 0, what is left of its terms is
            # rounding, in which no two schemes agree: what holds aside holds there
            aside = z + AHEAD * np.maximum(scales, abs(z))
            self._scheme = derivatives.choose(function, aside, scales)
            if self._scheme is not derivatives.complex_steps:  # by steps that suit this place
                finer = derivatives.estimate(function, z, scales)[2]
                self._scheme = partial(self._scheme, finer=finer)
        return self._scheme(function, z, columns)

    def forget(self) -> None:
        """Forget what was made of derivatives; solutions, which columns ask for later, stay."""
        self._scheme = None
        solutions = self._known.pop("solution", {})
        self._known.clear()
        self._known["solution"] = solutions
