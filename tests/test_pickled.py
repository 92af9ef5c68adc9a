"""What comes out of a pickle computes the same as what went in, to the bit."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import contbreather as cb
from contbreather.orbits.constructors import asymmetric

SHORT = cb.Steps(most=2)


def again(value: Any) -> Any:
    return pickle.loads(pickle.dumps(value))


def same(one: Any, other: Any) -> bool:
    """Branches with the same columns, labels and ends."""
    labels = [[point.label for point in branch.special] for branch in (one, other)]
    ends = [(branch.stop, branch.began, branch.reason) for branch in (one, other)]
    columns = [np.array_equal(one[name], other[name], equal_nan=True) for name in one.names]
    return labels[0] == labels[1] and ends[0] == ends[1] and all(columns)


def van_der_pol(x: np.ndarray, p: dict[str, float]) -> np.ndarray:
    return np.array([x[1] + p["h"], p["mu"] * x[1] - x[0]])


def oscillator(t: float, x: np.ndarray, p: dict[str, float]) -> list[float]:
    return [x[1], p["mu"] * (1 - x[0] ** 2) * x[1] - x[0]]


def logistic(x: np.ndarray, p: dict[str, float]) -> np.ndarray:
    return p["r"] * x * (1 - x)


# each road, with the parameter of its branch and where that goes to
STARTS: dict[str, Callable[[], tuple[Any, str, tuple[float, float]]]] = {
    "closed form": lambda: (cb.symmetric(0.5, 0.04, 0.8), "a", (0.4, 0.99)),
    "ring": lambda: (cb.symmetric(0.2, 0.08, 0.8, lattice=cb.Ring(20)), "gamma", (0, 0.12)),
    "forcing": lambda: (
        cb.symmetric(0.5, 0.04, 0.8, forcing=cb.Symbolic("cos(t) + c3*cos(3*t)", c3=0.1)),
        "c3", (-0.2, 0.2),
    ),
    "arm": lambda: (asymmetric(0.85, 0.04, 0.8), "a", (0.75, 0.95)),
    "waves": lambda: (
        cb.multibreather([0, 6], a=0.5, gamma=0.03, k=0.8, lattice=cb.Ring(12)), "a", (0.45, 0.6)
    ),
    "modes": lambda: (
        cb.symmetric(0.6, 0.05, 0.8, lattice=cb.OpenChain(9), damping=0.01, spring=0.2),
        "a", (0.5, 0.9),
    ),
    "shooting": lambda: (cb.shooting(cb.symmetric(0.75, 0.04, 0.8), sites=5), "a", (0.7, 0.8)),
    "equations": lambda: (
        cb.Problem(van_der_pol, {"x": 0.0, "y": 0.0}, {"mu": -0.5, "h": 0.0}, events=(cb.hopf(),)),
        "mu", (-1, 1),
    ),
    "map": lambda: (cb.FixedPoint(logistic, {"x": 0.6}, {"r": 2.5}), "r", (1.5, 3.4)),
}  # fmt: skip


@pytest.fixture(scope="module", params=STARTS)
def traced(request: pytest.FixtureRequest) -> tuple[Any, str, dict[str, Any], cb.Branch]:
    start, free, window = STARTS[request.param]()
    within = {free: window}
    return start, free, within, cb.trace(start, free, within=within)


def test_a_start_out_of_a_pickle_has_the_same_branch(traced):
    start, free, within, branch = traced
    assert same(cb.trace(again(start), free, within=within), branch)


def test_a_branch_out_of_a_pickle_is_the_same_and_goes_on(traced):
    _, free, within, branch = traced
    copy = again(branch)
    assert same(copy, branch)
    ways = [
        cb.trace(one[2], free, within=within, steps=SHORT, towards="down") for one in (copy, branch)
    ]
    assert same(*ways)
    with pytest.raises(ValueError, match="read-only"):
        copy[1].z[0] = 0.0


def test_special_points_out_of_a_pickle_lead_to_the_same_curves(traced):
    """Boundaries, with what they meet, and arms; a boundary goes through a pickle itself."""
    _, free, _, branch = traced
    others = [name for name in ("gamma", "h") if name in branch.problem.params and name != free]
    for point in branch.special:
        if point.kind == "EP":
            continue
        copy = again(point)
        if others:
            pair = (free, others[0])
            lines = [cb.boundary(one, pair, steps=SHORT) for one in (copy, point)]
            assert same(*lines)
            assert same(again(lines[0]), lines[1])
        if point.kind in ("PF", "PD"):
            arms = [cb.switch(one, steps=SHORT) for one in (copy, point)]
            assert all(same(*pair) for pair in zip(*arms, strict=True))


def test_events_of_the_front_desk_out_of_a_pickle_find_the_same() -> None:
    orbit = cb.symmetric(0.2, 0.08, 0.8, lattice=cb.Ring(20))
    events = [cb.pitchfork(), cb.grazing(), cb.neimark_sacker(threshold=1.004)]
    events += [cb.user("gamma", 0.05)]
    window = {"gamma": (0.0, 0.12)}
    found = [cb.trace(orbit, "gamma", events=e, within=window) for e in (again(events), events)]
    assert same(*found)
    assert {"NS", "UZ"} <= {point.kind for point in found[0].special}
    assert again(cb.fold()) == cb.fold()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cycle", "breather"])
def test_cycles_go_through_a_pickle(name: str) -> None:
    """Their last digits depend on what was solved before."""
    if name == "cycle":
        start: Any = cb.cycle(oscillator, {"x": 2.0, "v": 0.0}, {"mu": 1.0}, settle=30)
    else:
        chain = cb.Oscillators(V="u**2/2 + u**4/4", W="mu*r**2/20", lattice=cb.Ring(4))
        start = cb.breather(chain, {1: 1}, omega=1.4, params={"mu": 1.0})
    branch = cb.trace(start, "mu", within={"mu": (0.8, 1.2)})
    for copy in (again(branch), cb.trace(again(start), "mu", within={"mu": (0.8, 1.2)})):
        for column in branch.names:
            np.testing.assert_allclose(copy[column], branch[column], atol=1e-10)


def test_diagrams_and_runs_go_through_a_pickle() -> None:
    tree = cb.diagram(cb.FixedPoint(logistic, {"x": 0.6}, {"r": 2.5}), "r", within={"r": (2, 3.5)})
    assert all(same(*pair) for pair in zip(again(tree).branches, tree.branches, strict=True))
    orbit = cb.symmetric(0.5, 0.04, 0.8)
    run = cb.simulate(orbit.state(sites=20, t=0.0), a=0.5, gamma=0.04, k=0.8, periods=3)
    assert np.array_equal(again(run).impacts, run.impacts)
    assert np.array_equal(again(run).final.u, run.final.u)
    assert again(orbit) == orbit
    assert again(cb.continuation.Stop.BOUND) is cb.continuation.Stop.BOUND
