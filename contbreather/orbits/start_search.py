"""A breather, or an event, somewhere in a window: where branches and boundaries can begin."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from contbreather.checks import check_kind, one_of, whole
from contbreather.continuation.branches.boundary import named_pair
from contbreather.continuation.branches.switching import switch
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.settings import windows
from contbreather.continuation.walk.trace import trace
from contbreather.errors import BadInput, NoSolution, NotConverged
from contbreather.lattice.conditions import Walls
from contbreather.lattice.finite import Lattice
from contbreather.lattice.forcing import Forcing, with_even
from contbreather.lattice.formula import forcing_of
from contbreather.one_thread import one_thread
from contbreather.orbits.closed_form import symmetric
from contbreather.orbits.closure import smallest_amplitude
from contbreather.orbits.orbit import Orbit, orbit_of
from contbreather.orbits.zone_search import up_to_the_fold
from contbreather.parameters import NAMES, NEEDED, NUMBERS, OPTIONAL, windows_of
from contbreather.stability.verdict import THRESHOLD, threshold_on

REACH = 10.0  # how far a window without end is looked at
Window = tuple[float, float]


@one_thread
def find_symmetric(free: str, within: Window, *, root: int | None = None, **conditions: Any) -> Any:
    """An admissible symmetric breather somewhere in the window of one parameter; under a drive with
    even harmonics or a mean the orbit that the breather of its odd harmonics becomes.

    Parameters
    ----------
    free : str
        The parameter: a, gamma, k, damping, spring, omega or one of the forcing.
    within : (float, float)
        Where to look for it. A value of `free` among `conditions` is tried first.
    root : int, optional
        Which solution of (11), by falling p; unless given the first one, and any other only where
        that is admissible nowhere in the window.
    **conditions
        The others, and all that `symmetric` takes: forcing, lattice, site, walls.

    Returns
    -------
    Orbit

    Raises
    ------
    NoSolution
        If there is none, with the reason at the last value that was looked at.
    BadInput
        If a breather is possible nowhere in the window, for what is given is out of range.

    Examples
    --------
    >>> round(find_symmetric("a", (0.6, 0.9), gamma=0.1, k=0.8).a, 9)
    0.6075
    """
    reason, refusal = "", None
    check_kind(free, str, "the name of a parameter")
    whole("root", 1 if root is None else root, 1)
    missing = {*NEEDED} - {free, *conditions}
    if missing:
        raise BadInput(f"a breather needs {' and '.join(sorted(missing))}, too")
    within = windows({free: within})[free]
    if not within[0] <= within[1] or (free == "a" and within[1] <= 0.0):
        raise BadInput(f"the window of {free!r} is empty: ({within[0]:g}, {within[1]:g})")
    # an upper breather, wherever in the window, before a lower one
    numbers: tuple[int | None, ...] = (1, None) if root is None else (root,)
    for number, value in product(numbers, _places(free, within, conditions)):
        try:
            orbit = breather_at(number, **_with(conditions, free, value))
        except NoSolution as error:
            reason = str(error)
        except BadInput as error:  # out of range here, perhaps not elsewhere in the window
            refusal = refusal or error
        else:
            verdict = orbit.admissibility()
            if verdict.ok:
                return orbit
            reason = f"at {free} = {value:.6g} {verdict.reason}"
    if refusal is not None and not reason:
        raise refusal
    fixed = [f"{n} = {conditions[n]:g}" for n in NAMES if n in conditions and n != free]
    raise NoSolution(
        f"no breather with {', '.join(fixed)} for {free} between {within[0]:g} and "
        f"{within[1]:g}: {reason}"
    )


def breather_at(root: int | None = None, **conditions: Any) -> Any:
    """The symmetric breather of a root, or what it becomes under the drive's even harmonics."""
    drive = forcing_of(conditions.get("forcing"))
    odd = with_even(0.0, drive)
    orbit = symmetric(**{**conditions, "forcing": odd}, root=root)
    return orbit if odd is drive else grown(orbit, drive)


def grown(orbit: Orbit, drive: Forcing) -> Orbit:
    """The orbit of a whole drive that an orbit of its odd harmonics becomes."""
    orbit = orbit.unfolded()
    try:
        for share in np.linspace(0.1, 1.0, 10).tolist():
            under, impacts = with_even(share, drive), (orbit.times, orbit.impulses)
            on = replace(orbit.conditions, forcing=under)
            orbit = orbit_of(on, orbit.section, *impacts, orbit.offsets).solved()
    except NotConverged as error:
        raise NoSolution(
            f"the orbit of the odd harmonics of {drive.describe()} does not go on to all of them: "
            f"{error}"
        ) from error
    return orbit


def _with(conditions: Mapping[str, Any], name: str, value: float) -> dict[str, Any]:
    forcing = forcing_of(conditions.get("forcing"))
    if name in forcing.params:
        return {**conditions, "forcing": forcing.at(**{name: value})}
    one_of("the parameter", name, (*NAMES, *forcing.params))
    return {**conditions, name: value}


def _places(free: str, within: Window, conditions: Mapping[str, Any]) -> Iterator[float]:
    """Values to look at for a breather in a window: first next to the fold, then evenly spread."""
    low, high = within
    first = conditions.get(free, NUMBERS[free].default if free in OPTIONAL else None)
    near = [] if first is None else [first]
    if free == "a":
        width = abs(Walls.given(conditions.get("walls")).position(conditions.get("site", 0), 1))
        # beyond a = width the far field of one harmonic, a cos t, hits the walls as well
        high = min(high, max(width if math.isfinite(width) else 1.0, 2.0 * low))
        if not isinstance(conditions.get("lattice"), Lattice):
            square = conditions.get("omega", 1.0) ** 2
            odd = with_even(0.0, forcing_of(conditions.get("forcing")))
            gamma = conditions["gamma"] / square
            fold = square * smallest_amplitude(gamma, conditions["k"], odd)
            # breathers begin at the fold (14) and end where the neighbour comes to its wall, (15)
            near += [factor * fold for factor in (1.5, 1.1, 1.01)]
    else:
        low, high = max(low, -REACH), min(high, REACH)
    yield from (value for value in near if within[0] <= value <= within[1])
    # every other value first, then those between them
    spread = np.linspace(low, high, 41)[[*range(1, 41, 2), *range(0, 41, 2)]].tolist()
    yield from (value for value in spread if free != "a" or value > 0.0)  # no forcing, no breather


@one_thread
def find_event(
    kind: str,
    pair: tuple[str, str],
    *,
    within: Mapping[str, Window] | None = None,
    threshold: float | None = None,
    **conditions: Any,
) -> Point:
    """The first event of a kind on branches of symmetric breathers, or on the arms that leave them:
    where a `boundary` can begin.

    Parameters
    ----------
    kind : str
        LP, PF, NS, GR: what such a breather has; PD, which its arms have.
    pair : (str, str)
        The branches are in the second parameter, at some values of the first one, or at the one
        among `conditions`.
    within : dict, optional
        Windows of both.
    threshold : float, optional
        Modulus over 2 pi from which a multiplier counts as unstable, on finite lattices; not for
        arms, which are judged by the paper's.
    **conditions
        As for `find_symmetric`.

    Raises
    ------
    NoSolution
        If there is none, with what the last branch has.

    Examples
    --------
    >>> start = find_event("PF", ("gamma", "a"), gamma=0.04, k=0.8)
    >>> round(start["a"], 12)
    0.777632425944
    """
    first, free = named_pair(pair)
    check_kind(kind, str, "the kind of an event, 'PF' for instance,")
    if kind == "PD" and threshold not in (None, THRESHOLD):
        raise BadInput(
            f"threshold = {threshold:g}: PD is found on arms, which are judged by the paper's "
            f"{THRESHOLD}; leave it out"
        )
    omega = conditions.get("omega", 1.0)
    span, reach = windows_of((first, free), windows(within), omega).values()
    reason, refusal = "", None
    values = [*_combed(first, conditions.get(first), span)]
    for value in values:
        try:
            # root 1 is that with the largest p, an upper breather
            start = find_symmetric(free, reach, **{"root": 1, **_with(conditions, first, value)})
        except NoSolution as error:
            reason = str(error)
            continue
        except BadInput as error:  # out of range here, perhaps not elsewhere in the window
            refusal = refusal or error
            continue
        problem = start.problem_beyond(threshold_on(start.lattice, threshold)).having(*pair)
        kinds = [*dict.fromkeys(event.kind for event in problem.events), "PD"]
        one_of("the kind under this drive" if start.section.sign > 0 else "the kind", kind, kinds)
        events = tuple(map(up_to_the_fold, problem.events))
        branch = trace(problem, free, within={free: reach}, events=events, progress=False)
        # a symmetric breather breaks its symmetry (PF) before it can double its period
        for followed in _with_arms(branch, {free: reach}) if kind == "PD" else (branch,):
            for point in followed.special:
                if point.kind == kind and point.located:
                    return point
        labels = ", ".join(point.label for point in followed.special) or "not a special point"
        reason = f"the branch in {free} at {first} = {value:.6g} has {labels}"
    if refusal is not None and not reason:
        raise refusal
    alone = conditions.get(first) is not None
    between = f"between {span[0]:g} and {span[1]:g} ({len(values)} values were looked at)"
    searched = f"= {values[0]:g}" if alone else between
    raise NoSolution(f"no {kind} found for {first} {searched}; {reason}")


def _with_arms(branch: Branch, within: Mapping[str, Window]) -> Iterator[Branch]:
    """A branch, and one of both mirror images that leave it at each pitchfork."""
    yield branch
    for point in branch.special:
        if point.kind == "PF" and point.located:
            yield switch(point, within=within, progress=False)[0]


def _combed(name: str, value: float | None, span: Window) -> Iterator[float]:
    """Values to look at: evenly spread, the middle first; before them no damping, no springs."""
    if value is not None:
        if not span[0] <= value <= span[1]:
            raise BadInput(
                f"{name} = {value:g} is outside of the window {span[0]:g} to {span[1]:g}"
            )
        yield value
        return
    if name in OPTIONAL and span[0] == 0.0:
        yield 0.0
    open_ = math.isinf(span[1]) and name in OPTIONAL
    low, reach = max(span[0], -REACH), 1.0 if open_ or name == "a" else REACH
    high = min(span[1], max(reach, 2.0 * low))
    for fraction in (0.5, 0.25, 0.75, 0.1, 0.9, 0.4, 0.6, 0.02, 0.98):
        yield low + fraction * (high - low)
