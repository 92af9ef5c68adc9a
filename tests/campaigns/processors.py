"""The same labels and numbers whatever the processor: random work under several kinds of OpenBLAS.

    python -m tests.campaigns.processors [count=300] [first=0]

Each kind of processor that OpenBLAS and numpy can be told to be rounds otherwise. The same
branches, boundaries, arms, diagrams, zones, starts at special points and at the edges of domains
are computed under each, in a process tree of its own, and compared: labels, ends, reasons,
directions as they are, numbers to 1e-8.
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import networkx as nx
import numpy as np
from numpy._core._multiarray_umath import __cpu_dispatch__

import contbreather as cb
from contbreather.errors import ContbreatherError
from tests.campaigns.uneven import random_chain
from tests.continuation.zoo import ZOO

KINDS: dict[str, dict[str, str]] = {
    **{name: {"OPENBLAS_CORETYPE": name} for name in ("Haswell", "SkylakeX", "Zen", "Nehalem")},
    # the oldest also for numpy's own loops, which have sines and cosines of their own
    "Prescott": {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": " ".join(__cpu_dispatch__),
    },
}
CLOSE = 1e-8
_NUMBER = re.compile(r"-?\d+\.?\d*(e[-+]?\d+)?")

Said = list[tuple[str, list[float]]]
Steps = cb.Steps


def of_point(point: Any, name: str = "") -> tuple[str, list[float]]:
    """Its labels and what is known of it, and all numbers of both."""
    values = [np.ravel(point[slot]) for slot in point.curve.slots]
    words = {key: value for key, value in point.detail.items() if isinstance(value, str)}
    numbers = [np.ravel(value) for key, value in point.detail.items() if key not in words]
    known = _NUMBER.sub("#", f"{name}{point.label} {point.kind} {words}")
    # where the numerics gave up is no place that could be known
    given_up = point.kind == "MX"
    return known, [] if given_up else np.concatenate([*values, *numbers]).tolist()


def of_branch(name: str, branch: Any) -> Said:
    ends = [*branch.special, branch[0], branch[-1]]
    reason = _NUMBER.sub("#", branch.reason)
    doubtful = sorted(point.kind for point in branch.doubtful)
    about = f"{name}{branch.began} {branch.stop} {reason} {doubtful}"
    return [(about, []), *(of_point(point, name) for point in ends)]


def said(name: str, make: Callable[..., Any], *given: Any, **how: Any) -> Said:
    """What a call made, one branch or several, or what was said instead."""
    try:
        made = make(*given, **how)
    except (ContbreatherError, ArithmeticError, ValueError) as error:
        return [(f"{name}{type(error).__name__} {_NUMBER.sub('#', str(error))}", [])]
    several = made if isinstance(made, tuple) else (made,)
    return [entry for i, one in enumerate(several) for entry in of_branch(f"{name}{i}: ", one)]


def lines(branch: Any, pairs: list[tuple[str, str]], within: Any, most: int = 40) -> Iterator[Said]:
    """Each kind of special point of a branch as a curve, and the arms of the first pitchforks."""
    for point in {point.kind: point for point in branch.special}.values():
        for pair in pairs if point.kind not in ("EP", "MX", "UZ", "VI") else ():
            how = {"within": within, "steps": Steps(most=most)}
            yield said(f"{point.kind} {pair}: ", cb.boundary, point, pair, **how)
    for point in [point for point in branch.special if point.kind in ("PF", "PD", "BP")][:2]:
        yield said(f"arms of {point.label}: ", cb.switch, point, steps=Steps(most=most))


def forcing_of(rng: Any) -> Any:
    if rng.random() < 0.5:
        return cb.Harmonic()
    return cb.Fourier(cos={1: -1.0, 3: rng.normal(0, 0.3)}, sin={3: rng.normal(0, 0.3)})


def on_chain(rng: Any) -> Iterator[Said]:
    gamma, k = rng.choice([0.0, rng.uniform(0, 0.24)]), rng.choice([1.0, rng.uniform(0.1, 1)])
    given = {"gamma": float(gamma), "k": float(k), "forcing": forcing_of(rng)}
    names = ["a", "gamma", "k"]
    if rng.random() < 0.6:
        given["spring"] = float(rng.choice([0.0, rng.uniform(0, 0.1)]))
        names += ["spring"]
    start = cb.symmetric(rng.uniform(0.3, 0.8), **given)
    free, one, other = rng.permutation(names)[:3].tolist()
    within = {"a": (0.02, 1.5), "gamma": (0.0, 0.24), "k": (0.0, 1.0)}
    branch = cb.trace(start, free, within=within)
    yield of_branch("", branch)
    yield from lines(branch, [(free, one), (other, free)], within)


def on_lattice(rng: Any) -> Iterator[Said]:
    sites, star = int(rng.integers(5, 16)), cb.Lattice.from_graph(nx.star_graph(4))
    known = [cb.Ring(sites), cb.OpenChain(sites), cb.Grid(3, 4), star]
    lattice = known[rng.integers(4)]
    given = {"damping": float(rng.choice([0.0, 0.01, 0.05])), "spring": float(rng.choice([0, 0.1]))}
    start = cb.symmetric(rng.uniform(0.5, 0.8), rng.uniform(0, 0.08), 0.8, lattice=lattice, **given)
    yield from around(rng, start, {"a": (0.3, 1.0), "gamma": (0.0, 0.12), "k": (0.3, 1.0)})


def of_uneven(rng: Any) -> Iterator[Said]:
    start = cb.symmetric(**random_chain(rng, 0.8))
    yield from around(rng, start, {"a": (0.1, 1.5), "gamma": (0.0, 0.12), "k": (0.4, 0.99)})


def around(rng: Any, start: Any, within: dict[str, tuple[float, float]]) -> Iterator[Said]:
    free, other = rng.permutation(list(within))[:2].tolist()
    branch = cb.trace(start, free, within=within)
    yield of_branch("", branch)
    yield from lines(branch, [(other, free)], within, 15)


def by_shooting(rng: Any) -> Iterator[Said]:
    b = cb.symmetric(rng.uniform(0.7, 0.85), rng.uniform(0.01, 0.05), 0.8)
    shot = cb.shooting(b, sites=int(rng.integers(8, 30)))
    branch = cb.trace(shot, "a", within={"a": (0.5, 0.95)})
    yield of_branch("", branch)
    yield from lines(branch, [("gamma", "a")], {"gamma": (0.0, 0.06), "a": (0.6, 0.95)}, 60)


def of_zones(rng: Any) -> Iterator[Said]:
    lattice = [cb.InfiniteChain(), cb.Ring(int(rng.integers(8, 40)))][rng.integers(2)]
    drawn = cb.zones(k=rng.uniform(0.3, 0.98), lattice=lattice, forcing=forcing_of(rng))
    yield [entry for kind, curve in drawn for entry in of_branch(f"{kind}: ", curve)]
    yield [(_NUMBER.sub("#", str(region)), []) for region in drawn.regions]


def of_diagram(rng: Any) -> Iterator[Said]:
    lattice = [None, cb.Ring(9), cb.OpenChain(5)][rng.integers(3)]
    given = {} if lattice is None else {"lattice": lattice, "damping": 0.01}
    gamma = rng.uniform(0.0, 0.03) * rng.integers(2)
    start = cb.symmetric(0.7, gamma, rng.uniform(0.7, 0.9), **given)
    tree = cb.diagram(start, "a", within={"a": (0.5, 0.99)})
    yield [e for i, branch in enumerate(tree.branches) for e in of_branch(f"{i}: ", branch)]


def of_anybody(rng: Any) -> Iterator[Said]:
    """Problems of the zoo, from their usual start and from each special point of their branch."""
    case = ZOO[int(rng.integers(len(ZOO)))]
    how: dict[str, Any] = {"within": case.within, "events": case.events}
    how["steps"] = Steps(largest=case.largest * rng.uniform(0.5, 1.5))
    branch = cb.trace(case.problem, case.free, **how)
    yield of_branch(case.name, branch)
    for point in branch.special:
        for towards in ("up", "down", "both"):
            name = f"{case.name} {point.label} {towards}: "
            yield said(name, cb.trace, point.problem, case.free, towards=towards, **how)
        if point.kind == "BP":
            yield said("arms ", cb.switch, point, steps=Steps(most=20))


def at_points(rng: Any) -> Iterator[Said]:
    """From special points of breathers, in the same parameter and in others."""
    spring = rng.choice([None, 0.0, 0.03])
    more = {} if spring is None else {"spring": spring}
    start = cb.symmetric(0.5, rng.uniform(0.02, 0.09), rng.uniform(0.5, 0.95), **more)
    branch = cb.trace(start, "a", within={"a": (0.02, 1.2)})
    for point in branch.special:
        for free in ("a", "gamma", "k", *more):
            for towards in ("up", "down"):
                name = f"{point.label} {free} {towards}: "
                yield said(name, cb.trace, point.problem, free, towards=towards)


def at_edges(rng: Any) -> Iterator[Said]:
    """Curves of events that begin at an edge of the domain."""
    edge = {"gamma": 0.0, "k": 1.0, "spring": 0.0}
    which = str(rng.choice(list(edge)))
    given = {"gamma": 0.05, "k": 0.8, "spring": 0.02, which: edge[which]}
    branch = cb.trace(cb.symmetric(0.7, **given), "a", within={"a": (0.05, 0.98)})
    yield of_branch("", branch)
    for other in [name for name in ("a", *edge) if name != which]:
        yield from lines(branch, [(which, other), (other, which)], {"a": (0.01, 1.2)}, 15)


WORK = (
    on_chain, on_lattice, of_uneven, by_shooting, of_zones, of_diagram, of_anybody, at_points,
    at_edges,
)  # fmt: skip


def child(first: int, count: int) -> None:
    for seed in range(first, first + count):
        work = WORK[seed % len(WORK)]
        started = time.perf_counter()
        entries: Said = []
        try:
            for part in work(np.random.default_rng(seed)):
                entries += part
        except ContbreatherError as error:
            entries.append((f"{type(error).__name__} {_NUMBER.sub('#', str(error))}", []))
        spent = time.perf_counter() - started
        print(json.dumps({"seed": seed, "work": work.__name__, "spent": spent, "said": entries}))


def run(kind: str, first: int, count: int) -> dict[int, Any]:
    own = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **KINDS[kind]}
    command = [sys.executable, "-W", "ignore", "-m", "tests.campaigns.processors", "child"]
    done = subprocess.run(
        [*command, str(first), str(count)], env={**os.environ, **own}, text=True,
        stdout=subprocess.PIPE, check=True,
    )  # fmt: skip
    found = [json.loads(line) for line in done.stdout.splitlines()]
    return {entry["seed"]: entry for entry in found}


def apart(one: Said, other: Said) -> str:
    """The first thing that two processors say differently."""
    for (name, values), (theirs, others) in zip(one, other, strict=False):
        if name != theirs:
            return f"{name!r} and {theirs!r}"
        off = [
            abs(x - y) / (1 + max(abs(x), abs(y)))
            for x, y in zip(values, others, strict=True)
            if not (math.isnan(x) and math.isnan(y))
        ]
        if off and not max(off) < CLOSE:
            return f"{name!r}: {values} and {others}, {max(off):.2g} apart"
    return "" if len(one) == len(other) else f"{len(one)} and {len(other)} entries"


def main(count: int = 300, first: int = 0) -> None:
    with ThreadPoolExecutor(int(os.environ.get("PROCESSES", 2))) as pool:
        found = dict(zip(KINDS, pool.map(lambda kind: run(kind, first, count), KINDS), strict=True))
    reference, *others = KINDS
    differ = 0
    for seed, entry in found[reference].items():
        for other in others:
            why = apart(entry["said"], found[other][seed]["said"])
            if why:
                differ += 1
                print(f"seed {seed}, {entry['work']}, {reference} and {other}: {why}", flush=True)
                break
    entries = sum(len(entry["said"]) for entry in found[reference].values())
    for work in WORK:
        spent = [e["spent"] for e in found[reference].values() if e["work"] == work.__name__]
        print(f"{work.__name__}: {sum(spent):.0f} s, at most {max(spent, default=0):.0f} s")
    print(f"{count} pieces of work, {entries} entries, under {list(KINDS)}: {differ} differ")


if __name__ == "__main__":
    if sys.argv[1:2] == ["child"]:
        child(*map(int, sys.argv[2:]))
    else:
        main(*map(int, sys.argv[1:]))
