"""The asymmetric breather at given parameters: followed from its pitchfork."""

from __future__ import annotations

import math
from functools import partial

from contbreather.checks import flag, one_of
from contbreather.continuation import Problem, trace
from contbreather.errors import NoSolution, keeping
from contbreather.lattice import Forcing, Lattice, forcing_of, lattice_of
from contbreather.orbits.branch_switching import OrbitSwitching, lift
from contbreather.orbits.clearance import LIMIT
from contbreather.orbits.normal_form import pitchfork_form
from contbreather.orbits.orbit import Orbit, orbit_at
from contbreather.orbits.orbit_events import pitchfork
from contbreather.orbits.refusals import Inadmissible
from contbreather.orbits.symmetric import symmetric

OFF = 2e-3  # asymmetry of a start beside a pitchfork


@keeping()
def asymmetric(
    a: float,
    gamma: float,
    k: float,
    *,
    arm: int = 1,
    forcing: Forcing | str | None = None,
    lattice: Lattice | None = None,
    inadmissible: bool = False,
) -> Orbit:
    """The asymmetric breather at given parameters, followed from its pitchfork.

    Parameters
    ----------
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    arm : {1, -1}
        Which of the two mirror images: t2 - t1 > pi for 1.
    forcing : Forcing or str, optional
        `Harmonic` unless given.
    lattice : Lattice, optional
        `InfiniteChain` unless given.
    inadmissible : bool
        Return the solution of the equations also where it is no orbit of the chain, beyond GR.

    Raises
    ------
    NoSolution
        If the arms do not reach that amplitude; the sentence says where they are. `Inadmissible`,
        which carries the `orbit`, if a `site` meets a wall before, and at what `time`.

    Examples
    --------
    >>> orbit = asymmetric(0.82, 0.04, 0.8)
    >>> round(orbit.p, 7), round(abs(orbit.c), 7)
    (1.093139, 0.0373542)
    """
    one_of("arm", arm, (1, -1))
    drive, lattice = forcing_of(forcing), lattice_of(lattice)
    start = symmetric(a, gamma, k, forcing=drive, lattice=lattice, root=1)
    a, gamma, k = start.a, start.gamma, start.k
    reach = {"a": (0.05 * a, 20.0 * a)}
    walked = partial(trace, free="a", inadmissible=True, progress=False)  # the end is judged below
    branch = walked(start, events=[pitchfork()], within=reach)
    tried = []
    for point in (p for p in branch.special if p.kind == "PF"):
        bend = pitchfork_form(point.solution).coefficient
        up = bend > 0.0
        tried.append(f"{point['a']:.6g} ({'upwards' if up else 'downwards'})")
        if (a > point["a"]) != up:
            continue
        window = {"a": (point["a"], a) if up else (a, point["a"])}
        lifted = lift(point)
        seed = beside(lifted, arm * OFF)
        if not window["a"][0] <= seed.params["a"] <= window["a"][1]:
            seed = beside(lifted, arm * math.sqrt((a - point["a"]) * bend))
            return _solved(seed.at(a=a), inadmissible)
        side = "up" if up else "down"
        last = walked(seed, events=(), within=window, towards=side)[-1]
        if abs(last["a"] - a) <= 1e-12 * a:
            return _solved(last.problem.at(a=a), inadmissible)
    where = f"pitchforks at a = {', '.join(tried)}" if tried else "no pitchfork was found"
    raise NoSolution(
        f"no asymmetric breather at a = {a!r} (gamma = {gamma}, k = {k}, {drive.describe()}) "
        f"on the arms that leave the symmetric branch: {where}."
    )


def beside(lifted: OrbitSwitching, asymmetry: float) -> Problem:
    """The problem started on the arm where t2 - t1 - pi is about as given, small."""
    slots = lifted.problem.slots
    return lifted.arm(
        asymmetry / float(lifted.direction[slots["t2"]] - lifted.direction[slots["t1"]])
    )


def _solved(problem: Problem, inadmissible: bool) -> Orbit:
    solved, _ = problem.solve(tolerance=1e-11)
    orbit = orbit_at(solved)
    verdict = orbit.admissibility()
    if not flag("inadmissible", inadmissible) and verdict.margin < -LIMIT:
        raise Inadmissible(
            f"no asymmetric breather at a = {orbit.a!r} (gamma = {orbit.gamma}, k = {orbit.k}): "
            f"{verdict.reason} With inadmissible=True it is returned nevertheless.",
            orbit=orbit,
        )
    return orbit
