"""Proofs by interval arithmetic: that a breather exists, keeps off the walls, is stable or not."""

from __future__ import annotations

from typing import Any, overload

from contbreather.certified.balls import Interval
from contbreather.certified.certificate import Certificate, Covering, Tile
from contbreather.certified.proofs import DEFINING, certify_curve, certify_point, parameters
from contbreather.checks import number
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.problem import TiedProblem
from contbreather.continuation.systems.defining_systems import event_of
from contbreather.errors import BadInput

__all__ = ["Certificate", "Covering", "Interval", "Tile", "certify"]


@overload
def certify(what: Branch, *, within: float = ...) -> Covering: ...
@overload
def certify(what: Any, *, within: float = ...) -> Certificate: ...
def certify(what: Any, *, within: float = 1e-8) -> Certificate | Covering:
    """Prove what was computed of symmetric breathers of the infinite chain, rounding included.

    Parameters
    ----------
    what : Orbit, Point or Branch
        A breather; a point of a branch (of a fold or pitchfork its parameter is enclosed as well);
        a branch in one parameter. Parameters are taken for exactly the floats that they are.
    within : float
        How far from a point the exact one may be, in each unknown.

    Returns
    -------
    Certificate or, of a branch, Covering
        What is proved and what is not.

    Raises
    ------
    BadInput
        Without python-flint (``pip install 'contbreather[certified]'``); for anything but symmetric
        breathers with one impacting site on the infinite chain, without springs, driven by
        `Harmonic` or `Fourier`.

    Examples
    --------
    >>> import contbreather as cb
    >>> proof = certify(cb.symmetric(a=0.5, gamma=0.08, k=0.8))
    >>> proof.exists, proof.unique, proof.admissible, proof.unstable
    (True, True, True, 0)
    >>> proof.enclosure["p"].width < 1e-15
    True
    """
    within = number("within", within, 1e-15, 0.1, "between 1e-15 and 0.1")
    if isinstance(what, Branch):
        if event_of(what.problem) is not None:
            raise BadInput(
                "certify() takes branches in one parameter; of a boundary take its points, line[3]."
            )
        _refuse_tied(what.problem)
        params = parameters(_orbit(what[0]))
        return certify_curve(params, what.free, [tuple(map(float, point.z)) for point in what])
    orbit, kinds = what, list[str]()
    if isinstance(what, Point):
        line = event_of(what.curve.problem)  # of which boundary it is a point
        orbit, kinds = _orbit(what), [what.kind] + ([line.kind] if line else [])
    params, unknowns = parameters(orbit), {"p": orbit.p, "phi": orbit.phi}
    special = next((kind for kind in kinds if kind in DEFINING), "")
    if special:
        _refuse_tied(what.base_point.curve.problem)
        free = what.curve.free[0]
        unknowns[free] = params.pop(free)
    return certify_point(params, unknowns, special, within)


def _refuse_tied(problem: Any) -> None:
    if type(problem) is TiedProblem:  # not one of orbits, whose drive is tied to omega
        raise BadInput(
            "certify() proves breathers in parameters of their own, not in tied ones: take the "
            "breather of a point, branch[3].solution."
        )


def _orbit(point: Point) -> Any:
    """What a point means to its problem, or the point itself, of equations alone."""
    return point if point.base_point.problem.interpret is None else point.solution
