"""Questions about multipliers that have no answer, or one in another place; and orders of lists."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from contbreather import stability
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain, Ring
from contbreather.stability.chain_map import OrbitMap
from contbreather.stability.saltation import Saltation
from contbreather.stability.verdict import verdict
from tests.stability.by_hand import ring_map

ORBIT = [(0, 0.0, 0.5), (0, 3.0, 0.5)]
REFUSED = [
    # couplings
    *(
        (lambda g=g: stability.stability(g, 0.8, 0.1), "gamma")
        for g in (-0.1, -1e-9, 0.25, 0.3, math.nan, "x")
    ),
    (lambda: InfiniteChain(0.7).chi(0.08), "must stay below 1"),
    (lambda: InfiniteChain(1.2).chi(0.01), "spring"),
    (lambda: InfiniteChain(-0.1).chi(0.1), "spring"),
    # losses and entries
    (lambda: stability.stability(0.1, 1.2, 0.1), "restitution"),
    (lambda: stability.stability(0.1, -0.1, 0.0, sites=12), "restitution"),
    (lambda: stability.stability(0.1, "much", 0.1), "must be a number with 0 <= k <= 1"),
    (lambda: stability.stability(0.1, 0.8, math.nan), "finite"),
    (lambda: stability.saltation_entry(1.0, 0, 0.8), "w_minus = 0: a finite velocity other than 0"),
    # lattices, circles and thresholds
    (lambda: stability.stability(0.1, 0.8, 0.1, "ring"), "lattice"),
    *((lambda n=n: stability.stability(0.1, 0.8, 0.1, sites=n), "sites") for n in (0, -3, 2.5)),
    *(
        (lambda x=x: stability.stability(0.1, 0.8, 0.1, sites=40, threshold=x), "threshold")
        for x in (1.0, 0.5, math.inf, math.nan)
    ),
    (
        lambda: verdict(
            ring_map(Ring(5), 0.1, 0.8, tuple(Saltation(*kick) for kick in ORBIT)), 1.0
        ),
        "threshold",
    ),
    (lambda: Ring(10**9), "sites = 1000000000: a ring has at most 10000000"),
    (
        lambda: stability.stability(0.1, 0.8, 0.3, sites=10**5),
        "^ring of 100000: its impacts move 50001 modes, and how an orbit changes is told by a "
        "matrix, of up to 5000; take fewer sites",
    ),
    # orbits
    (lambda: OrbitMap(0.1, 0.8, []), "without impacts"),
    (lambda: OrbitMap(0.1, 0.8, ORBIT[::-1]), "in order of time"),
    (lambda: OrbitMap(0.1, 0.8, [(0, 0.0, 0.5), (0, 7.0, 0.5)]), "in order of time"),
    (lambda: OrbitMap(0.1, 0.8, [(0, 0.0, math.nan)]), "finite"),
    (lambda: OrbitMap(0.1, 1.2, ORBIT), r"k = 1\.2"),
    (lambda: OrbitMap(0.1, 0.8, ORBIT, periods=2), "radiates"),
    (lambda: OrbitMap(0.1, 0.8, [*ORBIT[:1], (1, 1.0, 0.5)]).crosses(1.0), "several sites"),
]


@pytest.mark.parametrize(("ask", "says"), REFUSED, ids=lambda one: one if str(one) == one else "")
def test_a_question_without_an_answer_is_refused(ask: Callable[[], object], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        ask()


@pytest.mark.parametrize("bad", [math.nan, math.inf, "x", None])
@pytest.mark.parametrize(
    ("ask", "name"),
    [
        (lambda bad: stability.saltation(0.8, bad), "b"),
        (lambda bad: stability.saltation_entry(bad, 0.5, 0.8), "acceleration"),
        (lambda bad: stability.saltation_entry(-0.2, bad, 0.8), "w_minus"),
    ],
)
def test_what_is_no_finite_number_is_named(ask, name: str, bad: object) -> None:
    with pytest.raises(BadInput, match=rf"{name} = .*(number|band|expected|lies between)"):
        ask(bad)
