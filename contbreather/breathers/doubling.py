"""The orbit of twice the period that leaves a branch where a multiplier is -1.

It solves the general problem with every impact named twice. There the parent, run through twice, is
a solution as well, and the doubling is a branch point: the null vector moves the impacts of the
second run against those of the first. Both directions along it are one orbit, a period apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from contbreather.breathers.orbit_problem import impact_problem
from contbreather.breathers.orbits import Orbit
from contbreather.continuation import Branch, Event, Point, Steps
from contbreather.continuation.problem import Curve
from contbreather.continuation.seed import Seed
from contbreather.continuation.switching import follow
from contbreather.errors import BadInput, NotConverged

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


def doubled_seed(point: Point) -> Seed:
    """Where the orbit of twice the period sets out from a period doubling.

    Raises
    ------
    BadInput
        If the point is no located PD of an orbit, or orbits of twice the period radiate: on the
        infinite chain from gamma = 1/(16 n^2) on.
    NotConverged
        If the orbit, run through twice, does not bifurcate there.
    """
    if point.kind != "PD" or not point.located:
        raise BadInput(
            f"{point!r} is no located period doubling: take branch.first('PD') of a branch of "
            "orbits."
        )
    orbit = point.solution
    if not isinstance(orbit, Orbit):
        raise BadInput(f"{point!r} is no point on a branch of orbits with impacts.")
    problem = impact_problem(twice(orbit))
    curve = Curve(problem, (point.curve.free[-1],))
    whole = curve.jacobian(curve.start)
    _, sizes, right = np.linalg.svd(whole)
    if sizes[-1] > NULL * sizes[0]:
        raise NotConverged(
            f"{point!r} is no period doubling: run through twice, its equations keep their rank, "
            f"smallest singular value {sizes[-1]:.2g}",
            residual=float(sizes[-1]),
        )
    # of the two null vectors the one that the second run takes the other way round, and the parent
    plane = right[-2:]
    m = len(orbit.impacts)
    swapped = plane.copy()
    for run in (0, 2 * m):
        swapped[:, run : run + m] = plane[:, run + m : run + 2 * m]
        swapped[:, run + m : run + 2 * m] = plane[:, run : run + m]
    _, axes = np.linalg.eigh(0.5 * (swapped @ plane.T + plane @ swapped.T))
    tangent, parent = axes.T @ plane  # eigenvalues -1 and +1, in this order
    return Seed(problem, curve.start, tangent, parent)


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
    BadInput, NotConverged
        As for `doubled_seed`.

    Examples
    --------
    >>> import contbreather as cb
    >>> from contbreather.breathers.arms import asymmetric
    >>> arm = asymmetric(0.9, 0.0, 0.8, lattice=cb.Ring(1)).problem
    >>> branch = cb.trace(arm, "a", towards="up", within={"a": (0, 0.99)})
    >>> doubled = doubled_branch(branch.first("PD"), within={"a": (0, 0.99)})
    >>> round(doubled.first("PD")["a"], 9)
    0.979973549
    """
    given = None if events is None else tuple(events)
    seed = doubled_seed(point)
    return follow(point, seed, within=within, events=given, steps=steps, progress=progress)
