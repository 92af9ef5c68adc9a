"""Random lattices of oscillators: each breather returns under DOP853, and its multipliers are those
of variational equations that are written down here again.

    python -m tests.campaigns.oscillators 100 1
"""

from __future__ import annotations

import sys
import time

import networkx as nx
import numpy as np
from scipy.integrate import solve_ivp

import contbreather as cb

# formula, slope, curvature, frequencies of single oscillators
SITES = {
    "hard": ("u**2/2 + b*u**4/4", lambda u, b: u + b * u**3, lambda u, b: 1 + 3 * b * u**2),
    "soft": ("u**2/2 - b*u**4/4", lambda u, b: u - b * u**3, lambda u, b: 1 - 3 * b * u**2),
    "Morse": (
        "(1 - exp(-b*u))**2/(2*b**2)",
        lambda u, b: (1 - np.exp(-b * u)) * np.exp(-b * u) / b,
        lambda u, b: 2 * np.exp(-2 * b * u) - np.exp(-b * u),
    ),
    "pendulum": (
        "(1 - cos(b*u))/b**2", lambda u, b: np.sin(b * u) / b, lambda u, b: np.cos(b * u),
    ),
    "cubic": (
        "u**2/2 + b*u**3/3 + u**4/4",
        lambda u, b: u + b * u**2 + u**3,
        lambda u, b: 1 + 2 * b * u + 3 * u**2,
    ),
}  # fmt: skip
RANGES = {"hard": (1.2, 2.5), "soft": (0.6, 0.93), "Morse": (0.6, 0.93), "pendulum": (0.55, 0.93),
          "cubic": (1.25, 2.2)}  # fmt: skip
BONDS = {
    "linear": ("c*r**2/2", lambda r, c: c * r, lambda r, c: c + 0 * r),
    "quartic": (
        "c*(r**2/2 + r**4/4)", lambda r, c: c * (r + r**3), lambda r, c: c * (1 + 3 * r**2),
    ),
    "asymmetric": (
        "c*(r**2/2 - r**3/9)", lambda r, c: c * (r - r**2 / 3), lambda r, c: c * (1 - 2 * r / 3),
    ),
}  # fmt: skip


def drawn_lattice(rng):
    """A lattice, its bonds from site to site with weights, and sites tied to the ground."""
    kind = rng.choice(["ring", "open", "fixed", "grid", "torus", "graph"])
    if kind == "ring":
        n = int(rng.integers(3, 9))
        return cb.Ring(n), [(i, (i + 1) % n, 1.0) for i in range(n)], []
    if kind in ("open", "fixed"):
        n = int(rng.integers(2, 9))
        chain = cb.OpenChain(n, ends="free" if kind == "open" else "fixed")
        ground = [(0, 1.0), (n - 1, -1.0)] if kind == "fixed" else []
        return chain, [(i, i + 1, 1.0) for i in range(n - 1)], ground
    if kind in ("grid", "torus"):
        rows, columns = 3, int(rng.integers(3, 5))
        at = lambda i, j: (i % rows) * columns + j % columns  # noqa: E731
        wraps = kind == "torus"
        bonds = [
            (at(i, j), at(i + di, j + dj), 1.0)
            for i in range(rows) for j in range(columns) for di, dj in ((1, 0), (0, 1))
            if wraps or (i + di < rows and j + dj < columns)
        ]  # fmt: skip
        return cb.Grid(rows, columns, periodic=wraps), bonds, []
    graph = nx.gnm_random_graph(6, 8, seed=int(rng.integers(1000)))
    for _, _, data in graph.edges(data=True):
        data["weight"] = float(rng.uniform(0.5, 1.5))
    bonds = [(min(i, j), max(i, j), w) for i, j, w in graph.edges(data="weight")]
    return cb.Lattice.from_graph(graph), bonds, []


def field(site, bond, bonds, ground, m, s, b, c, force, d):
    """Accelerations and their derivative in the positions."""
    N = len(m)
    i, j, w = (np.array(column) for column in zip(*bonds, strict=True))
    i, j = i.astype(int), j.astype(int)

    def both(t, u, v):
        r = u[j] - u[i]
        pull, stiff = w * bond[1](r, c), w * bond[2](r, c)
        g, K = s * site[1](u, b), np.diag(s * site[2](u, b))
        np.add.at(g, j, pull)
        np.add.at(g, i, -pull)
        for a, e, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            np.add.at(K, (a, e), sign * stiff)
        for n, sign in ground:
            g[n] += sign * bond[1](sign * u[n], c)
            K[n, n] += bond[2](sign * u[n], c)
        return (-g - d * v + force(t)) / m, -K / m[:, None], N

    return both


def returns(both, d, m, x, period):
    """Where a state is a period later, and the derivative of that."""
    n = len(m)

    def right(t, y):
        u, v, M = y[:n], y[n : 2 * n], y[2 * n :].reshape(2 * n, -1)
        a, K, _ = both(t, u, v)
        turned = np.vstack([M[n:], K @ M[:n] - d / m[:, None] * M[n:]])
        return np.concatenate([v, a, turned.ravel()])

    start = np.concatenate([x, np.eye(2 * n).ravel()])
    end = solve_ivp(right, (0, period), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return end[: 2 * n], end[2 * n :].reshape(2 * n, -1)


def free_amplitude(site, b, omega):
    """About the amplitude of one oscillator at a frequency, by its crossings of 0."""
    right = lambda t, y: [y[1], -site[1](y[0], b)]  # noqa: E731
    through = lambda t, y: y[0]  # noqa: E731
    for a in np.geomspace(0.1, 3.0, 60):
        times = solve_ivp(right, (0, 20), [a, 0], events=through, rtol=1e-6).t_events[0]
        if (2 * np.pi / (times[2] - times[0]) > omega) == (omega > 1):
            return a
    raise ValueError("no amplitude has this frequency")


def case(rng, driven):
    lattice, bonds, ground = drawn_lattice(rng)
    N = lattice.sites
    kind = str(rng.choice(list(SITES)))
    site, bond = SITES[kind], BONDS[str(rng.choice(list(BONDS)))]
    b, c = float(rng.uniform(0.6, 1.4)), float(rng.uniform(0.005, 0.04))
    m, s = (np.ones(N), np.ones(N)) if rng.random() < 0.6 else rng.uniform(0.95, 1.05, (2, N))
    params, how, d, force = {"b": b, "c": c}, {"masses": m, "onsite": s}, 0.0, lambda t: 0.0
    sites = rng.choice(N, min(N, int(rng.integers(1, 4))), replace=False).tolist()
    omega = float(rng.uniform(*RANGES[kind]))
    if driven:
        low, high = (1.15, 1.4) if kind in ("hard", "cubic") else (0.75, 0.9)
        omega, d = float(rng.uniform(low, high)), float(rng.uniform(0.03, 0.08))
        # a force that feeds the losses where the free oscillation has this frequency, and a bit
        a = float(rng.uniform(1.2, 1.6)) * d * omega * free_amplitude(site, b, omega)
        params |= {"d": d, "a": a}
        how |= {"damping": "d", "drive": "a*cos(omega*t)"}
        force = lambda t: a * np.cos(omega * t)  # noqa: E731
        code = {n: str(rng.choice(["low", "high"])) for n in sites}
    else:
        code = {n: int(rng.choice([1, -1])) for n in sites}
    chain = cb.Oscillators(V=site[0], W=bond[0], lattice=lattice, **how)
    about = f"{kind} {bond[0]} {lattice!r} {code} omega={omega:.4f} b={b:.3f} c={c:.4f}"
    clock = time.process_time()
    try:
        orbit = cb.breather(chain, code, omega=omega, params=params).solution
    except cb.NoSolution as error:
        return "none", f"{about}: {error}"
    clock = time.process_time() - clock
    both = field(site, bond, bonds, ground, m, s, b, c, force, d)
    x = np.concatenate(orbit.state())
    end, M = returns(both, d, m, x, orbit.period)
    gap = abs(end - x).max()
    mu = np.linalg.eigvals(M)
    # of pairs that meet rounding is the root of that of their sums: characteristic polynomials
    probes = 1.3 * np.exp(1j * np.linspace(0.1, 3.0, 7))
    mine = np.array([np.prod(1 - orbit.multipliers / z) for z in probes])
    theirs = np.array([np.prod(1 - mu / z) for z in probes])
    off = (abs(mine - theirs) / np.maximum(abs(theirs), 1)).max()
    false = orbit.unstable == 0 and abs(mu).max() > 1 + 1e-4
    growth = max(1.0, abs(M).max())
    good = gap < 1e-9 * growth and off < 1e-6 and not false
    says = f"{about}: gap {gap:.1e}, multipliers {off:.1e}, unstable {orbit.unstable}, "
    says += f"largest {orbit.largest:.6f} / {abs(mu).max():.6f}, {clock:.1f} s"
    return ("right" if good else "WRONG"), says


def main(count, seed, only=""):
    tally = {}
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        driven = bool(rng.random() < 0.3)
        if only and driven != (only == "driven"):
            continue
        try:
            what, says = case(rng, driven)
        except Exception as error:  # noqa: BLE001
            what, says = "ERROR", f"{type(error).__name__}: {error}"
        tally[what] = tally.get(what, 0) + 1
        print(k, what, says, flush=True)
    print(tally)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
