"""Orbits put together from their impacts; asymmetric breathers in closed form; how well a ring
repeats one; derivatives by differences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from types import SimpleNamespace
from typing import Any

import mpmath as mp
import numpy as np
from scipy.optimize import brentq

from contbreather.lattice import InfiniteChain, Ring, forcing_of
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import OpenChain
from contbreather.orbits import neighbour_peak, symmetric
from contbreather.orbits.constructors import shooting
from contbreather.orbits.orbit import Orbit, orbit_at, orbit_of
from contbreather.orbits.section import Section
from contbreather.simulation import simulate
from tests.lattice.by_hand import ring_mean
from tests.stability.by_hand import slope


def started_on_arm(lifted: Any, asymmetry: float) -> Any:
    """The problem started on the arm where t2 - t1 - pi is about as given, small."""
    # along the null vector t2 - t1 changes by the difference of its entries
    slots, along = lifted.problem.slots, lifted.direction
    return lifted.arm(asymmetry / float(along[slots["t2"]] - along[slots["t1"]]))


def orbit_from(
    impacts: Iterable[tuple[int, int, float, float]],
    offsets: Any = (),
    turns: int = 1,
    *,
    a: float = 0.5,
    gamma: float = 0.08,
    k: float = 0.8,
    forcing: Any = None,
    lattice: Any = None,
) -> Orbit:
    """From (site, wall, time, impulse) of every impact."""
    rows = [tuple(impact) for impact in impacts]
    section = Section(tuple((site, wall) for site, wall, _, _ in rows), turns)
    drive = forcing_of(forcing)
    on = Conditions(a, gamma, k, forcing=drive, lattice=lattice or InfiniteChain())
    return orbit_of(on, section, [row[2] for row in rows], [row[3] for row in rows], offsets)


@cache
def in_phase() -> Orbit:
    """Two sites of a ring of 7 that hit the same wall, half a symmetric orbit."""
    seed, on = {"t1": -2.94, "t2": -2.94}, {"a": 0.5, "gamma": 0.03, "k": 0.8, "sites": 7}
    return orbit_at(shooting(seed, sequence=((1, 1), (4, 1)), symmetric=True, **on))


@cache
def one_wall() -> Orbit:
    """The middle one of three sites, between springs and with one wall."""
    on = {"a": 0.9, "gamma": 0.03, "k": 0.7, "spring": 2.3, "damping": 0.1}
    chain = {"lattice": OpenChain(3), "walls": {1: (None, 0.6)}}
    return orbit_at(shooting({"t1": 2.6}, sequence=[(1, 1)], **chain, **on))


@cache
def _responses(d: Any, gamma: Any, sites: int | None) -> tuple[Any, Any]:
    """A and B of the closed form, means over the modes of a ring or over the band."""

    def A(w: Any) -> Any:
        if w == 0:
            return (mp.pi**2 - 4 * d * d) / (2 * mp.pi)
        return (mp.cos(2 * w * d) - mp.cos(mp.pi * w)) / (w * mp.sin(mp.pi * w))

    def B(w: Any) -> Any:
        return 2 * d / mp.pi if w == 0 else mp.sin(2 * w * d) / mp.sin(mp.pi * w)

    def mean(of: Any) -> Any:
        if sites or not gamma:
            return ring_mean(of, gamma, sites or 1)
        band = [0, 1, 2, mp.pi]
        return mp.quad(lambda x: of(2 * mp.sqrt(gamma) * mp.sin(x / 2)), band) / mp.pi

    return mean(A), mean(B)


def two_impacts(d: Any, gamma: Any, k: Any, sites: int | None = None) -> SimpleNamespace:
    """The asymmetric breather with the flights pi -+ 2d, the shorter one centred at `middle`:
    ``p = 1/(A - B cot d)``, ..., at 40 digits."""
    with mp.workdps(40):
        d, q = mp.mpf(d), (1 - mp.mpf(k)) / (1 + mp.mpf(k))
        A, B = _responses(d, mp.mpf(gamma), sites)
        p = 1 / (A - B * mp.cot(d))
        cosine, sine = p * q / mp.cos(d), -p * B / mp.sin(d)
        middle = mp.atan2(sine, cosine)
        return SimpleNamespace(p=p, a=mp.hypot(cosine, sine), middle=middle, c=p * q * mp.tan(d))


def touching(
    site: int, gamma: float, k: float, low: float, high: float = 3.0, **more: Any
) -> tuple[Orbit, float]:
    """The symmetric breather with an amplitude between two at which a site reaches its wall, and
    when it does."""

    def above(a: float) -> float:
        return neighbour_peak(symmetric(a, gamma, k, root=1, **more), site)[1] - 1.0

    b = symmetric(brentq(above, low, high, xtol=1e-14), gamma, k, root=1, **more)
    return b, neighbour_peak(b, site)[0]


def distance(curves: Iterable[Any], point: Any, *names: str) -> float:
    """From a point to the nearest chord of some curves, in these columns, phi on its circle."""

    def place(of: Any) -> np.ndarray:
        turned = [part(of["phi"]) for part in (np.cos, np.sin) if "phi" in names]
        return np.stack([*(of[name] for name in names if name != "phi"), *turned], axis=-1)

    here, found = place(point), []
    for nodes in map(place, curves):
        start, chord = nodes[:-1], np.diff(nodes, axis=0)
        along = np.clip(np.sum((here - start) * chord, -1) / np.sum(chord * chord, -1), 0, 1)
        found.append(float(np.linalg.norm(here - start - along[:, None] * chord, axis=-1).min()))
    return min(found, default=np.inf)


def repeats(orbit: Orbit, sites: int, t0: float = 0.3) -> tuple[float, float]:
    """How far a period of exact simulation takes a ring from its start, and half of one."""
    own, turns = orbit.on(Ring(sites)), orbit.section.turns
    run = simulate(own, periods=turns, t0=t0)
    assert len(run.impacts) == len(own.hits)
    end = np.abs(np.subtract(run.final, own.state(t=t0))).max()
    return float(end), np.abs(run.strobe.u[turns // 2] - own.state(t=t0)[0]).max()


def run_once(orbit: Orbit) -> float:
    """How far an orbit of a finite lattice is from coming back, by the simulation."""
    start = float(orbit.times.min()) - 0.02
    run = simulate(orbit, periods=orbit.section.turns, t0=start)
    assert len(run.impacts) == len(orbit.hits)
    return float(np.abs(np.subtract(run.final, orbit.state(t=start))).max())


def derivatives(
    equations: Any, x: np.ndarray, params: Mapping[str, float], h: float
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Each column of the Jacobian (named "") and the slope in each parameter, and what differences
    of the residual make in its place."""

    def at(unit: np.ndarray, moved: Mapping[str, float]) -> np.ndarray:
        return slope(
            lambda e: equations.residual(
                x + e * unit, {n: value + e * moved.get(n, 0.0) for n, value in params.items()}
            ),
            h,
        )

    for column, unit in zip(equations.jacobian(x, params).T, np.eye(x.size), strict=True):
        yield "", column, at(unit, {})
    for name in params:
        yield name, equations.along(x, params, {name: 1.0}), at(np.zeros(x.size), {name: 1.0})
