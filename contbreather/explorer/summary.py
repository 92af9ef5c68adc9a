"""What is said of curves and orbits in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache

from contbreather.continuation.branch import Branch
from contbreather.errors import BadInput, ContbreatherError
from contbreather.explorer.jobs import point_of
from contbreather.lattice.chain import Ring
from contbreather.orbits.orbit import Orbit


def names(curves: Mapping[str, Branch]) -> dict[str, str]:
    """The codes of curves by their names, which have what not all of them share: the parameters
    that vary, those that do not, and the lattice."""
    by_code = {code: _facts(branch) for code, branch in curves.items()}
    shared = set.intersection(*map(set, by_code.values())) if by_code else set()
    rest = {code: [fact for fact in facts if fact not in shared] for code, facts in by_code.items()}
    return {": ".join(filter(None, (code, ", ".join(rest[code])))): code for code in rest}


def _facts(branch: Branch) -> list[str]:
    varied, first = branch.curve.varied, point_of("", branch, 0)
    facts = [f"in {', '.join(varied)}"]
    facts += [first.orbit.lattice.describe()] if first.orbit is not None else []
    fixed = ((n, v) for n, v in branch.problem.params.items() if n not in varied)
    return facts + [f"{name} = {value:.6g}" for name, value in fixed]


@lru_cache(maxsize=1)
def on_ring(orbit: Orbit, ring: int) -> Orbit:
    """The same there, once: its multipliers are drawn and judged."""
    return orbit.on(Ring(ring))


def verdict(orbit: Orbit) -> str:
    """Whether the lattice moves so, and whether it stays at it, in half a line."""
    margins = orbit.admissibility()
    if not margins.ok and margins.margin < -1e-9:
        return "not admissible: it passes a wall"
    words = {True: "stable", False: "unstable", None: "of unknown stability"}
    stable = _sentence(lambda: words[orbit.stability().stable])
    return stable if margins.ok else f"{stable}, at the edge of what is admissible"


def verdicts(orbit: Orbit, ring: int) -> Iterator[tuple[str, str]]:
    """What is said of it: a heading and a sentence each."""
    margins = orbit.admissibility()
    yield "admissible" if margins.ok else "not admissible", margins.reason
    if not margins.ok and margins.margin < -1e-9:
        yield "stability", "nothing is said of it: the lattice has no such motion"
        return
    yield "own lattice", _sentence(lambda: orbit.stability().describe())
    if orbit.lattice.sites is None:
        yield f"ring of {ring}", _sentence(lambda: on_ring(orbit, ring).stability().describe())
        if orbit.symmetric and orbit.section.count == 1:
            yield "over-reflection", _sentence(lambda: _reflection(orbit))


def _reflection(orbit: Orbit) -> str:
    waves = orbit.stability().over_reflection
    if not waves.over_reflecting:
        return "waves come back no larger than they were: no ring of any size is unstable by them"
    return (
        f"waves come back up to {math.exp(waves.gain):.6g} times as large (at the angle "
        f"{waves.nu:.6g} pi); on long rings |mu| = 1 + {waves.growth:.6g}/N over half a period"
    )


def _sentence(ask: Callable[[], str]) -> str:
    try:
        return ask()
    except BadInput as error:
        return f"not known: {error}"
    except ContbreatherError as error:
        return str(error)
