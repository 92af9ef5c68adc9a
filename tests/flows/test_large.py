"""Cycles of flows of many states, by sparse collocation."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.sparse import block_array, diags_array, eye_array

import contbreather as cb

CELLS = 14
A, B, D = 2.0, 5.45, {"D1": 0.008, "D2": 0.004}
MESH = cb.Collocation(14, 4)


def beside(x: Any) -> Any:
    """Differences to both neighbours in a ring."""
    return np.roll(x, 1, axis=0) + np.roll(x, -1, axis=0) - 2 * x


def ring(t: Any, x: Any, p: Any) -> Any:
    """Roessler's systems, coupled."""
    u, v, w = x[:CELLS], x[CELLS : 2 * CELLS], x[2 * CELLS :]
    force = p.get("F", 0.0) * np.cos(t)
    return np.concatenate(
        [-v - w + p["d"] * beside(u) + force, u + 0.2 * v, 0.2 + w * (u - p["c"])]
    )


def ring_pattern() -> Any:
    one = np.eye(CELLS)
    return np.block([[abs(beside(one)) > 0, one, one], [one, one, 0 * one], [one, 0 * one, one]])


@cache
def rings(*, sparse: bool) -> cb.Branch:
    start = {"u": np.full(CELLS, -3.0), "v": np.full(CELLS, -1.0), "w": np.full(CELLS, 0.1)}
    orbit = cb.cycle(
        ring, start, {"c": 2.8, "d": 1.0}, settle=100, collocation=MESH,
        jacobian=ring_pattern() if sparse else None,
    )  # fmt: skip
    return cb.trace(orbit, "c", within={"c": (2.8, 2.85)})


@pytest.mark.slow
def test_both_equations_have_the_same_orbits_multipliers_and_period_doubling() -> None:
    """One by elimination, which no state inside of an interval is among the unknowns of."""
    dense, sparse = (rings(sparse=sparse) for sparse in (False, True))
    assert sparse[0].problem.x.size > 4 * dense[0].problem.x.size
    flips = [branch.first("PD") for branch in (dense, sparse)]
    for name in ("c", "period", "max(u)", "min(w)"):
        assert flips[0][name] == pytest.approx(flips[1][name], rel=1e-10)
    mu = [flip.solution.multipliers for flip in flips]
    np.testing.assert_allclose(mu[1], mu[0], atol=1e-9)
    assert flips[1].detail["criticality"] == flips[0].detail["criticality"] == "supercritical"


@pytest.mark.slow
def test_the_doubled_cycle_leaves_it() -> None:
    """It is that of a single system, whose branch sets out at the same place."""
    (arm,) = cb.switch(rings(sparse=True).first("PD"), within={"c": (2.5, 2.9)},
                       steps=cb.Steps(most=2))  # fmt: skip
    assert arm["period"][0] == pytest.approx(2 * rings(sparse=True).first("PD")["period"], rel=1e-5)


def test_arnoldi_finds_the_largest_of_all_multipliers() -> None:
    point = rings(sparse=True)[-1]
    every, leading = point.solution, point.problem.residual.leading(point.x, point.params)
    np.testing.assert_allclose(leading[0], every.others[: leading[0].size], atol=1e-8)
    assert leading[1] == pytest.approx(every.trivial, abs=1e-6)  # as the mesh resolves it


def test_derivatives_are_those_by_differences() -> None:
    from contbreather.continuation.curve.curve import Curve

    curve = Curve(rings(sparse=True)[0].problem, ("c",))
    z = curve.start + 1e-3 * np.sin(np.arange(curve.start.size))
    way = np.cos(np.arange(z.size) ** 1.5) * curve.scales
    step = 1e-5 * way
    wanted = (8 * (curve.equations(z + step) - curve.equations(z - step))
              - curve.equations(z + 2 * step) + curve.equations(z - 2 * step)) / 12e-5  # fmt: skip
    found = curve.jacobian(z) @ way
    np.testing.assert_allclose(found, wanted, atol=1e-7 * abs(wanted).max())


@pytest.mark.slow
def test_a_forced_cycle_is_the_same_by_both() -> None:
    forced: dict[str, Any] = {
        "start": {"u": np.full(CELLS, 1.0), "v": np.zeros(CELLS), "w": np.zeros(CELLS)},
        "params": {"c": 5.0, "d": 1.0, "F": 0.05}, "period": 2 * np.pi, "collocation": MESH,
    }  # fmt: skip

    def damped(t: Any, x: Any, p: Any) -> Any:
        return ring(t, x, p) - 0.3 * x

    one, other = (
        cb.flows.cycle_of(cb.cycle(damped, **forced, settle=120, jacobian=pattern))
        for pattern in (None, ring_pattern())
    )
    t = np.linspace(0, 6, 9)
    np.testing.assert_allclose(one.states(t), other.states(t), atol=1e-10)
    np.testing.assert_allclose(one.multipliers, other.multipliers, atol=1e-10)


# --- the Brusselator on a line ------------------------------------------------------------------


def brusselator(cells: int, mesh: cb.Collocation = MESH) -> cb.Problem:
    band = diags_array([np.ones(cells - 1), np.ones(cells), np.ones(cells - 1)], offsets=(-1, 0, 1))
    one = eye_array(cells)

    def diffused(x: Any, edge: float) -> Any:
        rim = np.full((1, *x.shape[1:]), edge)
        return np.diff(np.concatenate([rim, x, rim]), n=2, axis=0) * (cells + 1) ** 2

    def field(t: Any, x: Any, p: Any) -> Any:
        u, v = x[:cells], x[cells:]
        r, L = u * u * v, p["L"]
        return np.concatenate([p["D1"] / L**2 * diffused(u, A) + A - (B + 1) * u + r,
                               p["D2"] / L**2 * diffused(v, B / A) + B * u - r])  # fmt: skip

    return cb.equilibrium(
        field, {"u": np.full(cells, A), "v": np.full(cells, B / A)}, {"L": 0.45, **D},
        jacobian=block_array([[band, one], [one, band]]), collocation=mesh,
    )  # fmt: skip


@pytest.mark.slow
def test_the_brusselator_begins_to_oscillate_where_its_first_mode_does() -> None:
    """The trace of the mode is zero: B - 1 - A^2 = (D1 + D2) k^2 / L^2, of differences, with the
    frequency the root of the determinant; and a cycle sets out there."""
    cells = 24
    born = cb.trace(
        brusselator(cells, cb.Collocation(10, 4)), "L", within={"L": (0.45, 0.6)}
    ).first("HB")
    k = 2 * (cells + 1) * np.sin(0.5 * np.pi / (cells + 1))
    L = np.sqrt(sum(D.values()) / (B - 1 - A**2)) * k
    assert born["L"] == pytest.approx(L, rel=1e-12)
    u, v = (d * (k / L) ** 2 for d in D.values())
    omega = np.sqrt((B - 1 - u) * (-(A**2) - v) + A**2 * B)
    assert born["omega"] == pytest.approx(omega, rel=1e-10)
    (cycles,) = cb.switch(born, within={"L": (0.45, 0.6)}, steps=cb.Steps(most=3))
    orbit = cycles[0]
    assert orbit["period"] == pytest.approx(2 * np.pi / omega, rel=1e-4)
    assert orbit["L"] > L  # the amplitude grows with the root of the length
    assert {"max(u)", "min(u)", "max(v)", "min(v)"} <= {*cycles.columns()}
    assert not any("u0" in name for name in cycles.columns())
    assert orbit.solution.extreme("u11", 1.0) <= orbit["max(u)"]


@pytest.mark.slow
@pytest.mark.parametrize("cells", [100, 200])  # with all multipliers, and with the leading ones
def test_multipliers_of_waves_that_diffuse_fast_are_known(cells: int) -> None:
    """Of u' = (r + i) u - |u|^2 u + D u_xx, alike everywhere, the amplitude of a mode of the cells
    decays as its phase does, and by 2 r more; of the fastest a Gauss method would leave 0.6."""
    modes = 4 * np.sin(np.pi * np.arange(cells) / (2 * cells)) ** 2
    D = 0.05 / modes[1]

    def field(t: Any, x: Any, p: Any) -> Any:
        u, v = x[:cells], x[cells:]
        grows = p["r"] - u * u - v * v

        def diffused(w: Any) -> Any:
            return D * np.diff(np.concatenate([w[:1], w, w[-1:]]), n=2, axis=0)

        return np.concatenate([grows * u - v + diffused(u), u + grows * v + diffused(v)])

    band = diags_array([np.ones(cells - 1), np.ones(cells), np.ones(cells - 1)], offsets=(-1, 0, 1))
    pattern = block_array([[band, eye_array(cells)], [eye_array(cells), band]])
    rest = cb.equilibrium(
        field, {"u": np.zeros(cells), "v": np.zeros(cells)}, {"r": -0.01}, jacobian=pattern,
        collocation=cb.Collocation(8, 4),
    )  # fmt: skip
    begins = cb.trace(rest, "r", within={"r": (-0.01, 0.02)}).first("HB")
    assert begins["r"] == pytest.approx(0.0, abs=1e-9)
    (waves,) = cb.switch(begins, within={"r": (-0.1, 1.0)}, steps=cb.Steps(most=1))
    r, orbit = waves[-1]["r"], waves[-1].solution
    wanted = np.exp(-2 * np.pi * np.sort(np.concatenate([D * modes, D * modes + 2 * r])))
    known = orbit.multipliers
    assert np.count_nonzero(wanted > 0.5) <= known.size
    np.testing.assert_allclose(known, wanted[: known.size], atol=1e-5)
