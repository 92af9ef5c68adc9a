"""Stability of a breather against the paper's route."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from .measure import Row, best_of, each, faster, span, walked
from .paper_route import Breather, furthest
from .shooting import compiled

AT = {"a": 0.5, "gamma": 0.08, "k": 0.8}


def fresh(count: int, seed: float) -> list[dict[str, float]]:
    """Parameters near `AT`, all different and different for each `seed`."""
    return [{**AT, "gamma": AT["gamma"] + 1e-5 * (i + seed)} for i in range(count)]


def breathers(count: int, seed: float) -> list[Any]:
    import contbreather as cb

    return [cb.symmetric(**at) for at in fresh(count, seed)]


def baseline(sites: int, repeat: int) -> float:
    return best_of(lambda: Breather(sites=sites, **AT).multipliers(), repeat)


def multipliers_time(sites: int, count: int) -> float:
    warm, *rest = breathers(count + 1, seed=0.1 + sites / 1e4)
    warm.multipliers(sites=sites)
    return each(lambda b: b.multipliers(sites=sites), rest)


def agreement(sites: int) -> str:
    import contbreather as cb

    ours = cb.symmetric(**AT, lattice=cb.Ring(sites)).multipliers(sites=sites)
    reference = Breather(sites=sites, **AT).multipliers()
    apart = max(furthest(ours, reference), furthest(reference, ours))
    return f"all {ours.size} multipliers agree to {apart:.0e}"


def against(what: str, ours: float, paper: float, sites: int, aim: float, note: str = "") -> Row:
    return faster(what, ours, f"the paper's route at N = {sites}", paper, aim, note)


def verdict(breather: Any) -> tuple[int, bool, bool]:
    """All that stability() says of the infinite chain: parts of it are computed when asked for."""
    said = breather.stability()
    return said.unstable, said.stable, said.over_reflecting


def rows_at_400(paper: float) -> list[Row]:
    verdict(breathers(1, seed=0.7)[0])
    chain = each(verdict, breathers(200, seed=0.3))
    points = fresh(200, seed=0.5)
    import contbreather as cb

    whole = each(lambda at: verdict(cb.symmetric(**at)), points)
    every = multipliers_time(400, count=20)
    return [
        against("stability() of a new point, infinite chain", chain, paper, 400, 1000),
        against("closure and stability() of a new point", whole, paper, 400, 1000),
        against("all multipliers, N = 400", every, paper, 400, 30, agreement(400)),
    ]


def row_at_1600() -> Row:
    paper = baseline(1600, repeat=1)
    ours = multipliers_time(1600, count=5)
    return against("all multipliers, N = 1600", ours, paper, 1600, 200)


def row_growth() -> Row:
    sizes = np.array([400, 800, 1600, 3200])
    times = [multipliers_time(int(sites), count=5) for sites in sizes]
    exponent = float(np.polyfit(np.log(sizes), np.log(times), 1)[0])
    beside = "its own time at N = 400, 800, 1600, 3200: " + ", ".join(map(span, times))
    what = "all multipliers, growth of the time with N"
    return Row(what, f"N^{exponent:.2f}", beside, aim="≤ N^2.1", met=exponent <= 2.1)


def boundary_row(kind: str, branch: Any, steps: int = 100) -> Row:
    """A boundary in gamma and a with all its events, a point of many."""
    import contbreather as cb

    within = {"gamma": (0.0, 0.2499), "a": (0.0, 1.0)}
    follow = partial(cb.boundary, branch.first(kind), ("gamma", "a"), within=within)
    ends = follow()["arclength"][[0, -1]]
    fine = cb.Steps(largest=abs(ends[1] - ends[0]) / steps)
    return walked(f"{kind} boundary with events", partial(follow, steps=fine), 2e-4)


def boundary_rows() -> list[Row]:
    import contbreather as cb

    compiled()
    lost = cb.trace(cb.symmetric(a=0.2, gamma=0.05, k=0.8), "gamma", within={"gamma": (0, 0.2)})
    forked = cb.trace(cb.symmetric(a=0.7, gamma=0.04, k=0.8), "a", within={"a": (0.5, 1)})
    touched = cb.trace(cb.symmetric(a=0.5, gamma=0.1, k=0.8), "a", within={"a": (0.3, 1)})
    kinds = {"NS": lost, "PF": forked, "GR": touched}
    return [boundary_row(kind, branch) for kind, branch in kinds.items()]


def rows(long: bool) -> list[Row]:
    paper = baseline(400, repeat=5)
    table = [Row("the paper's route, N = 400", span(paper), "baseline of the rows below")]
    table += [*rows_at_400(paper), row_growth(), *boundary_rows()]
    if long:
        table.append(row_at_1600())
    else:
        table.append(Row("all multipliers, N = 1600", "not run", "ask for it with --long"))
    return table
