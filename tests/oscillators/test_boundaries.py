"""Arms at PF and curves in two parameters: beside an integrated half of the period."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import contbreather as cb
from contbreather.flows.conservative_events import signatures
from contbreather.flows.cycle_events import events_of_cycle
from contbreather.oscillators.breather_problem import (
    BreatherProblem,
    SparseHalfOrbit,
    whole_orbit,
)

pytestmark = pytest.mark.slow

MORSE = lambda u: ((1 - np.exp(-u)) * np.exp(-u), 2 * np.exp(-2 * u) - np.exp(-u))  # noqa: E731
CUBIC = lambda u: (u + 0.6 * u**2 + u**3, 1 + 1.2 * u + 3 * u**2)  # noqa: E731
HARD = lambda u: (u + u**3, 1 + 3 * u**2)  # noqa: E731


def half_map(pull, K, c, u, time):
    """The state and its derivative a time, half a period, after rest at u: blocks of u and v."""
    n = len(u)

    def right(t, y):
        M, (force, stiff) = y[2 * n :].reshape(2 * n, -1), pull(y[:n])
        turned = np.vstack([M[n:], -(np.diag(stiff) + c * K) @ M[:n]])
        return np.concatenate([y[n : 2 * n], -force - c * K @ y[:n], turned.ravel()])

    start = np.concatenate([u, 0 * u, np.eye(2 * n).ravel()])
    end = solve_ivp(right, (0, time), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    M = end[2 * n :].reshape(2, n, 2, n).transpose(0, 2, 1, 3)
    return end[: 2 * n], {"uu": M[0, 0], "uv": M[0, 1], "vu": M[1, 0], "vv": M[1, 1]}


def whole(blocks):
    return np.block([[blocks["uu"], blocks["uv"]], [blocks["vu"], blocks["vv"]]])


def apart(point):
    """(I1 - I2)^2 of two pairs beside the orbit, and I1 + I2: by the traces of an integrated half,
    M = R M_half^-1 R M_half, which are sums of cos and of cos 2 of their angles."""
    orbit = point.base_point.solution
    R, K = np.repeat([1.0, -1.0], 3), stiffness(orbit.lattice)
    half = whole(half_map(CUBIC, K, point["c"], orbit.state()[0], np.pi / point["omega"])[1])
    M = R[:, None] * np.linalg.inv(half) * R @ half
    first, second = np.trace(M) / 2 - 1, np.trace(M @ M) / 2 - 1
    return abs(second + 2 - first**2), first


def stiffness(lattice):
    K = lattice.stiffness
    return np.asarray(K.toarray() if hasattr(K, "toarray") else K)


def triangle(w: float) -> cb.Lattice:
    graph = nx.Graph()
    graph.add_weighted_edges_from([(0, 1, 1.0), (1, 2, 1.0), (0, 2, w)])
    return cb.Lattice.from_graph(graph)


def morse(w: float = 0.45) -> cb.oscillators.BreatherProblem:
    """Third neighbours at about half of the stiffness: phases between 0 and pi set out."""
    chain = cb.Oscillators(V="(1 - exp(-u))**2/2", W="c*r**2/2", lattice=triangle(w))
    return cb.breather(chain, {0: 1, 1: -1, 2: 1}, omega=0.8, params={"c": 0.02})


def test_orbits_that_are_not_time_reversible_branch_off_at_pf() -> None:
    """They return under an own integration, are nowhere at rest, and are each other's mirror
    images in time, on the side of PF where the reversible ones are of the other stability."""
    branch = cb.trace(morse(), "omega", within={"omega": (0.75, 0.9)})
    point = branch.first("PF")
    arms = cb.switch(point, within={"omega": (0.7, 0.9), "energy": (0, 10)}, steps=cb.Steps(most=6))
    assert [arm[0]["omega"] for arm in arms] == pytest.approx([point["omega"]] * 2, abs=1e-9)
    K = stiffness(triangle(0.45))
    for arm in arms:
        orbit = arm[-1].solution
        x = orbit.states(0.0)
        right = lambda t, y: [*y[3:], *(-MORSE(y[:3])[0] - 0.02 * K @ y[:3])]  # noqa: E731
        how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
        end = solve_ivp(right, (0, 2 * np.pi / arm[-1]["omega"]), x, **how).y[:, -1]
        assert abs(end - x).max() < 1e-9
        times = np.linspace(0, orbit.period, 1000)
        assert abs(orbit.states(times)[3:]).max(axis=0).min() > 1e-2
    ends = [arm[-1].solution for arm in arms]
    assert ends[0].energy == pytest.approx(ends[1].energy, rel=1e-3)
    assert abs(ends[0].displacement(0, 1.0) - ends[1].displacement(0, 1.0)) > 1e-3


def test_phases_that_are_free_without_coupling_are_no_branch() -> None:
    """Both sites may be at any phase there, at one value of the coupling."""
    chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.OpenChain(3))
    pair = cb.breather(chain, {0: 1, 1: 1}, omega=1.5, params={"c": 0.02})
    tree = cb.diagram(pair, "c", within={"c": (-0.02, 0.05)})
    assert [point.kind for point in tree.special] == ["EP", "PF", "EP"]
    (failure,) = tree.failed
    assert abs(failure.place.point["c"]) < 1e-9
    assert "each site has a phase of its own" in failure.reason


CASES = {
    "PF": (morse, "omega", (0.75, 0.9), "c", (0.01, 0.03), MORSE, 3),
    "PD": (
        lambda: cb.breather(
            cb.Oscillators(V="u**2/2 + 0.2*u**3 + u**4/4", W="c*r**2/2", lattice=cb.OpenChain(3)),
            {0: 1}, omega=2.0, params={"c": 0.1},
        ), "omega", (2.0, 2.13), "c", (0.09, 0.11), CUBIC, 3,
    ),
    "BP": (
        lambda: cb.breather(
            cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.OpenChain(2)),
            {0: 1, 1: -1}, omega=1.9, params={"c": 0.1},
        ), "omega", (1.1, 2.0), "c", (0.05, 0.15), HARD, 2,
    ),
    "LP": (
        lambda: cb.breather(
            cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.OpenChain(3)),
            {0: 1}, omega=1.5, params={"c": 0.2},
        ), "c", (0.2, 1.0), "omega", (1.45, 1.55), HARD, 3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", [*CASES])
def test_boundaries_are_where_blocks_of_the_half_map_lose_rank(kind: str) -> None:
    """At rest at both ends, from u to v: LP and BP, at -1 from u to u or from v to v: PD; and from
    v to u, beside the orbit's own velocity: PF."""
    make, free, window, other, around, pull, n = CASES[kind]
    start = make()
    branch = cb.trace(start, free, within={free: window})
    # in the parameter, and not in the energy of the family
    points = (p for p in branch.special if p.kind == kind and "energy" not in str(p.detail))
    line = cb.boundary(next(points), (other, free), within={other: around})
    assert len(line) >= 5
    assert np.ptp(line[other]) > 0.9 * (around[1] - around[0])
    assert not {"BT", "ZH"} & {point.kind for point in line.special}  # which are of equilibria
    K = stiffness(start.solution.lattice)
    for point in (line[0], line[len(line) // 2], line[-1]):
        u, v = point.base_point.solution.state()
        assert abs(v).max() < 1e-12
        half = np.pi / point["omega"]
        end, blocks = half_map(pull, K, point["c"], u, half)
        assert abs(end[n:]).max() < 1e-8
        sizes = {name: np.linalg.svd(M)[1] for name, M in blocks.items()}
        least = {
            "PF": sizes["uv"][-2], "PD": min(sizes["uu"][-1], sizes["vv"][-1]),
            "BP": sizes["vu"][-1], "LP": sizes["vu"][-1],
        }[kind]  # fmt: skip
        assert least < 1e-8


def test_collisions_beside_pd_are_all_located() -> None:
    """Where two pairs of opposite signature meet both of their indices are one."""
    start = CASES["PD"][0]()
    branch = cb.trace(start, "omega", within={"omega": (1.9, 2.3)})
    assert not branch.doubtful
    meetings = [point for point in branch.special if point.kind == "KC"]
    assert len(meetings) == 2
    for point in meetings:
        assert apart(point)[0] < 1e-8
        assert point.detail["signatures"] == "+ -"


def test_pairs_that_a_symmetry_keeps_apart_hide_no_collision() -> None:
    """Beside a mode that is odd about the breather on a ring of four: between both KC there are
    four multipliers off the circle, by an integrated half."""
    chain = cb.Oscillators(V="u**2/2 + 0.2*u**3 + u**4/4", W="c*r**2/2", lattice=cb.Ring(4))
    start = cb.breather(chain, {0: 1}, omega=2.15, params={"c": 0.1})
    branch = cb.trace(start, "omega", within={"omega": (2.08, 2.2)})
    assert not branch.doubtful
    first, last = (p["omega"] for p in branch.special if p.kind == "KC")
    one, R = np.eye(4), np.repeat([1.0, -1.0], 4)
    K = 2 * one - np.roll(one, 1, 0) - np.roll(one, -1, 0)
    for omega, off in ((first - 1e-3, 0), (first + 1e-3, 4), (last - 1e-3, 4), (last + 1e-3, 0)):
        u = start.at(omega=omega).solve(tolerance=1e-11)[0].solution.state()[0]
        half = whole(half_map(CUBIC, K, 0.1, u, np.pi / omega)[1])
        mu = np.linalg.eigvals(R[:, None] * np.linalg.inv(half) * R @ half)
        assert ((abs(abs(mu) - 1) > 1e-3) & (abs(mu.imag) > 1e-3)).sum() == off


def test_pairs_of_half_of_an_even_breather_pass_minus_one_and_each_other_at_no_cost() -> None:
    """Where its second half is the first with all signs turned, q of a half is 2 q^2 - 1 of the
    whole: no KC, as many quadruplets by an integrated half at either end, and few calls of V."""
    asked = list[int]()

    def V(u, p):
        asked.append(1)
        return 1 - np.cos(u)

    chain = cb.Oscillators(V=V, W="c*r**2/2", lattice=cb.Ring(5))
    start = cb.breather(chain, {2: 1}, omega=0.71, params={"c": 0.03})
    asked.clear()
    branch = cb.trace(start, "omega", within={"omega": (0.65, 0.71)}, towards="down")
    assert len(asked) < 3500
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    assert not branch.doubtful
    one = np.eye(5)
    K, pull = 2 * one - np.roll(one, 1, 0) - np.roll(one, -1, 0), lambda u: (np.sin(u), np.cos(u))
    for end in (branch[0], branch[-1]):
        u = end.solution.state()[0]
        A = half_map(pull, K, 0.03, u, np.pi / end["omega"])[1]["uu"]
        q = np.sort_complex(np.linalg.eigvals(-A))[:-1]  # but the trivial one
        assert abs(q.imag).max() < 1e-9
        assert (
            abs(np.sort_complex(2 * q**2 - 1) - np.sort_complex(end.solution.indices)).max() < 1e-7
        )


def test_a_curve_of_collisions_goes_on_where_those_of_half_of_an_even_breather_pass_i() -> None:
    """By an integrated half, whose indices are two the same, on both sides of -1 of the whole."""
    chain = cb.Oscillators(V="1-cos(u)", W="c*r**2/2", lattice=cb.OpenChain(5))
    start = cb.breather(chain, {1: 1, 3: -1}, omega=0.65, params={"c": 0.12})
    branch = cb.trace(start, "c", within={"c": (0.12, 0.17)}, towards="up")
    window = {"omega": (0.61, 0.66), "c": (0.1, 0.2)}
    line = cb.boundary(branch.first("KC"), ("c", "omega"), within=window)
    assert min(line["angle"]) < 3.1 < 3.2 < max(line["angle"])
    K, pull = stiffness(cb.OpenChain(5)), lambda u: (np.sin(u), np.cos(u))
    for end in (line[0], line[-1]):
        u = end.base_point.solution.state()[0]
        A = half_map(pull, K, end["c"], u, np.pi / end["omega"])[1]["uu"]
        assert np.sort(abs(np.linalg.eigvals(-A) - np.cos(end["angle"] / 2)))[1] < 1e-4


def test_the_energy_turns_next_to_a_fold() -> None:
    """Within one step of a walk in the coupling: where it turns, so it does in the frequency."""
    chain = cb.Oscillators(V="(1 - exp(-u))**2/2", W="c*r**2/2", lattice=cb.Ring(3))
    start = cb.breather(chain, {2: 1}, omega=0.802, params={"c": 0.024})
    branch = cb.trace(start, "c", within={"c": (0.02, 0.1)}, towards="up")
    turn, fold = (point for point in branch.special if point.kind == "LP")
    assert 0 < fold["c"] - turn["c"] < 1e-5
    assert "said" in turn.detail
    assert "said" not in fold.detail
    for h in (-1e-5, 1e-5):
        beside = turn.problem.at(omega=turn["omega"] + h).solve(tolerance=1e-12)[0]
        assert beside.solution.energy > turn["energy"] + 1e-6


@pytest.mark.parametrize("V", ["u**2/2 - u**4/8", "(1 - exp(-u))**2/2"])
def test_no_energy_turns_where_an_arm_leaves_its_branch(V) -> None:
    """A breather of one of two sites grows into the motion of both, and back on the other."""
    pair = cb.Oscillators(V=V, W="c*r**2/2", lattice=cb.OpenChain(2))
    start = cb.breather(pair, {0: 1}, omega=0.8, params={"c": 0.02})
    branch = cb.trace(start, "c", within={"c": (0.01, 0.6)}, towards="up")
    assert [point.kind for point in branch.special] == ["EP", "BP", "EP"]
    assert not branch.doubtful


def test_where_an_arm_leaves_its_branch_no_fold_is_read_from_rounding() -> None:
    """Two sites in the middle of a chain of diamonds swing against each other, all others rest."""
    diamonds = nx.Graph()
    diamonds.add_nodes_from(range(10))
    for a in (0, 3, 6):
        diamonds.add_edges_from([(a, a + 1), (a, a + 2), (a + 1, a + 3), (a + 2, a + 3)])
    lattice = cb.Lattice.from_graph(diamonds)
    chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=lattice)
    compact = cb.breather(chain, {4: 1, 5: -1}, omega=1.165, params={"c": 0.1})
    fork = cb.trace(compact, "omega", within={"omega": (1.155, 1.165)}).first("PF")
    for arm in cb.switch(fork, within={"omega": (1.1, 1.2)}, steps=cb.Steps(most=2)):
        assert [point.kind for point in arm.special] == ["EP", "EP"]
        assert not arm.doubtful


def test_an_energy_that_turns_all_but_at_a_fold_has_a_label_of_its_own() -> None:
    """By shooting at fixed c it turns where the leaf begins at 0.4403468, the frequency, as the
    coupling, at 0.4403429; the multiplier that the fold does not change passes 1 there."""
    star = cb.Lattice.from_graph(nx.star_graph(3))
    chain = cb.Oscillators("(1 - exp(-u))**2/2", "c*r**2/2", star)
    start = cb.breather(chain, {2: 1, 0: 1}, omega=0.8, params={"c": 0.06})
    branch = cb.trace(start, "c", within={"c": (0.06, 0.1)}, towards="up")
    turn, lp = (point for point in branch.special if point.kind == "LP")
    at = [point.solution.displacement(2, 0.0) for point in (turn, lp)]
    assert at == pytest.approx([0.4403468, 0.4403429], abs=2e-7)
    assert "in the energy" in turn.detail["said"]


def test_pairs_that_all_but_pass_each_other_by_do_not_collide() -> None:
    """A hard breather at a corner: pairs of opposite signature exchange their order, and between
    there is less instability than rounding, nowhere any multiplier off the circle."""
    chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*(1 - cos(r))", lattice=cb.Grid(2, 3))
    start = cb.breather(chain, {5: 1}, omega=1.955, params={"c": 0.042})
    branch = cb.trace(start, "energy", within={"energy": (5.6, 7.0)})
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    assert not branch.doubtful
    assert not branch["unstable"].any()
    before, after = (signatures(end.solution) for end in (branch[0], branch[-1]))
    assert (before[1][before[0].argsort()] != after[1][after[0].argsort()]).any()


def test_curves_of_collisions_cross_where_the_instability_between_them_closes() -> None:
    """At c = 0.0143 pairs come past each other, and rounding tells their vectors apart."""
    D = np.diff(np.eye(3), axis=0)
    uneven = cb.Lattice(D.T @ D, masses=[1, 1.2, 0.9])
    chain = cb.Oscillators("(1 - exp(-u))**2/2", "c*r**2/2 - 0.04*r**3/3", uneven)

    def collisions(c):
        start = cb.breather(chain, {0: 1}, omega=0.645, params={"c": c})
        branch = cb.trace(start, "omega", within={"omega": (0.635, 0.645)})
        found = [point for point in branch.special if point.kind == "KC"]
        return sorted(found, key=lambda point: point["omega"])

    before, beyond = collisions(0.018), collisions(0.012)
    steps = cb.Steps(largest=0.01)
    line = cb.boundary(before[0], ("c", "omega"), within={"c": (0.012, 0.018)}, steps=steps)
    end = line["c"].argmin()
    assert line["c"][end] == 0.012
    assert line["omega"][end] == pytest.approx(beyond[1]["omega"], abs=1e-7)


def test_the_curve_of_collisions_is_where_both_indices_are_one() -> None:
    """At both ends of the curve and between."""
    start = CASES["PD"][0]()
    branch = cb.trace(start, "omega", within={"omega": (2.0, 2.17)}, towards="up")
    line = cb.boundary(branch.first("KC"), ("c", "omega"), within={"c": (0.09, 0.11)})
    assert (line["c"].min(), line["c"].max()) == (0.09, 0.11)
    assert np.ptp(line["omega"]) > 0.01
    for point in (line[0], line[len(line) // 2], line[-1]):
        off, both = apart(point)
        assert off < 1e-8
        assert np.cos(point["angle"]) == pytest.approx(both / 2, abs=1e-6)


def test_curves_of_pd_of_modes_of_different_symmetry_cross() -> None:
    """Two neighbours half a period apart have modes that are odd and even about them, which pass -1
    together at c = 0.10563: the first PD on one side is the second on the other."""
    chain = cb.Oscillators("1 - cos(u)", "c*(r**2/2 - r**3/5)", cb.Ring(4))

    def flips(c: float) -> list[cb.continuation.Point]:
        b = cb.breather(chain, {0: 1, 1: -1}, omega=0.722, params={"c": c})
        branch = cb.trace(b, "omega", within={"omega": (0.718, 0.74)}, towards="both")
        return [point for point in branch.special if point.kind == "PD"]

    first, second = flips(0.1065)
    for start, end in zip((first, second), flips(0.105)[::-1], strict=True):
        line = cb.boundary(start, ("c", "omega"), within={"c": (0.105, 0.1065)}, towards="down")
        assert line[-1]["omega"] == pytest.approx(end["omega"], abs=1e-10)
        assert len(line) < 8


def test_a_curve_of_collisions_runs_close_beside_a_fold() -> None:
    """Along it one of the two indices is 1 at LP, 1e-8 to the side in c."""
    chain = cb.Oscillators(
        "u**2/2 + u**3/10 + u**4/4", "c*(exp(r) - 1 - r)", cb.OpenChain(4),
        masses=[0.64, 1.17, 0.75, 1.32],
    )  # fmt: skip

    def met(omega: float) -> cb.continuation.Point:
        b = cb.breather(chain, {0: 1, 2: -1, 3: 1}, omega=omega, params={"c": 0.07})
        return cb.trace(b, "c", within={"c": (0.07, 0.09)}, towards="up").first("KC")

    line = cb.boundary(met(1.55), ("omega", "c"), within={"omega": (1.52, 1.56)}, towards="down")
    assert abs(line[-1]["c"] - met(1.52)["c"]) < 1e-11


def test_a_curve_of_collisions_ends_where_both_pairs_come_to_one() -> None:
    """Above R1 of the same chain two pairs collide beside the fold, below it none."""
    chain = cb.Oscillators(
        "u**2/2 + u**3/10 + u**4/4", "c*(exp(r) - 1 - r)", cb.OpenChain(4),
        masses=[0.64, 1.17, 0.75, 1.32],
    )  # fmt: skip

    def met(omega: float) -> list[cb.continuation.Point]:
        b = cb.breather(chain, {0: 1, 2: -1, 3: 1}, omega=omega, params={"c": 0.07})
        branch = cb.trace(b, "c", within={"c": (0.07, 0.075)}, towards="up")
        fold = branch.special[-1 - [p.kind for p in branch.special[::-1]].index("LP")]
        return [p for p in branch.special if p.kind == "KC" and abs(p["c"] - fold["c"]) < 1e-5]

    start, *others = met(1.515)
    assert not others
    line = cb.boundary(start, ("omega", "c"), within={"omega": (1.5, 1.52)}, towards="down")
    assert [point.kind for point in line.special] == ["EP", "R1"]
    assert line[-1]["angle"] == pytest.approx(0.0, abs=1e-9)
    assert line[-1]["omega"] == pytest.approx(1.50929, abs=1e-5)
    assert len(met(1.5105)) == 1
    assert not met(1.5085)


def test_a_curve_of_collisions_turns_back_where_three_pairs_meet() -> None:
    """A cusp, with those of one of the two pairs and the third beyond: by another branch."""
    chain = cb.Oscillators(
        "u**2/2 + u**6/6", "c*(r**2/2 - r**3/5)", cb.OpenChain(4), masses=[1.48, 0.68, 1.36, 0.62]
    )
    b = cb.breather(chain, {0: 1, 1: -1, 2: -1, 3: -1}, omega=1.353, params={"c": 0.0819})
    branch = cb.trace(b, "omega", within={"omega": (1.3, 1.57)}, towards="both")
    first, second, beside_fold = (point for point in branch.special if point.kind == "KC")
    assert beside_fold["omega"] - branch.first("LP")["omega"] == pytest.approx(2.03e-5, rel=1e-3)
    line = cb.boundary(first, ("c", "omega"), within={"c": (0, 0.0819)}, towards="down")
    assert [point.kind for point in line.special] == ["EP", "CP", "EP"]
    assert line[-1]["omega"] == pytest.approx(second["omega"], abs=1e-8)
    indices = line.first("CP").solution.indices
    assert abs(indices - indices.mean()).max() < 1e-3


@pytest.mark.parametrize("kind", ["PF", "PD", "LP", "KC"])
def test_curves_are_the_same_where_nothing_is_eliminated(kind: str) -> None:
    """The equations of lattices of many sites, on one of few."""
    make, free, window, other, around, *_ = CASES["PD" if kind == "KC" else kind]
    few = make()
    half, middle = few.residual, few.params[other]
    of = half.flows, half.start, half.period, half.turns, half.states, half.sizes
    many = BreatherProblem.of(SparseHalfOrbit(*of), few.params, few.events, "")
    ends = []
    for problem in (few, many.solve(tolerance=1e-12)[0]):
        own = [event for event in problem.events if event.kind == kind]
        branch = cb.trace(problem, free, within={free: window}, towards="up", events=own)
        aside = {other: (middle, 0.5 * (middle + around[1]))}
        line = cb.boundary(branch.first(kind), (other, free), within=aside, events=())
        ends.append([line[free][0], line[free][-1], line[other][-1]])
    np.testing.assert_allclose(*ends, atol=2e-8)


def test_of_orbits_that_are_not_taken_as_half_pd_is_switched_at_as_well() -> None:
    """The same orbit as the whole of itself doubles into the same family."""
    start = CASES["PD"][0]()
    whole = whole_orbit(start.residual, start.solution.flights, start.params)
    same = BreatherProblem.of(whole, start.params, events_of_cycle(whole), "").solve()[0]
    ends = []
    for problem in (start, same):
        point = cb.trace(problem, "omega", within={"omega": (1.95, 2.03)}, towards="up").first("PD")
        (arm,) = cb.switch(point, within={"omega": (1.005, 1.02)}, events=())
        assert arm[0]["omega"] == pytest.approx(point["omega"] / 2, abs=1e-8)
        ends.append([arm[-1][name] for name in ("omega", "energy", "max|u|")])
    np.testing.assert_allclose(*ends, atol=1e-6)


def test_curves_of_kc_keep_to_their_own_two_pairs() -> None:
    """Next to others that are closer to each other than these two a step to the side."""
    bonds = np.eye(10)[1:] - np.eye(10)[:-1]
    stiffness = bonds.T @ np.diag([0.5, 1.0] * 4 + [0.5]) @ bonds
    lattice = cb.Lattice(stiffness, masses=[1.6, 1.0] * 5)
    potentials = {"V": "u**2/2 + u**4/4 - u**3/5", "W": "c*r**2/2 + 0.02*r**4/4"}
    chain = cb.Oscillators(**potentials, lattice=lattice)
    start = cb.breather(chain, {4: 1, 5: 1}, omega=1.688, params={"c": 0.22})
    branch = cb.trace(start, "c", within={"c": (0.22, 0.24)}, towards="up")
    within = {"c": (0.23, 0.24), "omega": (1.6, 1.75)}
    curve = cb.boundary(branch.first("KC"), ("c", "omega"), within=within)
    assert [point.kind for point in curve.special] == ["EP", "EP"]
    for point in (curve[0], curve[-1]):
        orbit = point.solution
        x = np.append([orbit.displacement(n, 0.0) for n in range(10)], np.zeros(10))
        steps, period = 1e-5 * np.eye(20), 2 * np.pi / point["omega"]
        ends = [chain.run((0, period), x + s, point.params).y[:, -1] for s in (*steps, *-steps)]
        mu = np.linalg.eigvals((np.array(ends[:20]) - ends[20:]).T / 2e-5)
        meeting = np.sort(abs(mu - np.exp(1j * point["angle"])))
        assert meeting[1] < 1e-4 < 1e-2 < meeting[2]


def test_folds_in_the_energy_go_on_past_the_largest_coupling() -> None:
    """There branches fold at a given frequency, too; an integrated half has a second index 1 on
    either side."""
    star = cb.Lattice.from_graph(nx.star_graph(3))
    chain = cb.Oscillators(V="(1 - exp(-u))**2/2", W="c*r**2/2", lattice=star)
    pair = cb.breather(chain, {0: 1, 2: 1}, omega=0.77, params={"c": 0.02})
    turn = cb.trace(pair, "c", within={"c": (0.02, 0.1)}).first("LP")
    assert turn.detail["said"] == "a fold in the energy, not in the period"
    curve = cb.boundary(turn, ("c", "omega"), within={"omega": (0.76, 0.84)})
    assert sorted(point["omega"] for point in curve.special) == pytest.approx([0.76, 0.84])
    for point in curve.special:
        u, time = point.solution.state()[0], np.pi / point["omega"]
        end, blocks = half_map(MORSE, stiffness(star), point["c"], u, time)
        assert abs(end[4:]).max() < 1e-9
        off = np.linalg.eigvals(blocks["uv"].T @ blocks["vu"])
        assert np.sort(abs(off))[1] < 1e-6  # its own velocity has the first
