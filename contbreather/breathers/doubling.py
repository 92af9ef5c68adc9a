"""The orbit of twice the period that leaves a branch where a multiplier is -1.

It solves the general problem with every impact named twice. There the parent, run through twice, is
a solution as well, and the doubling is a branch point: the null vector moves the impacts of the
second run against those of the first, and the parameter changes with its square. Both directions
along it are the same orbit, one period later.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.orbit_problem import impact_problem
from contbreather.breathers.orbits import Orbit
from contbreather.continuation import Branch, Event, Point, Problem, Steps, Stop, trace
from contbreather.continuation.branch import labelled
from contbreather.continuation.newton import newton
from contbreather.continuation.problem import Curve
from contbreather.errors import BadInput, NotConverged

FloatArray = NDArray[np.float64]

OFF = (0.02, 0.005, 0.08)  # tried distances of the first point from the doubling
NULL = 1e-6  # least singular value of the doubled equations, relative, at a doubling


def twice(orbit: Orbit) -> Orbit:
    """The same orbit, run through twice.

    Examples
    --------
    >>> from contbreather.breathers.orbits import orbit_of
    >>> from contbreather.breathers.symmetric import symmetric
    >>> two = twice(orbit_of(symmetric(0.5, 0.05, 0.8)))
    >>> two.periods, len(two.impacts), two.residual < 1e-14
    (2, 4, True)
    """
    again = tuple(one._replace(time=one.time + orbit.period) for one in orbit.impacts)
    return replace(orbit, impacts=(*orbit.impacts, *again), periods=2 * orbit.periods)


def doubled_branch(
    point: Point,
    *,
    within: Mapping[str, tuple[float, float]] | None = None,
    events: Iterable[Event] | None = None,
    steps: Steps | None = None,
    progress: bool | None = None,
) -> Branch:
    """The branch of orbits of twice the period that leaves a period doubling.

    Parameters
    ----------
    point : Point
        A PD on a branch of orbits, ``branch.first("PD")``.
    within, events, steps, progress
        As for `trace`; the walk is in the parameter of the branch the point is on.

    Returns
    -------
    Branch
        Columns t1, ..., J1, ..., c and the parameters; its first point is the doubling.

    Raises
    ------
    BadInput
        If the point is no located PD of an orbit, or orbits of twice the period radiate: on the
        infinite chain from gamma = 1/(16 n^2) on.
    NotConverged
        If the doubled orbit is not found beside it.

    Examples
    --------
    >>> import contbreather as cb
    >>> from contbreather.breathers.arms import asymmetric
    >>> arm = asymmetric(0.9, 0.0, 0.8, lattice=cb.Ring(1)).problem
    >>> branch = cb.trace(arm, "a", towards="up", within={"a": (0, 0.99)})
    >>> doubled = doubled_branch(branch.first("PD"), within={"a": (0, 0.99)})
    >>> [round(point["a"], 9) for point in doubled.special if point.kind == "PD"]
    [0.925512006, 0.979973549]
    """
    problem, free = _doubled_problem(point)
    curve = Curve(problem, (free,))
    seed, tangent = _seed(curve, point)
    up = seed.params[free] > problem.params[free]
    walked = trace(
        seed,
        free,
        within=within,
        towards="up" if up else "down",
        events=seed.events if events is None else tuple(events),
        steps=steps,
        progress=progress,
    )
    return _from_doubling(walked, curve, tangent)


def _doubled_problem(point: Point) -> tuple[Problem, str]:
    if point.kind != "PD" or not point.located:
        raise BadInput(
            f"{point!r} is no located period doubling: take branch.first('PD') of a branch of "
            "orbits."
        )
    orbit = point.solution
    if not isinstance(orbit, Orbit):
        raise BadInput(f"{point!r} is no point on a branch of orbits with impacts.")
    return impact_problem(twice(orbit)), point.curve.free[-1]


def _seed(curve: Curve, point: Point) -> tuple[Problem, FloatArray]:
    """A start on the doubled branch beside the doubling, and the direction it left in."""
    z, size = curve.start, curve.size
    _, values, right = np.linalg.svd(curve.jacobian(z)[:, :size])
    if values[-1] > NULL * values[0]:
        raise NotConverged(
            f"{point!r} is no period doubling: run through twice, its equations keep their rank, "
            f"smallest singular value {values[-1]:.2g}",
            residual=float(values[-1]),
        )
    tangent = np.append(right[-1], 0.0)
    for off in OFF:
        found = newton(
            curve.equations, curve.jacobian, z + off * tangent, row=tangent, tolerance=1e-11
        )
        moved = abs(found.z[-1] - z[-1])
        if found.converged and found.residual < 1e-9 and 0.0 < moved < 0.1 * (1.0 + abs(z[-1])):
            values_at = {name: float(found.z[slot]) for name, slot in curve.slots.items()}
            return curve.problem.at(**values_at), tangent
    raise NotConverged(
        f"no orbit of twice the period was found beside {point!r}: Newton's iteration ended at a "
        f"residual of {found.residual:.2g}",
        residual=found.residual,
    )


def _from_doubling(branch: Branch, curve: Curve, tangent: FloatArray) -> Branch:
    """The branch with the doubling itself as its first point."""
    first = branch.points[0]
    gap = first.z - curve.start
    length = math.sqrt(gap.dot(curve.dual(gap)))
    residual = float(np.abs(curve.equations(curve.start)).max())
    start = Point(branch.curve, curve.start, tangent, 0.0, residual, "PD")
    rest = [replace(p, arclength=p.arclength + length) for p in branch.points]
    if rest[0].kind == "EP":
        rest[0] = replace(rest[0], kind="", label="")
    return replace(branch, points=labelled((start, *rest)), began=Stop.EVENT)
