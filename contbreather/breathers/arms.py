"""Both arms of asymmetric breathers that leave a symmetric branch at its pitchfork.

The symmetric breather at a pitchfork is a regular point of the asymmetric problem, where the
flights are equal and the parameter has an extremum. So the lift to that problem is the whole
switch: its tangent there is the null vector, and the normal form says how the arms bend.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.asymmetric import problem_from
from contbreather.breathers.clearance import LIMIT
from contbreather.breathers.events import pitchfork
from contbreather.breathers.orbits import Orbit, orbit_at
from contbreather.breathers.refusals import Inadmissible
from contbreather.breathers.symmetric import Breather, symmetric
from contbreather.continuation import Branch, Event, Point, Problem, Steps, trace
from contbreather.continuation.newton import Undefined, newton
from contbreather.continuation.problem import Curve
from contbreather.continuation.seed import Seed
from contbreather.continuation.switching import follow
from contbreather.errors import BadInput, NoSolution, NotConverged, keeping, taking
from contbreather.lattice import (
    Forcing,
    Lattice,
    check_gamma,
    forcing_of,
    lattice_of,
)
from contbreather.stability.normal_form import PitchforkForm, pitchfork_form

FloatArray = NDArray[np.float64]

OFF = 2e-3  # asymmetry of a start beside a pitchfork


@dataclass(frozen=True)
class Lift:
    """A pitchfork in the problem that knows both arms.

    Attributes
    ----------
    problem : Problem
        The asymmetric problem, its start at the pitchfork.
    free : str
        The parameter in which the symmetric branch was followed.
    z, tangent : ndarray, shape (5,)
        (p, t1, t2, c, parameter) at the pitchfork, and the direction in which the arms leave it;
        the parameter does not change in it.
    form : PitchforkForm
        How they bend: the normal form.
    """

    problem: Problem
    free: str
    z: FloatArray
    tangent: FloatArray
    form: PitchforkForm

    def seed(self, sign: float) -> Seed:
        """Where an arm sets out: the one with t2 - t1 > pi for sign 1, its mirror image for -1."""
        return Seed(self.problem, self.z, sign * self.tangent)

    def beside(self, asymmetry: float) -> Problem:
        """The problem with its start on the arm where t2 - t1 - pi is as given, small."""
        curve = Curve(self.problem, (self.free,))
        # along the null vector, and the parameter as the normal form says
        guess = self.z + asymmetry * self.tangent / (self.tangent[2] - self.tangent[1])
        guess[-1] += asymmetry**2 / self.form.coefficient
        row = np.zeros(5)
        row[1], row[2] = -1.0, 1.0
        try:
            found = newton(curve.equations, curve.jacobian, guess, row=row)
        except Undefined as error:
            raise NotConverged(
                f"no asymmetric breather at t2 - t1 - pi = {asymmetry:g}: {error}"
            ) from error
        if not found.converged:
            raise NotConverged(
                f"no asymmetric breather found beside the pitchfork: residual {found.residual:.2g}",
                residual=found.residual,
            )
        values = {name: float(found.z[slot]) for name, slot in curve.slots.items()}
        return self.problem.at(**values)


def lift(point: Point) -> Lift:
    """The asymmetric problem at a pitchfork of symmetric breathers.

    Parameters
    ----------
    point : Point
        A PF on a branch of symmetric breathers, ``branch.first("PF")``.

    Raises
    ------
    BadInput
        If the point is no located pitchfork of a symmetric breather.
    """
    breather = _breather_at(point)
    free = point.curve.free[-1]
    start = {"p": breather.p, "t1": breather.phi, "t2": breather.phi + math.pi, "c": 0.0}
    params = {"a": breather.a, "gamma": breather.gamma, "k": breather.k, **breather.forcing.params}
    problem = problem_from(start, params, breather.forcing, breather.lattice, 0)
    curve = Curve(problem, (free,))
    row = np.array([0.0, -1.0, 1.0, 0.0, 0.0])  # hold the flights equal
    found = newton(curve.equations, curve.jacobian, curve.start, row=row)
    if not found.converged or np.abs(found.z - curve.start).max() > 1e-6:
        raise NotConverged(
            f"{point!r} is no pitchfork: the asymmetric equations leave a residual of "
            f"{float(np.abs(curve.equations(curve.start)).max()):.2g} there",
            residual=found.residual,
        )
    values = {name: float(found.z[slot]) for name, slot in curve.slots.items()}
    problem = problem.at(**values)
    tangent = np.linalg.svd(curve.jacobian(found.z))[2][-1]
    tangent = tangent * math.copysign(1.0, tangent[2] - tangent[1])
    return Lift(problem, free, found.z, tangent, form_at(breather, free))


def form_at(breather: Breather, free: str = "a") -> PitchforkForm:
    """Normal form of the pitchfork of a symmetric breather, in one of its parameters."""
    return pitchfork_form(
        breather.a,
        breather.gamma,
        breather.k,
        breather.p,
        breather.phi,
        breather.forcing,
        breather.lattice,
        free=free,
    )


def _breather_at(point: Point) -> Breather:
    if point.kind != "PF":
        raise BadInput(
            f"{point!r} is {'a ' + point.kind if point.kind else 'no special point'}: arms leave "
            "a pitchfork, branch.first('PF')."
        )
    if not point.located:
        raise BadInput(f"{point!r} was seen but not located: no arms can start there.")
    solution = point.solution
    if isinstance(solution, Breather):
        return solution
    if isinstance(solution, Orbit) and solution.two_impacts:
        orbit = solution
        phi = orbit.impacts[0].time + 0.5 * orbit.asymmetry
        return Breather(orbit.a, orbit.gamma, orbit.k, orbit.p, phi, orbit.forcing, orbit.lattice)
    raise BadInput(f"{point!r} is no breather with two impacts.")


def pitchfork_arms(
    point: Point,
    *,
    within: Mapping[str, tuple[float, float]] | None = None,
    events: Iterable[Event] | None = None,
    steps: Steps | None = None,
    progress: bool | None = None,
) -> tuple[Branch, Branch]:
    """Both arms of asymmetric breathers at a pitchfork, each from there to its end.

    Parameters
    ----------
    point : Point
        A PF on a branch of symmetric breathers.
    within, events, steps, progress
        As for `trace`; the arms are walked in the parameter of the branch the point is on.

    Returns
    -------
    tuple of two Branch
        Columns p, t1, t2, c, asymmetry and the parameters. The first point of each is the
        pitchfork, ``arm[0].parent`` as it is on the symmetric branch; on the first arm
        t2 - t1 > pi, the second is its mirror image u(t) -> -u(t + pi).

    Raises
    ------
    BadInput
        If the point is no located pitchfork of symmetric breathers, or inadmissible.
    NotConverged
        If the asymmetric equations do not hold there.

    Examples
    --------
    >>> import contbreather as cb
    >>> branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", towards="up", within={"a": (0, 0.9)})
    >>> one, other = pitchfork_arms(branch.first("PF"))
    >>> one.special[-1].kind, round(one.special[-1]["a"], 6)
    ('GR', 0.877387)
    """
    lifted = lift(point)
    given = None if events is None else tuple(events)
    arms: list[Branch] = []
    with keeping(lambda: tuple(arms) or None), taking(arms.append):
        for sign in (1.0, -1.0):
            seed = lifted.seed(sign)
            arms.append(
                follow(point, seed, within=within, events=given, steps=steps, progress=progress)
            )
    return arms[0], arms[1]


# --- straight to one breather ---------------------------------------------------------------------


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
    if arm not in (1, -1):
        raise BadInput(f"arm = {arm!r}: the arms are 1 and -1.")
    drive, lattice = forcing_of(forcing), lattice_of(lattice)
    gamma, k = check_gamma(gamma), float(k)
    start = symmetric(a, gamma, k, forcing=drive, lattice=lattice)
    reach = {"a": (0.05 * a, 20.0 * a)}
    walked = partial(trace, free="a", inadmissible=True, progress=False)  # the end is judged below
    branch = walked(start, events=[pitchfork()], within=reach)
    tried = []
    for point in (p for p in branch.special if p.kind == "PF"):
        lifted = lift(point)
        up = lifted.form.coefficient > 0.0
        tried.append(f"{point['a']:.6g} ({'upwards' if up else 'downwards'})")
        if (a > point["a"]) != up:
            continue
        window = {"a": (point["a"], a) if up else (a, point["a"])}
        seed = lifted.beside(arm * OFF)
        if not window["a"][0] <= seed.params["a"] <= window["a"][1]:
            seed = lifted.beside(arm * math.sqrt((a - point["a"]) * lifted.form.coefficient))
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


def _solved(problem: Problem, inadmissible: bool) -> Orbit:
    solved, _ = problem.solve(tolerance=1e-11)
    orbit = orbit_at(solved)
    verdict = orbit.admissibility()
    if not inadmissible and verdict.margin < -LIMIT:
        raise Inadmissible(
            f"no asymmetric breather at a = {orbit.a!r} (gamma = {orbit.gamma}, k = {orbit.k}): "
            f"{verdict.reason} With inadmissible=True it is returned nevertheless.",
            orbit=orbit,
            site=verdict.site,
            time=verdict.time,
        )
    return orbit
