"""Structure of equations: what may be known of them besides their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from ..algebra.newton import Array
from ..algebra.sparse import Matrix
from .curve import Params


class Structure:
    """Attributes and methods that problems of this package have, or of a class derived from one.

    The engine asks for all of them, and gets by with these.
    """

    # ``(point) -> object``: what a point is to its user, as ``point.solution`` has it
    interpret: ClassVar[Callable[[Any], Any] | None] = None
    # ``(x, params, name) -> (n,) array``: the derivative in one parameter. Used, and checked,
    # together with `jacobian` only
    sensitivity: ClassVar[Callable[[Array, Params, str], Array] | None] = None
    # ``(x, params, names) -> (n, n + len(names)) array``: in place of `jacobian` and `sensitivity`
    derivatives: ClassVar[Callable[..., Matrix] | None] = None
    # whether tests of the class hold its derivatives to differences: they are not compared here
    tested: ClassVar[bool] = False
    # ``(names, params) -> (Walker, data) or None``: with these parameters free, the kernels of
    # `walk_kernel.walker` and what they ask for
    walker: ClassVar[Callable[..., Any] | None] = None
    # ``(x, params) -> array``: of equations whose derivatives cost so much more that those at the
    # last point are tried first, the residual to the accuracy that such an iteration needs
    roughly: ClassVar[Callable[[Array, Params], Array] | None] = None
    # ``(matrix, mu) -> (n, n) array``: of equations that say how a perturbation comes back after a
    # turn, the derivative whose null vectors are those that have grown by mu; affine in mu
    closing: ClassVar[Callable[[Matrix, complex], Matrix] | None] = None
    # ``(point) -> (values, error)``: of maps and cycles the multipliers but for a trivial one, and
    # what rounding may leave in each
    multipliers: ClassVar[Any] = None
    # and which unknowns a perturbation moves: not those of a mesh, which may stay where it is
    perturbed: ClassVar[Any] = None
    # ``(x, params, names) -> (curve, z)``: the curve of the shorter problem that this one extends
    # by a defining system, as on a boundary, and the point on it
    beneath: ClassVar[Callable[..., tuple[Any, Array]] | None] = None

    @property
    def internals(self) -> frozenset[str]:
        """Unknowns that say nothing by themselves, as the collocation of a cycle, its mesh and null
        vectors: tables are without them, and no sentence suggests them."""
        return frozenset()

    @property
    def serialised(self) -> Mapping[str, Any] | None:
        """Serialised form, of which files make the equations again: their ``kind``, entered by
        `contbreather.storage.serialise.serialised`, and the values that its reader takes by name,
        besides ``start`` and ``params``. None where that cannot be said."""
        return None

    def images(self, x: Array, params: Params) -> tuple[Array, ...]:
        """Solutions that a symmetry of the equations makes of one, its mirror image or the
        other phases of a cycle."""
        return ()

    def modulo(self, x: Array, params: Params) -> Mapping[str, Any]:
        """Periods of unknowns that are angles, by which they may move at x, of an array for each
        entry, 0 for those that are none: curves close, and solutions are the same, modulo that."""
        return {}

    def simpler(self, point: Any) -> Any:
        """Smaller problem that has a solution too, as its start: of a fixed point among the cycles
        of period 2 that of fixed points."""
        return None

    def lift(self, kind: str) -> Callable[[Any], Any] | None:
        """Maker of the `SwitchingProblem` of a point of this kind, which has the curves that leave
        it: `switch` follows them. None where there are none."""
        return None

    def finer(self, point: Any, along: Any) -> tuple[Any, Any] | None:
        """Refine the problem at a point that is `unresolved`: from its present start in more
        unknowns, and a direction in these. Its branch is walked anew."""
        return None

    def unresolved(self, point: Any) -> str:
        """Say what these unknowns do not resolve of a solution, empty if they do: the first such
        point of a walk that gets no finer problem is among the doubtful ones of its branch."""
        return ""

    def sized(self, sizes: Mapping[str, int]) -> Any:
        """Refine the problem from its present start as `finer` does, to unknowns of these sizes as
        far as that leads there: a file has points of a branch that was walked anew."""
        return self

    def with_parameters(self, names: tuple[str, ...]) -> Any:
        """Add parameters that the problem lacks, from its present start, as far as it can have
        them: `trace` and `boundary` ask for what is to be free."""
        return self
