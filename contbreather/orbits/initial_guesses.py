"""From whatever is known of an orbit to a first guess at its impacts: times and impulses.

A seed is an orbit, a state, or impact times alone. A state is simulated over a section; where only
times are known, impulses and offsets are those that suit them best, which is a linear problem
(`ByImpacts.closest`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import number, state_rows
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Finite
from contbreather.orbits.by_impacts import ByImpacts
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.section import (
    Impact,
    ImpossibleSequence,
    Section,
    Sequenced,
    checked_impacts,
)

FloatArray = NDArray[np.float64]

MOST = 200  # impacts in one section
TOGETHER = 8  # digits to which the times of impacts are compared


def from_state(
    state: Any, time: float, sequence: Sequence[Any] | None, turns: int, sign: int, on: Conditions
) -> ByImpacts:
    """A state of the lattice, simulated over one section: its impacts in order."""
    # dear to import
    from contbreather.simulation.integrator import RunStop
    from contbreather.simulation.simulate import completed, let_go
    from contbreather.simulation.states import PERIOD, State, wall_rows

    u, v = state_rows(state)
    low, high = wall_rows(on.walls, u.size)
    beyond = np.maximum(u - high, low - u)
    n = int(beyond.argmax())
    if beyond[n] > 1e-6:  # a seed may be beyond a wall by this much
        raise BadInput(
            f"u[{n}] = {u[n]:.9g} of the seed is outside the walls at {low[n]:g} and {high[n]:g}."
        )
    T = math.pi * turns * (1.0 if sign < 0 else 2.0)
    start, length = State(np.clip(u, low, high), v), T / PERIOD
    run = completed(let_go(start, on, periods=length, t0=time, progress=False))
    impacts: list[Impact] = []
    for hit in run.impacts[: MOST + 1]:
        impulse = float(hit["after"] - hit["before"])
        contact = Impact(int(hit["site"]), int(hit["wall"]), float(hit["time"]), impulse)
        # a section that begins at an impact ends at it, too
        late = [contact.time - e.time - T for e in impacts if e.site == contact.site]
        if not any(abs(apart) < 10.0**-TOGETHER for apart in late):
            impacts.append(contact)
    words = " ".join(f"({hit.site}, {hit.wall:+d}) at t = {hit.time:.6g}" for hit in impacts[:12])
    if not impacts or len(impacts) > MOST or run.stop is not RunStop.DONE:
        raise BadInput(
            f"the seed meets {'no wall' if not impacts else 'walls too often'} within a section of "
            f"length {T:.6g} from t = {time:.6g}: {words or 'it flies free'}; give another seed, "
            "or its impact times by hand."
        )
    impacts.sort(key=lambda hit: (round(hit.time, TOGETHER), hit.site))
    # three sections hold every start there is: it goes on as it was, or turned over
    m, walls = len(impacts), tuple((hit.site, hit.wall) for hit in impacts)
    course = Section(walls, turns, sign).course(impacts, 3)
    first = _start(course, sequence, on.lattice, words)
    chosen = course[first : first + m]
    section = Section(tuple((c.site, c.wall) for c in chosen), turns, sign)
    times = np.array([hit.time for hit in chosen])
    # the first impact within half a period of 0
    times -= section.period * math.floor((times[0] + 0.5 * section.period) / section.period)
    return ByImpacts.closest(on, section, times, [hit.impulse for hit in chosen])


def _beginning(course: Sequence[Impact], wanted: Sequenced) -> int | None:
    """Which of the impacts of three sections comes first in a sequence of one."""
    m, impacts = len(course) // 3, [(impact.site, impact.wall) for impact in course]
    return next((i for i in range(2 * m) if tuple(impacts[i : i + m]) == wanted), None)


def _start(
    course: Sequence[Impact], sequence: Sequence[Any] | None, lattice: Finite, words: str
) -> int:
    if sequence is None:  # the first on the wall at +1, by choice
        return next((i for i, impact in enumerate(course) if impact.wall > 0), 0)
    wanted = Section(checked_impacts(sequence)).placed(lattice).impacts
    if (first := _beginning(course, wanted)) is not None:
        return first
    m = len(course) // 3
    raise ImpossibleSequence(
        f"the seed does not hit its walls in the order {wanted}: followed over one section it "
        f"meets {words}; give that sequence, another seed, or the impact times by hand.",
        sequence=wanted,
        met=tuple((impact.site, impact.wall) for impact in course[:m]),
    )


def from_times(times: Mapping[str, float], section: Section, on: Conditions) -> ByImpacts:
    """Guess from impact times alone, ``{"t1": ..., "t2": ...}``."""
    names = [f"t{j + 1}" for j in range(section.count)]
    unknown, missing = sorted(set(times) - set(names)), sorted(set(names) - set(times))
    if unknown or missing:
        raise BadInput(
            f"a seed by hand has one time for each impact, {names}: "
            f"missing {missing}, not known {unknown}."
        )
    wanted = "a time of impact"
    t = [number(name, times[name], -math.inf, math.inf, wanted) for name in names]
    return ByImpacts.closest(on, section, t)


def from_orbit(
    orbit: Orbit, sequence: Sequence[Any] | None, sign: int | None, on: Conditions
) -> ByImpacts:
    """Put an orbit under conditions of a finite lattice, opened up or by its half if asked for."""
    if sign == -1 and not orbit.symmetric:
        raise BadInput("this orbit was not shot as a symmetric one; start from a breather.")
    if sign == 1:
        orbit = orbit.unfolded()
    if sequence is not None:
        return _otherwise(orbit, on, sequence)
    section = orbit.section.on(on.lattice)
    return ByImpacts.closest(on, section, orbit.times, orbit.impulses)


def _otherwise(orbit: Orbit, on: Conditions, sequence: Sequence[Any]) -> ByImpacts:
    """Begin a seed with another impact; or put the same times at other sites."""
    section = replace(orbit.section, impacts=checked_impacts(sequence)).placed(on.lattice)
    m = orbit.section.count
    if section.count != m:
        raise BadInput(
            f"the seed has {m} impacts in a section, the sequence {section.impacts} "
            f"{section.count}: give impact times by hand."
        )
    former = orbit.section.placed(on.lattice)
    impacts = [
        Impact(*hit, *impact[2:]) for hit, impact in zip(former.impacts, orbit.impacts, strict=True)
    ]
    course = former.course(impacts, 3)
    first = _beginning(course, section.impacts) or 0
    return ByImpacts.closest(on, section, [impact.time for impact in course[first : first + m]])
