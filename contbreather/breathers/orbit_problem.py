"""An orbit with impacts as a problem of the engine: its equations, its events, what to record."""

from __future__ import annotations

import math
from collections.abc import Sequence

from contbreather.breathers.impacts import (
    FloatArray,
    Impact,
    OrbitEquations,
    Params,
    check_sequence,
    check_times,
    forcing_at,
)
from contbreather.breathers.orbit_events import doubled_arm, events_on, unstable
from contbreather.breathers.orbit_images import images_of, simpler_than
from contbreather.breathers.orbits import EQUAL, Orbit
from contbreather.continuation import Point, Problem, branch_point, fold
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, Lattice, forcing_of, lattice_of

LEAST = 1e-12  # an impulse smaller than this is none


def impact_problem(orbit: Orbit) -> Problem:
    """The equations of an orbit with any impacts, with the orbit as their start.

    Columns: t1..tm, J1..Jm and c (c1, c2, ... where several sites take impacts); a, gamma, k and
    the parameters of the forcing; ``unstable``, the number of multipliers outside; for two impacts
    ``p`` and ``asymmetry``. Every branch point of the equations is BP: on a branch of symmetric
    breathers that is their pitchfork.
    """
    equations = orbit.equations
    start = dict(zip(equations.names, orbit.x.tolist(), strict=True))
    record = {"unstable": lambda point: unstable(point.solution)}
    if orbit.two_impacts:
        record["p"] = lambda point: point.solution.p
        record["asymmetry"] = lambda point: point.solution.asymmetry
    return Problem(
        equations.residual,
        start,
        orbit.params,
        jacobian=equations.jacobian,
        sensitivity=equations.sensitivity,
        events=(fold(), branch_point(), *events_on(orbit.lattice)),
        record=record,
        domain=domain_of(equations),
        interpret=lambda point: orbit_from(equations, point.x, point.params),
        images=lambda x, params: _images(equations, x, params),
        simpler=_simpler,
        lifts={"PD": doubled_arm},
        label="orbit with impacts",
    )


def domain_of(equations: OrbitEquations) -> dict[str, tuple[float, float]]:
    """Where the parameters mean something, and each impulse pushes away from its wall."""
    edge = 0.25 if equations.lattice.sites is not None else 0.25 / equations.periods**2
    domain = {"gamma": (0.0, edge), "k": (0.0, 1.0), "a": (0.0, math.inf)}
    for i, (_, wall) in enumerate(equations.sequence):
        domain[f"J{i + 1}"] = (-math.inf, -LEAST) if wall > 0 else (LEAST, math.inf)
    return domain


def orbit_from(equations: OrbitEquations, x: FloatArray, values: Params) -> Orbit:
    """What a solution of `impact_problem` is."""
    times, impulses, offsets = equations.split(x)
    named = zip(equations.sequence, times.tolist(), impulses.tolist(), strict=True)
    impacts = [Impact(site, wall, t, J) for (site, wall), t, J in named]
    return Orbit(
        values["a"],
        values["gamma"],
        values["k"],
        tuple(impacts),
        tuple(offsets.tolist()),
        equations.periods,
        forcing_at(equations.forcing, values),
        equations.lattice,
    )


def _images(equations: OrbitEquations, x: FloatArray, params: Params) -> tuple[FloatArray, ...]:
    return tuple(image.x for image in images_of(orbit_from(equations, x, params)))


def _simpler(point: Point) -> Problem | None:
    orbit: Orbit = point.solution
    small = simpler_than(orbit)
    if small is not None:
        return small.problem
    if orbit.two_impacts and abs(orbit.asymmetry) > EQUAL:
        return orbit.problem
    return None


def orbit_problem(
    sequence: Sequence[tuple[int, int]],
    *,
    times: Sequence[float],
    impulses: Sequence[float],
    a: float,
    gamma: float,
    k: float,
    offsets: Sequence[float] = (),
    periods: int = 1,
    forcing: Forcing | str | None = None,
    lattice: Lattice | None = None,
) -> Problem:
    """The problem of an orbit of your own: a sequence of impacts, and a guess at it.

    Parameters
    ----------
    sequence : sequence of (site, wall)
        The impacts of one period in order of time; walls are +1 and -1.
    times, impulses : sequence of float
        A guess, one of each for every impact. An impulse at the wall +1 is negative.
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    offsets : sequence of float, optional
        Guess at the static displacement of each impacting site, 0 unless given.
    periods : int
        n of the period 2 pi n.
    forcing : Forcing or str, optional
        `Harmonic` unless given.
    lattice : Lattice, optional
        `InfiniteChain` unless given.

    Returns
    -------
    Problem
        To trace, or to solve where it stands: ``problem.solve()``.

    Raises
    ------
    BadInput
        For a sequence that no orbit can have, times out of order, impulses into a wall, parameters
        out of range.

    Examples
    --------
    >>> problem = orbit_problem([(0, 1), (0, -1)], times=[-2.5, 0.7], impulses=[-1.4, 1.4],
    ...                         a=0.5, gamma=0.12, k=0.4)
    >>> solved, _ = problem.solve()
    >>> round(-solved.start["J1"] / 2, 10)  # p of the symmetric breather there
    0.680056002
    """
    drive, lattice = forcing_of(forcing), lattice_of(lattice)
    pairs = tuple((site, wall) for site, wall in sequence)
    check_sequence(pairs, lattice)
    if not len(pairs) == len(times) == len(impulses):
        raise BadInput(
            f"{len(pairs)} impacts, {len(times)} times, {len(impulses)} impulses: one time and one "
            "impulse for each impact is wanted."
        )
    check_times([float(t) for t in times], periods)
    impacts = [
        Impact(int(site), int(wall), float(t), float(J))
        for (site, wall), t, J in zip(pairs, times, impulses, strict=True)
    ]
    orbit = Orbit(a, gamma, k, tuple(impacts), tuple(offsets), periods, drive, lattice)
    return impact_problem(orbit)
