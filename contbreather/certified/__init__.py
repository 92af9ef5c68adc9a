"""Proofs by interval arithmetic: that a breather exists, keeps off the walls, is stable or not."""

from __future__ import annotations

from typing import Any, overload

from contbreather.certified.balls import Interval
from contbreather.certified.certificate import Certificate, Covering, Tile
from contbreather.certified.proofs import (
    DEFINING,
    certify_curve,
    certify_point,
    parameters,
    provable,
)
from contbreather.checks import number
from contbreather.continuation.branch import Branch
from contbreather.continuation.defining_systems import event_of
from contbreather.continuation.point import Point
from contbreather.errors import BadInput

__all__ = ["Certificate", "Covering", "Interval", "Tile", "certify"]

WITHIN = 1e-8


@overload
def certify(what: Branch, *, within: float = ...) -> Covering: ...
@overload
def certify(what: Any, *, within: float = ...) -> Certificate: ...
def certify(what: Any, *, within: float = WITHIN) -> Certificate | Covering:
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
        return _certify_branch(what)
    if isinstance(what, Point):
        return _certify_place(what, within)
    on, unknowns = parameters(provable(what).conditions), {"p": what.p, "phi": what.phi}
    return certify_point(on, unknowns, "", within)


def _certify_place(point: Point, within: float) -> Certificate:
    orbit, kind = provable(point.solution), point.kind
    line = event_of(point.curve.problem)  # of which boundary it is a point
    if kind not in DEFINING and line is not None:
        kind = line.kind
    if kind not in DEFINING:
        return certify(orbit, within=within)
    free = point.curve.free[0]
    params = parameters(orbit.conditions)
    unknowns = {"p": orbit.p, "phi": orbit.phi, free: params.pop(free)}
    return certify_point(params, unknowns, kind, within)


def _certify_branch(branch: Branch) -> Covering:
    if event_of(branch.problem) is not None:
        raise BadInput(
            "certify() takes branches in one parameter; of a boundary take its points, line[3]."
        )
    params = parameters(provable(branch[0].solution).conditions)
    places = [tuple(float(x) for x in point.z) for point in branch]
    return certify_curve(params, branch.free, places)
