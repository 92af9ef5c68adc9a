"""Orbits of random uneven chains beside an integrator of their own.

    python -m tests.campaigns.uneven 200 SEED

Springs, dampings, restitution, masses and walls differ from site to site, by ten per cent in every
second chain, by anything in the others. Each orbit has to return to its state after a period of a
motion made of matrix exponentials, with as many impacts as it says, and its multipliers are those
of the same flights and of saltations written down from the two vector fields. So many orbits are
checked; draws without one that keeps off the walls are told, too.
"""

from __future__ import annotations

import collections
import itertools
import sys
from typing import Any

import numpy as np

import contbreather as cb
from contbreather.errors import ContbreatherError
from contbreather.orbits.constructors import orbit_at, shooting
from tests.orbits.field import Field
from tests.stability.by_hand import apart

RETURNS, ALIKE = 1e-10, 1e-6  # of states; of multipliers, relative above 1


def random_chain(rng: np.random.Generator, spread: float) -> dict[str, Any]:
    """Arguments of `symmetric` for a chain whose parts are off by so much."""
    n = int(rng.integers(3, 13))

    def each(mean: float, most: float = np.inf) -> list[float]:
        return np.minimum(mean * (1 + spread * rng.uniform(-1, 1, n)), most).tolist()

    lattice: Any = [cb.OpenChain(n), cb.OpenChain(n, ends="fixed"), cb.Ring(n)][rng.integers(3)]
    if rng.uniform() < 0.5 and not isinstance(lattice, cb.Ring):
        lattice = cb.Lattice(lattice.stiffness, masses=each(1.0))
    on: dict[str, Any] = {"a": rng.uniform(0.2, 0.8), "gamma": rng.uniform(0.01, 0.08)}
    on |= {"k": each(rng.uniform(0.5, 0.9), 1.0), "lattice": lattice}
    on |= {"site": int(rng.integers(n)), "damping": each(rng.uniform(0.002, 0.05))}
    if rng.uniform() < 0.7:
        on["spring"] = each(rng.uniform(0.05, 0.4))
    if rng.uniform() < 0.5:
        on["walls"] = {i: (-x, x) for i, x in enumerate(each(1.0))}
    if rng.uniform() < 0.3:
        on["damping"] = 0.0
    return on


def checked(orbit: cb.Orbit) -> str:
    """Verdict on an orbit: right, or what is wrong with it."""
    if orbit.admissibility().margin < 0.0:
        return "behind a wall"
    t = float(orbit.times[0]) - 0.3
    u, v = orbit.state(t=t)
    start = np.concatenate([u, v])
    end, hits, M = Field(orbit.lattice, orbit.conditions).run(start, t, t + 2 * np.pi)
    if len(hits) != len(orbit.hits):
        return f"WRONG: {len(hits)} impacts, not {len(orbit.hits)}"
    # what grows over a period makes rounding grow
    if (off := abs(end - start).max()) > max(RETURNS, 1e-14 * np.linalg.norm(M, 2)):
        return f"WRONG: off by {off:.2g}"
    theirs = orbit.multipliers()
    if (off := apart(np.linalg.eigvals(M), theirs)) > ALIKE:
        return f"WRONG: multipliers off by {off:.2g}"
    return "right"


def answer(rng: np.random.Generator, number: int) -> str:
    """The verdict on one random chain: on its symmetric breather or, of every third, on an orbit
    over the whole period between walls that are not symmetric."""
    on = random_chain(rng, 0.1 if number % 2 else 0.8)
    try:
        orbit = cb.symmetric(**on)
        if number % 3 == 0:
            walls = {**(on.get("walls") or {})}
            low, high = walls.get(on["site"], (-1.0, 1.0))
            on = {**on, "walls": {**walls, on["site"]: (0.97 * low, high)}}
            orbit = orbit_at(shooting(orbit, symmetric=False, walls=on["walls"], inadmissible=True))
    except ContbreatherError as refused:
        return f"{type(refused).__name__}"
    return checked(orbit)


def main(count: int, seed: int) -> int:
    found: collections.Counter[str] = collections.Counter()
    for number in itertools.count():
        if found["right"] + found["WRONG"] >= count:
            break
        said = answer(np.random.default_rng([seed, number]), number)
        if said.startswith("WRONG"):
            print(number, said)
        found[said.partition(":")[0]] += 1
    print(dict(found))
    return found["WRONG"]


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3])) > 0)
