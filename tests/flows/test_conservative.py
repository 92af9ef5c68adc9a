"""Families of conservative flows: elliptic functions, symmetries, an independent integration."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

import contbreather as cb
from contbreather.continuation.curve.curve import Curve
from contbreather.continuation.curve.point import Point
from contbreather.flows import cycle_of
from contbreather.flows.conservation import indices_of
from contbreather.flows.conservative_events import signatures
from contbreather.flows.rounds import twice

from .test_cycle import variational


def duffing(t, x, p):
    return [x[1], -x[0] - p["b"] * x[0] ** 3]


def of_duffing(x, p):
    return x[1] ** 2 / 2 + x[0] ** 2 / 2 + p["b"] * x[0] ** 4 / 4


def duffing_period(size, b=1.0):
    """4 K(m) / w with w^2 = 1 + b A^2 and m = b A^2 / (2 w^2)."""
    square = 1 + b * size**2
    return 4 * ellipk(b * size**2 / (2 * square)) / np.sqrt(square)


@pytest.mark.slow
def test_a_family_in_the_period_ends_where_it_is_homoclinic_as_one_in_the_energy() -> None:
    """The pendulum upside down has twice its largest potential energy."""
    field, energy = lambda t, x, p: [x[1], -np.sin(x[0])], lambda x, p: x[1] ** 2 / 2 - np.cos(x[0])
    pendulum = cb.cycle(field, {"u": 1.0, "v": 0.0}, {}, conserves=energy)
    for free, window in (("period", (6.3, 300.0)), ("energy", (-0.9, 2.0))):
        end = cb.trace(pendulum, free, within={free: window}).first("HOM")
        assert end["energy"] == pytest.approx(1.0, abs=1e-4)
        assert "heteroclinic cycle" in end.detail["said"]


def backbone(**how):
    how = {"conserves": of_duffing} | how
    return cb.cycle(duffing, {"u": 1.0, "v": 0.0}, {"b": 1.0}, **how)


# --- families -----------------------------------------------------------------------------------


def test_a_response_without_damping_is_traced_to_where_nothing_forces_it() -> None:
    def forced(t, x, p):
        return [x[1], -x[0] - x[0] ** 3 + p["F"] * np.cos(2 * t)]

    start = cb.cycle(forced, {"u": 2.2, "v": 0.0}, {"F": 0.3}, period=np.pi)
    branch = cb.trace(start, "F", within={"F": (0, 1)})
    assert (branch[0]["F"], branch.began.name) == (0.0, "BOUND")
    assert duffing_period(branch[0]["max(u)"]) == pytest.approx(np.pi, rel=1e-9)


@pytest.mark.slow
def test_the_backbone_of_duffing_is_that_of_elliptic_functions() -> None:
    """In its period, in its energy, and in a parameter at a given period or energy."""
    walks = {
        "period": (backbone(period=4.74555), (4.5, 6.1)),
        "energy": (backbone(), (1e-4, 1.0)),
        "b": (backbone(fixed="energy"), (-0.2, 1.2)),
    }
    for free, (start, window) in walks.items():
        branch = cb.trace(start, free, within={free: window})
        b = branch["b"] if free == "b" else 1.0
        size = branch["max(u)"]
        np.testing.assert_allclose(branch["period"], duffing_period(size, b), atol=1e-9)
        if free != "b":
            energy = size**2 / 2 + b * size**4 / 4
            np.testing.assert_allclose(branch["energy"], energy, rtol=1e-9, atol=1e-12)
        assert abs(branch["lambda"]).max() < 1e-10
        assert not branch["unstable"].any()
        assert not branch.doubtful
    assert np.ptp(branch["energy"]) == 0
    at_period = cb.trace(walks["period"][0], "b", within={"b": (0.8, 1.2)}, events=())
    assert np.ptp(at_period["period"]) == 0
    np.testing.assert_allclose(
        duffing_period(at_period["max(u)"], at_period["b"]), 4.74555, atol=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-12, 1e9])
def test_a_family_takes_the_same_steps_whatever_the_unit_of_its_energy(unit: float) -> None:
    walks = []
    for size in (1.0, unit):
        swing = backbone(
            conserves=lambda x, p, e=size: e * of_duffing(x, p), scales={"energy": size}
        )
        walks.append(cb.trace(swing, "energy", within={"energy": (0.01 * size, 5 * size)}))
    plain, family = walks
    assert abs(len(family) - len(plain)) <= 2
    assert family["period"] == pytest.approx(duffing_period(family["max(u)"]), rel=1e-8)


@pytest.mark.slow
def test_a_family_may_have_small_states_and_an_energy_that_is_their_square() -> None:
    """As in metres and joules: its lambda, in units of one over the energy, hid all else."""
    walks = []
    for a in (1.0, 1e-6):
        swing = cb.cycle(
            lambda t, x, p, a=a: [x[1], -x[0] - p["b"] * x[0] * (x[0] / a) ** 2],
            {"u": a, "v": 0.0}, {"b": 1.0}, scales={"u": a, "v": a, "energy": a**2},
            conserves=lambda x, p, a=a: a**2 * of_duffing(x / a, p),
        )  # fmt: skip
        walks.append(cb.trace(swing, "energy", within={"energy": (0.01 * a**2, 5 * a**2)}))
    plain, family = walks
    assert abs(len(family) - len(plain)) <= 2
    assert family[-1]["period"] == pytest.approx(plain[-1]["period"], rel=1e-10)


@pytest.mark.slow
def test_a_family_that_cannot_be_walked_in_its_unit_is_given_no_advice_that_is_refused() -> None:
    branch = cb.trace(backbone(conserves=lambda x, p: 1e-12 * of_duffing(x, p)), "energy")
    assert "lambda" not in branch.reason


@pytest.mark.slow
def test_the_pendulum_is_that_of_elliptic_functions_up_to_its_separatrix() -> None:
    """T = 4 K(sin^2(A / 2)), E = 1 - cos A."""
    swing = cb.cycle(
        lambda t, x, p: [x[1], -np.sin(x[0])], {"u": 2.0, "v": 0.0}, {},
        conserves=lambda x, p: x[1] ** 2 / 2 + 1 - np.cos(x[0]),
    )  # fmt: skip
    branch = cb.trace(swing, "period", within={"period": (6.4, 20.0)}, events=())
    wanted = 4 * ellipk(np.sin(branch["max(u)"] / 2) ** 2)
    np.testing.assert_allclose(branch["period"], wanted, atol=2e-8)  # 1e-9 of the amplitude
    np.testing.assert_allclose(4 * ellipk(branch["energy"] / 2), branch["period"], atol=1e-9)


def test_a_period_that_no_orbit_nearby_has_is_refused() -> None:
    with pytest.raises(cb.NotConverged, match=r'none of period 9 was found: .* in "period"'):
        backbone(period=9.0)


# --- several quantities -------------------------------------------------------------------------


@pytest.mark.slow
def test_a_straight_orbit_of_an_isotropic_oscillator_is_isolated_among_its_rotations() -> None:
    def f(t, x, p):
        square = 1 + p["b"] * (x[0] ** 2 + x[1] ** 2)
        return [x[2], x[3], -x[0] * square, -x[1] * square]

    def energy(x, p):
        square = x[0] ** 2 + x[1] ** 2
        return (x[2] ** 2 + x[3] ** 2 + square) / 2 + p["b"] * square**2 / 4

    start = {"x": 0.6, "y": 0.8, "vx": 0.0, "vy": 0.0}
    both = {"energy": energy, "spin": lambda x, p: x[0] * x[3] - x[1] * x[2]}
    branch = cb.trace(cb.cycle(f, start, {"b": 1.0}, conserves=both),
                      "period", within={"period": (4.5, 5.5)}, events=())  # fmt: skip
    size = np.hypot(branch["max(x)"], branch["max(y)"])
    np.testing.assert_allclose(branch["period"], duffing_period(size), atol=1e-8)
    assert abs(branch["spin"]).max() < 1e-12
    np.testing.assert_allclose(branch["max(y)"] / branch["max(x)"], 4 / 3, rtol=1e-9)
    np.testing.assert_allclose(branch[-1].solution.multipliers, np.ones(4), atol=1e-9)


# --- multipliers, and events --------------------------------------------------------------------


def henon_heiles(t, z, p):
    """In a magnetic field e, which does no work."""
    x, y, u, v = z
    return [u, v, -x - 2 * x * y + p["e"] * v, -y - x**2 + y**2 - p["e"] * u]


def of_henon_heiles(z, p):
    x, y, u, v = z
    return (u**2 + v**2 + x**2 + y**2) / 2 + x**2 * y - y**3 / 3


def along_the_axis(**how):
    start = {"x": 0.0, "y": 0.3, "u": 0.0, "v": 0.0}
    return cb.cycle(henon_heiles, start, {"e": 0.0}, conserves=of_henon_heiles, **how)


def index_of_axis(energy):
    """Half the trace of Hill's equation beside the orbit x = 0, by DOP853."""

    def f(t, z):
        y, v, *beside = z
        return [v, -y + y**2, *beside[2:], *(-(1 + 2 * y) * np.array(beside[:2]))]

    z = [0.0, np.sqrt(2 * energy), 1.0, 0.0, 0.0, 1.0]
    for direction in (-1.0, 1.0):  # y falls through 0, and rises again

        def back(t, z):
            return z[0]

        back.terminal, back.direction = True, direction
        z = solve_ivp(f, (0, 99), z, "DOP853", events=back, rtol=1e-13, atol=1e-15).y[:, -1]
    return (z[2] + z[5]) / 2


@pytest.fixture(scope="module")
def axis():
    return cb.trace(along_the_axis(), "energy", within={"energy": (0.02, 0.1666)})


@pytest.fixture(scope="module")
def loops(axis: cb.Branch) -> list[cb.Branch]:
    """The families off the axis, from its first branch point on."""
    return cb.switch(axis.first("BP"), within={"energy": (0.1, 0.164)})


def test_multipliers_are_pairs_and_two_are_1(axis: cb.Branch) -> None:
    for point in axis[::8]:
        orbit = point.solution
        assert np.prod(orbit.others) == pytest.approx(1, abs=1e-10)
        wanted = variational(henon_heiles, orbit)
        assert np.sort(abs(wanted - 1))[:2].max() < 1e-3  # a double value, to its root
        assert sum(orbit.multipliers) == pytest.approx(sum(wanted), abs=1e-8)
        assert abs(np.sort(abs(orbit.multipliers - 1))[:2]).max() < 1e-9
        index = index_of_axis(point["energy"])
        assert orbit.indices[0] == pytest.approx(index, abs=1e-8)
        assert orbit.unstable == (abs(index) > 1)


@pytest.mark.slow
def test_the_axis_of_henon_heiles_bifurcates_where_hills_equation_says(axis: cb.Branch) -> None:
    """And where M. Brack says (Found. Phys. 31, 209, 2001): 6 E = 0.969309, 0.986709, 0.999188."""
    kinds = [point.kind for point in axis.special]
    assert kinds == ["EP", "PD", "PD", "BP", "BP", "PD", "PD", "BP", "EP"]
    assert not axis.doubtful
    for point in axis.special[1:-1]:
        place, energy = -1.0 if point.kind == "PD" else 1.0, point["energy"]
        beside = 1e-4 * (1 / 6 - energy)
        own = brentq(lambda e, place=place: index_of_axis(e) - place,
                     energy - beside, energy + beside, xtol=1e-15)  # fmt: skip
        assert energy == pytest.approx(own, abs=1e-10)
    crossings = [6 * point["energy"] for point in axis.special if point.kind == "BP"]
    np.testing.assert_allclose(crossings, [0.969309, 0.986709, 0.999188], atol=6e-7)


@pytest.mark.slow
def test_other_families_leave_at_pd_and_at_bp(axis: cb.Branch, loops: list[cb.Branch]) -> None:
    (double,) = cb.switch(axis.first("PD"), within={"energy": (0.1, 0.15)}, events=())
    assert double[0]["period"] == pytest.approx(2 * axis.first("PD")["period"], abs=1e-8)
    assert len(loops) == 2
    for arm in (double, *loops):
        orbit = arm[-1].solution
        start = orbit.states(orbit.times[0])
        assert np.ptp(orbit.states(np.linspace(0, orbit.period, 50))[0]) > 0.01  # off the axis
        for part in (0.5, 1.0):
            span = (0, part * orbit.period)
            end = solve_ivp(lambda t, z: henon_heiles(t, z, {"e": 0.0}), span, start, "DOP853",
                            rtol=1e-13, atol=1e-14).y[:, -1]  # fmt: skip
            assert (abs(end - start).max() < 1e-9) == (part == 1.0)
        assert orbit.unstable == 0  # both are born stable, and on one side only
        assert not (np.diff(arm["energy"]) <= 0).any()
    window = {"period": (1.5 * double[0]["period"] / 2, 3 * double[0]["period"])}
    walk = cb.trace(along_the_axis(), "period", within={"period": (6.4, 8.0)})
    (again,) = cb.switch(walk.first("PD"), within=window, steps=cb.Steps(most=1), events=())
    assert again[0]["period"] == pytest.approx(double[0]["period"], abs=1e-8)


@pytest.mark.slow
def test_a_fold_in_the_energy_is_found_on_a_family_in_the_period_too(loops) -> None:
    """A magnetic field parts the branches that time reversal held together; the fold between them
    has one curve, whether the energy is given or the period."""
    both = cb.trace(loops[0][-1], "e", within={"e": (-0.002, 0.002)})
    walks = [cb.trace(both[i], "energy", within={"energy": (0.161, 0.1645)}) for i in (0, -1)]
    ((in_energy, aside),) = [
        (walk, both[i])
        for walk, i in zip(walks, (0, -1), strict=True)
        if any(point.kind == "LP" for point in walk.special)
    ]
    in_period = cb.trace(aside, "period", within={"period": (9.56, 9.9)})
    fold, turn = in_energy.first("LP"), in_period.first("LP")
    assert "said" not in fold.detail
    assert turn.detail["said"] == "a fold in the energy, not in the period"
    assert turn["energy"] == pytest.approx(fold["energy"], abs=1e-11)
    assert len({*in_period["unstable"]}) == 2
    window = tuple(sorted((0.9 * aside["e"], 1.1 * aside["e"])))
    ends = [
        cb.boundary(point, pair, within={"e": window}, events=())[0]
        for point, pair in ((fold, ("e", "energy")), (turn, ("e", "period")))
    ]
    assert ends[0]["energy"] == pytest.approx(ends[1]["energy"], abs=1e-9)
    assert ends[0]["period"] == pytest.approx(ends[1]["period"], abs=1e-7)


def modes(sign: float, firsts: tuple[float, ...] = (1.7,), **params: float) -> cb.Problem:
    """A Duffing oscillator, and beside it pairs of oscillators of which one has an energy below
    zero: those hang together by e."""
    first, second, m = np.array(firsts), {"w": 1.5, "e": 0.1} | params, len(firsts)

    def parts(x):
        q, x = (x[0], x[1 + 2 * m]), np.delete(np.asarray(x), [0, 1 + 2 * m], axis=0)
        own = first.reshape(-1, *[1] * (x.ndim - 1))
        return *q, own, *x.reshape(4, m, *x.shape[1:])

    def f(t, x, p):
        q, r, first, a, b, s, u = parts(x)
        rates = [first * s, -sign * p["w"] * u, -first * a - p["e"] * b,
                 sign * p["w"] * b - p["e"] * a]  # fmt: skip
        return np.concatenate([[r], *rates[:2], [-q - q**3], *rates[2:]])

    def energy(x, p):
        q, r, first, a, b, s, u = parts(x)
        own = first * (a**2 + s**2) / 2 - sign * p["w"] * (b**2 + u**2) / 2 + p["e"] * a * b
        return r**2 / 2 + q**2 / 2 + q**4 / 4 + own.sum(axis=0)

    start = {f"x{i}": float(i == 0) for i in range(2 + 4 * m)}
    return cb.cycle(f, start, second, conserves=energy, fixed="energy")


@pytest.mark.slow
def test_pairs_of_opposite_signature_collide_where_the_closed_form_says() -> None:
    """|w1^2 - w^2| = 2 e sqrt(w1 w), where both frequencies are one; and its curve in w and e."""
    branch = cb.trace(modes(1.0), "w", within={"w": (1.5, 1.9)})
    assert [point.kind for point in branch.special] == ["EP", "KC", "KC", "EP"]
    assert not branch.doubtful

    def off(w, e):
        return abs(1.7**2 - w**2) - 2 * e * np.sqrt(1.7 * w)

    for point in branch.special[1:-1]:
        assert abs(off(point["w"], 0.1)) < 1e-10
        assert point.detail["signatures"] == "+ -"
        middle = np.sqrt((1.7**2 + point["w"] ** 2) / 2) * point["period"]
        assert np.cos(point.detail["angle"]) == pytest.approx(np.cos(middle), abs=1e-8)
    for point in branch:
        if abs(off(point["w"], 0.1)) > 1e-6:
            assert point["unstable"] == 2 * (off(point["w"], 0.1) < 0)
    line = cb.boundary(branch.first("KC"), ("e", "w"), within={"e": (0.08, 0.12)})
    assert line["e"].min() == 0.08
    assert abs(off(line["w"], line["e"])).max() < 1e-10


@pytest.mark.parametrize(("apart", "left"), [(0.1, 0), (1e-7, 2)])
def test_pairs_leave_the_circle_in_twos_not_each_by_its_own_rounding(apart, left) -> None:
    """As of a halo orbit that all but hits the moon, whose multipliers are 1e-7 off."""
    upper = np.exp(1j * np.array([1.56, 1.56 + apart])) * (1 + np.array([1e-7, -1e-7]))
    indices = indices_of(np.concatenate([upper, upper.conj()]))
    assert np.count_nonzero(indices.imag) == left


@pytest.mark.slow
def test_tongues_narrower_than_a_step_have_both_their_ends() -> None:
    """Pairs of opposite signature that come past each other collide twice in between, however
    weakly they are coupled."""
    firsts, e = (1.68, 1.7), 1e-3
    start = modes(1.0, firsts, e=e, w=1.65)
    branch = cb.trace(start, "w", within={"w": (1.65, 1.75)}, towards="up")
    assert not branch.doubtful
    assert [point.kind for point in branch.special] == ["EP", *4 * ["KC"], "EP"]
    for first, point in zip(np.repeat(firsts, 2), branch.special[1:-1], strict=True):
        w = point["w"]
        assert abs(first**2 - w**2) == pytest.approx(2 * e * np.sqrt(first * w), abs=1e-10)


@pytest.mark.slow
def test_several_collisions_within_a_step_are_all_found() -> None:
    """Three pairs of pairs leave the circle one after the other: the test changes its sign once."""
    firsts = 1.7, 1.704, 1.71
    branch = cb.trace(modes(1.0, firsts, w=1.58), "w", within={"w": (1.58, 1.63)}, towards="up")
    assert [point.kind for point in branch.special] == ["EP", "KC", "KC", "KC", "EP"]
    for first, point in zip(firsts, branch.special[1:-1], strict=True):
        w = point["w"]
        assert abs(first**2 - w**2) == pytest.approx(2 * 0.1 * np.sqrt(first * w), abs=1e-10)


@pytest.mark.slow
def test_several_doublings_within_a_step_are_all_found() -> None:
    """A Duffing oscillator drives three modes b'' = -(w^2 d + e q) b, each by itself: what one does
    at w another one does where w^2 d is the same."""
    d = np.array([1.0, 1.01, 1.02])

    def parts(x, p):
        (q, r), x = (x[0], x[4]), np.delete(np.asarray(x), [0, 4], axis=0)
        return q, r, p["w"] ** 2 * d.reshape(-1, *[1] * (x.ndim - 1)) + p["e"] * q, x[:3], x[3:]

    def f(t, x, p):
        q, r, pull, b, s = parts(x, p)
        return np.concatenate([[r], s, [-q - q**3 - p["e"] * (b**2).sum(axis=0) / 2], -pull * b])

    def energy(x, p):
        q, r, pull, b, s = parts(x, p)
        return r**2 / 2 + q**2 / 2 + q**4 / 4 + ((s**2 + pull * b**2) / 2).sum(axis=0)

    start = {f"x{i}": float(i == 0) for i in range(8)}
    problem = cb.cycle(f, start, {"w": 0.5, "e": 0.3}, conserves=energy, fixed="energy")
    branch = cb.trace(problem, "w", within={"w": (0.4, 0.8)})
    assert [point.kind for point in branch.special] == ["EP", *6 * ["PD"], "EP"]
    places = np.array([point["w"] for point in branch.special[1:-1]]).reshape(2, 3)
    np.testing.assert_allclose(np.ptp(places * np.sqrt(d[::-1]), axis=1), 0.0, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("sign", "e"), [(-1.0, 0.1), (1.0, 0.0)])
def test_pairs_of_equal_signature_and_those_that_do_not_hang_together_pass(sign, e) -> None:
    branch = cb.trace(modes(sign, e=e, w=1.65), "w", within={"w": (1.65, 1.75)})
    assert not branch["unstable"].any()
    assert [point.kind for point in (*branch.special, *branch.doubtful)] == ["EP", "EP"]


def three_bodies(t, s, p):
    x, y, z, u, v, w = s
    mass, first, second = p["mu"], x + p["mu"], x - 1 + p["mu"]
    r, q = ((near**2 + y**2 + z**2) ** 1.5 for near in (first, second))
    pull = (1 - mass) / r + mass / q
    return [u, v, w, 2 * v + x - (1 - mass) * first / r - mass * second / q,
            -2 * u + y - pull * y, -pull * z]  # fmt: skip


def of_three_bodies(s, p):
    """Minus half of Jacobi's constant."""
    x, y, z, u, v, w = s
    r, q = (np.sqrt((x + p["mu"] - at) ** 2 + y**2 + z**2) for at in (0, 1))
    return (u**2 + v**2 + w**2 - x**2 - y**2) / 2 - (1 - p["mu"]) / r - p["mu"] / q


def zigzag(n: int, W: Any, force: Any, u: float) -> Any:
    """A ring of masses with a potential of each bond, neighbours against each other."""

    def ring(t: Any, x: Any, p: Any) -> Any:
        pull = force(np.roll(x[:n], -1, 0) - x[:n])
        return np.concatenate([x[n:], pull - np.roll(pull, 1, 0)])

    def energy(x: Any, p: Any) -> Any:
        return (x[n:] ** 2 / 2 + W(np.roll(x[:n], -1, 0) - x[:n])).sum(0)

    start = {"u": u * (-1.0) ** np.arange(n), "v": np.zeros(n)}
    both = {"energy": energy, "momentum": lambda x, p: x[n:].sum(0)}
    return cb.cycle(ring, start, {"b": 1.0}, conserves=both)


@pytest.mark.slow
def test_pairs_of_waves_both_ways_around_a_ring_do_not_collide() -> None:
    """Of the zigzag of a ring of Fermi, Pasta, Ulam and Tsingou waves k and -k have one index and
    one signature all along: that of a field which no gradient tells along a shift of all sites was
    unknown, and rounding made a KC, and 22 in doubt, between their pairs."""
    start = zigzag(6, lambda r: r**2 / 2 + r**4 / 4, lambda r: r + r**3, 0.3)
    # more than half a turn a period
    assert set(signatures(cycle_of(start))[1]) == {-1.0}
    collision = [event for event in start.events if event.kind == "KC"]
    branch = cb.trace(start, "energy", within={"energy": (1.0, 3.5)}, events=collision)
    assert [point.kind for point in (*branch.special, *branch.doubtful)] == ["EP", "EP"]


@pytest.mark.slow
def test_how_a_field_is_differentiated_is_not_decided_by_a_step_that_is_refused() -> None:
    """Down to its equilibrium a step of Toda's ring overflows. Slopes were differences from then
    on, also from the start up, where the branch ended as MX."""
    toda = zigzag(4, lambda r: np.exp(r) - r, lambda r: np.exp(r) - 1, 0.3)
    branch = cb.trace(toda, "energy", within={"energy": (3.0, 4.8)}, events=[])
    assert [end.kind for end in (branch[0], branch[-1])] == ["EP", "EP"]
    assert branch["energy"].min() < 4.001


@pytest.mark.slow
def test_the_gradient_of_an_unfolding_is_not_differentiated_in_states() -> None:
    """It is asked for at two places for each state, and would be so once more for each."""
    asked = {"W": 0, "force": 0}

    def seen(name: str, values: Any) -> Any:
        asked[name] += values[0].size
        return values

    start = zigzag(
        4, lambda r: seen("W", r**2 / 2 + r**4 / 4), lambda r: seen("force", r + r**3), 0.3
    )
    asked.update(W=0, force=0)
    cb.trace(start, "energy", within={"energy": (0.8, 1.0)}, events=())
    assert 0 < asked["W"] < 8 * asked["force"]


@pytest.mark.slow
def test_halo_orbits_of_three_bodies_are_those_of_howell() -> None:
    """K. C. Howell, Celestial Mechanics 32, 53 (1984), at mu = 0.04: x, z, dy/dt and half a period
    of the first and of the third in her table, in which the last digit is rounded."""
    (x, z, v, half), last = (0.723268, 0.04, 0.198019, 1.300177), (0.7537, 0.267595, 0.399909)
    start = {"x": x, "y": 0.0, "z": z, "u": 0.0, "v": v, "w": 0.0}
    halo = cb.cycle(three_bodies, start, {"mu": 0.04}, conserves=of_three_bodies)
    assert halo.params["period"] / 2 == pytest.approx(half, abs=1e-6)
    energy = of_three_bodies((last[0], 0.0, last[1], 0.0, last[2], 0.0), {"mu": 0.04})
    window = {"energy": (-2, energy)}
    branch = cb.trace(halo, "energy", within=window, towards="up", events=())
    assert branch[-1]["energy"] == energy
    assert branch[-1]["period"] / 2 == pytest.approx(1.211253, abs=5e-6)  # digits of the start
    assert branch[-1]["max(z)"] == pytest.approx(last[1], abs=1e-6)
    assert abs(branch["lambda"]).max() < 1e-10
    for point in (branch[0], branch[-1]):
        assert np.prod(point.solution.others) == pytest.approx(1, abs=1e-9)


# --- refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "how"),
    [
        (r"energy is not conserved: it changes at the rate -?\d",
         {"conserves": lambda x, p: x[0] ** 2 + x[1] ** 2}),
        ("returns shape", {"conserves": lambda x, p: x}),
        (r"energy., of x and p, raises TypeError", {"conserves": lambda t, x, p: x[0]}),
        (r"conserves = {'energy': 3}: a function of .x, p.", {"conserves": {"energy": 3}}),
        ("fixed", {"fixed": "spin"}),
        ("positive time", {"period": lambda p: 6.0}),
    ],
)  # fmt: skip
def test_what_is_not_conserved_is_refused_with_a_sentence(words, how) -> None:
    with pytest.raises(cb.BadInput, match=words):
        backbone(**how)


def of_dimer(x: Any, p: Any) -> Any:
    """The energy of two sites of the discrete nonlinear Schroedinger equation."""
    return -(x[0] * x[1] + x[2] * x[3] + ((x[:2] ** 2 + x[2:] ** 2) ** 2).sum(0) / 4)


def dimer(start: tuple[float, ...], **conserves: Any) -> Any:
    def f(t: Any, x: Any, p: Any) -> Any:
        (a, b), size = (x[:2], x[2:]), x[:2] ** 2 + x[2:] ** 2
        return np.concatenate([-b[::-1] - size * b, a[::-1] + size * a])

    names = dict(zip(("a0", "a1", "b0", "b1"), start, strict=True))
    return cb.cycle(f, names, {"q": 1.0}, conserves={"energy": of_dimer, **conserves})


def test_a_wave_that_a_symmetry_only_shifts_along_itself_conserves_one_quantity() -> None:
    """Both sites alike, A exp(i (1 + A^2) t): a phase is a time. With the norm as well its
    multipliers were those of an equilibrium, or 1.03, without a word."""
    wave, norm = (0.6, 0.6, 0.0, 0.0), lambda x, p: (x**2).sum(0) / 2
    with pytest.raises(cb.BadInput, match=r"energy and norm have gradients .* give one of them"):
        dimer(wave, norm=norm)
    period, (index,) = 2 * np.pi / 1.36, cb.flows.cycle_of(dimer(wave)).indices
    assert index == pytest.approx(np.cos(2 * np.sqrt(1 - 0.36) * period), abs=1e-9)


def test_a_family_in_something_more_than_the_energy_is_refused_where_it_starts() -> None:
    """Its branch had one point, and MX, where the norm was not given; and it was said to be one of
    a family, as where energy is conserved, which was given."""
    with pytest.raises(cb.NotConverged, match="a second multiplier is 1: more is conserved"):
        dimer((2.0, 1.0, 0.0, 0.0))


def test_a_sum_of_states_that_is_conserved_is_said_and_held_by_its_total() -> None:
    """Newton's iteration went astray there, which was said to be for want of a better start."""

    def enzyme(t, x, p):
        a, b, free, bound = x
        taken, loop = 0.3 * free * a - 0.5 * bound, a * a * b
        held = p.get("total", free + bound) - free - bound
        return [1.0 - (p["B"] + 1) * a + loop, p["B"] * a - loop, held - taken, taken]

    start = {"a": 1.0, "b": 2.0, "free": 0.5, "bound": 0.5}
    with pytest.raises(cb.NotConverged, match=r"second multiplier is 1: it is.*\(total - it\)"):
        cb.cycle(enzyme, start, {"B": 2.5})
    (flight,) = cb.flows.cycle_of(cb.cycle(enzyme, start, {"B": 2.5, "total": 1.0})).flights
    assert flight.states[:, 2:].sum(axis=1) == pytest.approx(1.0, abs=1e-9)


def test_a_parameter_that_damps_is_not_traced() -> None:
    damped = cb.cycle(
        lambda t, x, p: [x[1], -x[0] - x[0] ** 3 - p["d"] * x[1]],
        {"u": 1.0, "v": 0.0}, {"d": 0.0, "b": 1.0}, conserves=of_duffing,
    )  # fmt: skip
    with pytest.raises(cb.BadInput, match="energy is not conserved where d moves"):
        cb.trace(damped, "d")
    with pytest.raises(cb.BadInput, match=r"rename .'lambda'"):
        cb.cycle(duffing, {"u": 1.0, "v": 0.0}, {"b": 1.0, "lambda": 1.0}, conserves=of_duffing)


@pytest.mark.slow
def test_a_family_that_grows_into_where_nothing_is_conserved_says_so() -> None:
    """From u = 1.2 on a friction sets in: the equations go on, as lambda feeds in what it takes."""

    def rubbing(t, x, p):
        aside = np.where(np.real(x[0]) > 1.2, x[0] - 1.2, 0.0)
        return [x[1], -x[0] - p["b"] * x[0] ** 3 - 0.1 * aside**2 * x[1]]

    start = cb.cycle(rubbing, {"u": 0.8, "v": 0.0}, {"b": 1.0}, conserves=of_duffing)
    branch = cb.trace(start, "energy", within={"energy": (0.4, 3)}, towards="up")
    (told,) = branch.doubtful
    assert "energy is not conserved: it changes at the rate" in told.detail["reason"]
    sound = branch["max(u)"] < 1.2
    assert abs(branch["lambda"][sound]).max() < 1e-11 < told["lambda"] < branch["lambda"][-1]
    assert 1.2 < told["max(u)"] < 1.3
    assert not cb.trace(start, "energy", within={"energy": (0.4, 1.2)}).doubtful


def test_an_orbit_of_a_family_that_goes_around_twice_is_also_one_of_half_the_period() -> None:
    """What is given of it, the period, is that of the single turn then."""
    problem = cb.cycle(duffing, {"u": 1.0, "v": 0.0}, {"b": 1.0}, conserves=of_duffing)
    double = problem.of_flows(twice(problem.residual, problem.x, problem.params), problem.params)
    curve = Curve(double, ("b",))
    single = double.simpler(Point(curve, curve.start)).solve()[0]
    assert double.params["period"] == pytest.approx(2 * problem.params["period"])
    assert single.params["period"] == pytest.approx(problem.params["period"])
    assert single.start["energy"] == pytest.approx(0.75)


def test_the_mode_of_a_double_pendulum_is_one_turn_of_the_nine_that_are_found() -> None:
    """Where two frequencies are as 4 to 9 motions return after nine turns of the mode, which a
    coarse mesh takes for unlike each other."""

    def energy(x, p):
        c = np.cos(x[0] - x[1])
        kinetic = (x[2] ** 2 + 2 * x[3] ** 2 - 2 * x[2] * x[3] * c) / (4 - 2 * c**2)
        return kinetic - 2 * np.cos(x[0]) - np.cos(x[1])

    def pendulum(t, x, p):
        c, s, (u, v) = np.cos(x[0] - x[1]), np.sin(x[0] - x[1]), x[2:]
        square = 2 - c**2
        pull = s * (u * v * square - c * (u**2 + 2 * v**2 - 2 * u * v * c)) / square**2
        falls = [-2 * np.sin(x[0]) - pull, pull - np.sin(x[1])]
        return [(u - v * c) / square, (2 * v - u * c) / square, *falls]

    start = {"a": 0.2, "b": -0.2 * np.sqrt(2), "u": 0.0, "v": 0.0}
    mode = cb.cycle(pendulum, start, {}, conserves=energy)
    assert mode.params["period"] == pytest.approx(32.7488983414 / 9, abs=1e-9)


def test_a_mode_with_a_node_is_followed() -> None:
    """Three masses between walls, the middle one at rest but for rounding, by which no step can be
    measured: each other one is a Duffing oscillator u'' = -2 u - 2 u^3."""

    def chain(t: Any, x: Any, p: Any) -> Any:
        a, b, c, u, v, w = x
        force = [r + p["hard"] * r**3 for r in (a, b - a, c - b, -c)]
        return [u, v, w, *(behind - before for before, behind in itertools.pairwise(force))]

    def energy(x: Any, p: Any) -> Any:
        bonds = (x[0], x[1] - x[0], x[2] - x[1], x[2])
        return (x[3:] ** 2).sum(0) / 2 + sum(r**2 / 2 + p["hard"] * r**4 / 4 for r in bonds)

    start = {"a": 0.3, "b": 3e-17, "c": -0.3, "u": 0.0, "v": 0.0, "w": 0.0}
    mode = cb.cycle(chain, start, {"hard": 1.0}, conserves=energy)
    end = cb.trace(mode, "energy", within={"energy": (0.1, 0.3)}, towards="up", events=())[-1]
    square = np.sqrt(1.3) - 1  # of the amplitude: the energy is 2 A^2 + A^4
    k = square / (2 * (1 + square))
    assert end["energy"] == pytest.approx(0.3, abs=1e-12)
    assert end["period"] == pytest.approx(4 * ellipk(k) / np.sqrt(2 * (1 + square)), rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("u", [0.3, 0.6, 0.9])
def test_a_pair_that_touches_minus_one_with_two_eigenvectors_is_no_period_doubling(u) -> None:
    """That of a linear oscillator beside another one, w T / 2 around the circle."""

    def beside(t, x, p):
        return [x[2], x[3], -x[0] - x[0] ** 3, -(p["w"] ** 2) * x[1]]

    def energy(x, p):
        return (x[2] ** 2 + x[3] ** 2 + x[0] ** 2 + x[0] ** 4 / 2 + (p["w"] * x[1]) ** 2) / 2

    start = {"u": u, "y": 0.0, "v": 0.0, "s": 0.0}
    family = cb.cycle(beside, start, {"w": 0.57}, conserves=energy, fixed="energy")
    branch = cb.trace(family, "w", within={"w": (0.4, 1.9)})
    turns = branch["w"] * branch["period"] / np.pi
    assert turns.min() < 1 < 3 < turns.max()
    assert not [at for at in [*branch.special, *branch.doubtful] if at.kind == "PD"]
    assert [at.kind for at in branch.special] == ["EP", "EP"]


@pytest.mark.slow
def test_multipliers_may_be_larger_than_rounding_is_small() -> None:
    """Beside x'' = -x^3 another state runs away as exp(k t): its multiplier is 5e38 in the end."""

    def quantity(x, p):
        return (x[2] ** 2 + x[3] ** 2 - (p["k"] * x[1]) ** 2) / 2 + x[0] ** 4 / 4

    def flow(t, x, p):
        return [x[2], x[3], -(x[0] ** 3), p["k"] ** 2 * x[1]]

    start = {"x": 1.0, "y": 0.0, "u": 0.0, "v": 0.0}
    branch = cb.trace(
        cb.cycle(flow, start, {"k": 1.0}, conserves=quantity), "k", within={"k": (1, 12)}
    )
    assert [point.kind for point in branch.special] == ["EP", "EP"]
    assert branch[-1]["k"] == 12
    assert not branch.doubtful


@pytest.mark.slow
def test_curves_of_pd_of_two_modes_cross_where_these_are_alike() -> None:
    """Of two modes beside an orbit one has the frequency w: that of the other does not see it, and
    both pass -1 together at w = 0.6."""

    def field(t, x, p):
        q, y, z, *v = x
        springs = 0.36 + 0.1 * q, p["w"] ** 2 + 0.1 * q
        return [*v, -q - q**3 - 0.05 * (y**2 + z**2), -springs[0] * y, -springs[1] * z]

    def energy(x, p):
        q, y, z, *v = x
        beside = (0.36 + 0.1 * q) * y**2 + (p["w"] ** 2 + 0.1 * q) * z**2
        return (sum(s**2 for s in v) + q**2 + q**4 / 2 + beside) / 2

    start = {"q": 0.7} | dict.fromkeys(("y", "z", "vq", "vy", "vz"), 0.0)
    orbit = cb.cycle(field, start, {"w": 0.61}, period=5.3, conserves=energy)
    branch = cb.trace(orbit, "period", within={"period": (5.3, 5.6)}, towards="both")
    own, other = (point for point in branch.special if point.kind == "PD")
    line = cb.boundary(own, ("w", "period"), within={"w": (0.59, 0.61)}, towards="down")
    assert line[-1]["w"] == 0.59
    assert line[-1]["period"] > other["period"] > own["period"]
    (cross,) = line.doubtful
    assert (cross["w"], cross["period"]) == pytest.approx((0.6, other["period"]), abs=1e-8)


@pytest.mark.slow
def test_a_pair_that_touches_minus_one_by_a_symmetry_is_no_period_doubling_of_a_mesh() -> None:
    """Half of a double pendulum's swing is the other half's mirror image: indices (of the whole)
    are squares minus 1, and the mesh leaves 1e-5 between the two eigenvectors."""

    def double(t, x, p):
        a, b, v, w = x
        c, s = np.cos(a - b), np.sin(a - b)
        down = -2 * p["g"] * np.sin(a) - s * w**2, s * v**2 - p["g"] * np.sin(b)
        rates = [down[0] - c * down[1], 2 * down[1] - c * down[0]]
        return [v, w, *(rate / (2 - c**2) for rate in rates)]

    def energy(x, p):
        a, b, v, w = x
        return v**2 + w**2 / 2 + v * w * np.cos(a - b) - p["g"] * (2 * np.cos(a) + np.cos(b))

    start = {"a": 0.1, "b": -0.1414, "v": 0.0, "w": 0.0}
    swing = cb.cycle(double, start, {"g": 1.0}, conserves=energy)
    branch = cb.trace(swing, "energy", within={"energy": (-2.999, -0.8)})

    def trace_of_half(point):
        def ends(k, off):
            x, span = point.solution.states(0.0), (0, point["period"] / 2)
            x[k] += off
            run = solve_ivp(double, span, x, "DOP853", args=({"g": 1.0},), rtol=1e-12, atol=1e-12)
            return run.y[k, -1]

        return sum(ends(k, 1e-4) - ends(k, -1e-4) for k in range(4)) / 2e-4

    # -2 where its pair is at ±i, beside two that are -1
    traces = [trace_of_half(point) for point in branch[:: len(branch) // 8]]
    assert min(traces) < -2 < max(traces)
    assert not [at for at in [*branch.special, *branch.doubtful] if at.kind == "PD"]


@pytest.mark.slow
def test_rotations_are_a_family_and_their_period_doubles() -> None:
    """Of a pendulum over the top, T = 2 m K(m**2) with m**2 = 2 / (1 + E); what is at rest beside
    it obeys Hill's equation."""

    def beside(t, x, p):
        th, y, v, w = x
        pull = 2 * p["c"] * y
        return [v, w, (pull * y / 2 - 1) * np.sin(th), -y - pull * np.cos(th)]

    def energy(x, p):
        th, y, v, w = x
        return (v**2 + w**2 + y**2) / 2 + (p["c"] * y**2 - 1) * np.cos(th)

    def period(e):
        return 2 * np.sqrt(2 / (1 + e)) * ellipk(2 / (1 + e))

    def trace(e):
        def hill(t, z):
            return [z[1], -np.sin(z[0]), *z[4:], *(-(1 + 0.4 * np.cos(z[0])) * z[2:4])]

        start = [0.0, np.sqrt(2 * (1 + e)), 1.0, 0.0, 0.0, 1.0]
        end = solve_ivp(hill, (0, period(e)), start, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        return end[2] + end[5]

    start = {"th": 0.0, "y": 0.0, "v": 2.2, "w": 0.0}
    over = cb.cycle(beside, start, {"c": 0.2}, conserves=energy, wraps={"th": 2 * np.pi})
    branch = cb.trace(over, "energy", within={"energy": (1.3, 2.0)})
    np.testing.assert_allclose(branch["period"], period(branch["energy"]), rtol=1e-10)
    doubling = branch.first("PD")
    assert doubling["energy"] == pytest.approx(brentq(lambda e: trace(e) + 2, 1.6, 1.9), abs=1e-8)
    (arm,) = cb.switch(doubling, steps=cb.Steps(most=6))
    orbit = arm[-1].solution
    run = solve_ivp(beside, (0, orbit.period), orbit.states(0.0), "DOP853", args=({"c": 0.2},),
                    rtol=1e-12, atol=1e-12)  # fmt: skip
    moved = run.y[:, -1] - run.y[:, 0]
    np.testing.assert_allclose(moved, [4 * np.pi, 0.0, 0.0, 0.0], atol=1e-8)
    assert arm[-1]["max(y)"] > 0.1


@pytest.mark.slow
def test_a_family_in_the_energy_is_loaded_with_the_cycle_it_was_traced_from(tmp_path) -> None:
    swing = cb.cycle(duffing, {"u": 1.0, "v": 0.0}, {"b": 1.0}, conserves=of_duffing)
    branch = cb.trace(swing, "energy", within={"energy": (0.5, 2)})
    cb.save(tmp_path / "swing.nc", branch)
    again = cb.load(tmp_path / "swing.nc", problem=swing)
    loaded, walked = (at[3].solution.states(0.1) for at in (again, branch))
    np.testing.assert_allclose(loaded, walked, rtol=1e-12)
    further = cb.extend(again, end="last", within={"energy": (0.5, 3)})
    assert {round(point["energy"], 9) for point in further.special} == {0.5, 3.0}


@pytest.mark.slow
def test_a_curve_in_the_energy_is_loaded_with_the_cycle_its_family_began_from(tmp_path) -> None:
    """The energy is an unknown of it, not a parameter."""

    def pair(t, x, p):
        pull = p["c"] * (x[0] - x[1])
        return [x[2], x[3], -x[0] - x[0] ** 3 - pull, -x[1] - x[1] ** 3 + pull]

    def energy(x, p):
        own = sum(v**2 / 2 + u**2 / 2 + u**4 / 4 for u, v in ((x[0], x[2]), (x[1], x[3])))
        return own + p["c"] * (x[0] - x[1]) ** 2 / 2

    start = {"u": 0.37, "w": -0.37, "v": 0.0, "s": 0.0}
    against = cb.cycle(pair, start, {"c": 0.1}, conserves=energy)
    modes = cb.trace(against, "energy", within={"energy": (0.16, 0.18)}, events=cb.branch_point())
    how = {"within": {"c": (0.09, 0.11)}, "steps": cb.Steps(most=2), "events": ()}
    line = cb.boundary(modes.first("BP"), ("c", "energy"), **how)
    cb.save(tmp_path / "line.nc", line)
    again = cb.load(tmp_path / "line.nc", problem=against)
    assert again[1].solution.period == pytest.approx(line[1].solution.period, rel=1e-12)
    end = cb.extend(again, end="last", within={"c": (0.05, 0.11)}, steps=cb.Steps(most=2))[-1]
    assert end["energy"] == pytest.approx(end["c"] * (12 + 32 * end["c"]) / 9, abs=1e-9)
