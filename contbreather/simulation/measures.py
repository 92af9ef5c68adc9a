"""Measures of a motion: the place of its energy, its rotation number, its Lyapunov exponents.

The forced motion ``a g_n(t)`` carries energy however localised the rest is. So energies are those
of the motion ``x_n = u_n - a g_n`` relative to it; on a ring

    ``e_n = x_n'^2/2 + gamma/4 [(x_n - x_n-1)^2 + (x_n - x_n+1)^2]``,

the second term half the energy of each bond. Springs and ties to the ground belong to their site.

The section (the state once in a period of the forcing) of a quasi-periodic motion is a closed
curve. Its rotation number is the mean turn about the middle of the curve; averaged with the weight
of `weighted_mean` it converges faster than any power of the length. So do the exponents: the rates
at which perturbations grow that are carried along, and orthonormalised once in a period.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse import csgraph

from contbreather.checks import numbers, whole
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import Finite, stiffness_of
from contbreather.lattice.forcing import mean_of
from contbreather.lattice.response import mean_displacement
from contbreather.lattice.uneven import forced_spectrum
from contbreather.one_thread import one_thread
from contbreather.simulation.states import (
    PERIOD,
    ModelParameters,
    SmoothConditions,
    State,
    conditions_of,
    start_of,
    within_period,
)
from contbreather.simulation.variation import variations_along
from contbreather.tables import Column, HtmlRepr, Sheet

Array = NDArray[Any]


@dataclass(frozen=True, eq=False, repr=False)
class Localisation(HtmlRepr):
    """Distribution of the energy of a state over its sites.

    Attributes
    ----------
    energy : ndarray, shape (..., N)
        Per site, relative to the common forced motion.
    participation : ndarray, shape (...)
        ``(sum e)^2/sum e^2``: 1 if one site has all, N if all have the same.
    centre : ndarray of int, shape (...)
        The site with the largest energy.
    """

    energy: Array
    participation: Array
    centre: Array
    lattice: Finite

    def __repr__(self) -> str:
        low, high = np.min(self.participation), np.max(self.participation)
        states = np.size(self.centre)
        return f"<Localisation of {states} states, participation ratio {low:.4g} to {high:.4g}>"

    def table(self) -> Sheet:
        """The number of sites that share the energy, and its decay from site to site."""
        return Sheet.of([
            ("states", np.size(self.centre)),
            ("least participation ratio", float(np.min(self.participation))),
            ("largest", float(np.max(self.participation))),
            ("decay from site to site", None if math.isnan(self.decay()) else self.decay()),
        ])  # fmt: skip

    def decay(self) -> float:
        """By how much the amplitude falls from one site to the next: exp of half the slope of the
        mean logarithm of the energies against the number of bonds from the centre.

        Of several states the mean energies count. 1 if nothing decays, NaN where no site is two
        bonds away.
        """
        energy = self.energy.reshape(-1, self.energy.shape[-1])
        shells = [_shells(self.lattice, int(centre)) for centre in self.centre.flat]
        count = 1 + int(max(bonds.max() for bonds in shells))
        if count < 3:
            return float("nan")
        means = []  # by distance, NaN where no site is
        for sample, bonds in zip(energy, shells, strict=True):
            there = bonds >= 0.0
            which = bonds[there].astype(int)
            with np.errstate(invalid="ignore"):
                total = np.bincount(which, sample[there], minlength=count)
                means.append(total / np.bincount(which, minlength=count))
        folded, distance = np.nanmean(means, axis=0), np.arange(count)
        # the far side of a ring feels both ends of its motion: the outer part is left out
        # and energies that are rounding, of amplitudes 1e-13
        use = (distance <= max(2, (2 * (count - 1)) // 3)) & (folded > 1e-26 * folded.max())
        if np.count_nonzero(use) < 2:
            return 0.0
        # energies go as the square of amplitudes
        slope = np.polyfit(distance[use], np.log(folded[use]), 1)[0]
        return float(np.exp(0.5 * slope))


@lru_cache(maxsize=64)
def _shells(lattice: Finite, centre: int) -> NDArray[np.float64]:
    """Bonds from the centre to each site, -1 where there is no way."""
    apart = csgraph.shortest_path(abs(stiffness_of(lattice)), unweighted=True, indices=centre)
    return np.where(np.isfinite(apart), apart, -1.0)


def localisation(
    u: ArrayLike, v: ArrayLike, t: ArrayLike = 0.0, **on: Unpack[ModelParameters]
) -> Localisation:
    """Energies and participation ratio of one state, or of many at once.

    Parameters
    ----------
    u, v : array_like, shape (..., N)
        Displacements and velocities, for instance ``*run.strobe``.
    t : array_like, shape (...)
        Their times.
    on
        As in `simulate`, of which walls and losses may be left out: energies know nothing of them.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> b = symmetric(a=0.5, gamma=0.02, k=0.8)
    >>> found = localisation(*b.state(20), a=0.5, gamma=0.02)
    >>> round(float(found.participation), 1), int(found.centre)
    (1.1, 0)
    """
    x, y = numbers("u", u), numbers("v", v)
    if x.shape != y.shape or x.ndim == 0 or not x.size:
        raise BadInput(
            f"u and v must have one shape (..., sites); {x.shape} and {y.shape} were given."
        )
    times = numbers("t", t)
    if times.shape not in ((), x.shape[:-1]):
        raise BadInput(f"t has the shape {times.shape}: a time for each of {x.shape[:-1]} states.")
    if on.get("restitution") is None:
        on.setdefault("k", 1.0)
    return localised(x, y, times, conditions_of(x.shape[-1], **on))


def localised(u: Array, v: Array, t: ArrayLike, on: Conditions | SmoothConditions) -> Localisation:
    """`localisation`, under conditions that have been checked."""
    on = on.scaled
    x, y = u - forced(on, t, 0), v - forced(on, t, 1)
    table = stiffness_of(on.lattice)
    # what ties a site to the ground: its spring, and what its row of the stiffness has over but for
    # rounding
    over, size = table.sum(axis=1), abs(table).sum(axis=1)
    loose = np.where(abs(over) > 1e-14 * size, over, 0.0)
    ground = 0.5 * on.lattice.masses * on.lattice.springs * on.spring + 0.5 * on.gamma * loose
    energy = 0.5 * on.lattice.masses * y**2 + ground * x**2
    if on.gamma > 0.0:
        bonds, size = table.tocoo(), x.shape[-1]
        # k (x_i - x_j)^2/2 is that of a bond: half of it, at each of its two entries K_ij = -k;
        # nothing on the diagonal
        apart = -0.25 * bonds.data * (x[..., bonds.row] - x[..., bonds.col]) ** 2
        entries = np.ones(bonds.row.size), (np.arange(bonds.row.size), bonds.row)
        ends = sparse.csr_array(entries, (bonds.row.size, size))
        rows = apart.reshape(math.prod(x.shape[:-1]), bonds.row.size)
        energy += on.gamma * (rows @ ends).reshape(x.shape)
    total, square = energy.sum(axis=-1), (energy**2).sum(axis=-1)
    # where nothing moves, no site has more of it than another: all N of them
    with np.errstate(invalid="ignore", divide="ignore"):
        participation = np.where(square > 0.0, total**2 / square, x.shape[-1])
    return Localisation(energy, participation, energy.argmax(axis=-1), on.lattice)


def forced(on: Conditions | SmoothConditions, t: ArrayLike, order: int) -> Array:
    """The forced motion of every site at many times, or its derivative: shape (..., N or 1)."""
    on = on.scaled
    motion = forced_spectrum(on.lattice, on.forcing, on.gamma, on.spring, on.damping)
    path = on.a * motion.everywhere(np.asarray(t, dtype=float), order)
    if mean := on.a * mean_of(on.forcing) * (order == 0):
        with suppress(BadInput):  # a lattice that nothing holds drifts
            path = path + mean * mean_displacement(on.lattice, (), on.gamma, on.spring)[0]
    return path


# --- rotation numbers -----------------------------------------------------------------------------


def weighted_mean(values: Array) -> Array:
    """Birkhoff average along the first axis with the weight ``exp(-1/(x (1 - x)))``.

    On a smooth torus it converges faster than any power of the length (Das and Yorke), elsewhere
    about as the plain mean.

    Examples
    --------
    >>> turns = np.cos(0.7 * np.arange(2000.0))
    >>> abs(float(turns.mean())) > 1e-5, abs(float(weighted_mean(turns))) < 1e-14
    (True, True)
    """
    x = np.arange(1.0, len(values) + 1.0) / (len(values) + 1.0)
    # none is 0, times which an infinite value is NaN
    weight = np.maximum(np.exp(-1.0 / (x * (1.0 - x))), np.finfo(float).tiny)
    return np.asarray(np.tensordot(weight / weight.sum(), values, axes=1))


@dataclass(frozen=True)
class Rotation(HtmlRepr):
    """Rotation number of a closed curve.

    Attributes
    ----------
    number : float
        Turns per period of the forcing, modulo 1 and up to sign: in [0, 1/2].
    error : float
        Difference between those of the two halves of the run.
    hole : float
        Distance of the curve from the middle it was seen to turn about, relative to its size;
        where it is small the number means nothing.
    drift : float
        By how much the size of the curve differs between the two halves, relative to it: not
        small where the motion still spirals.
    """

    number: float
    error: float
    hole: float
    drift: float

    def table(self) -> Sheet:
        """The number, its error, and what says whether it means anything."""
        return Sheet.of([
            ("rotation number", self.number), ("its error", self.error),
            ("hole", self.hole), ("drift", self.drift),
        ])  # fmt: skip


@one_thread
def rotation(u: ArrayLike, v: ArrayLike) -> Rotation:
    """Rotation number of a stroboscopic section, by weighted Birkhoff averages.

    The section is looked at in several planes: that in which it extends most, those of
    displacement and velocity of single sites, and that of successive states. Taken is the one
    with the widest hole in the middle, about which the turns are averaged.

    Parameters
    ----------
    u, v : array_like, shape (M, N) or (M,)
        Successive states, ``*run.strobe`` for instance, transient left out.

    Examples
    --------
    >>> t = PERIOD * 0.381966 * np.arange(3000)
    >>> found = rotation(np.cos(t) + 0.2 * np.cos(2 * t), np.sin(t))
    >>> round(found.number, 12)
    0.381966
    """
    x, y = numbers("u", u), numbers("v", v)
    if x.ndim not in (1, 2) or x.shape != y.shape or not x.size:
        raise BadInput(
            f"u and v are rows of states, or tables with a column for each site; shapes {x.shape} "
            f"and {y.shape} were given."
        )
    x, y = x.reshape(len(x), -1), y.reshape(len(y), -1)
    if len(x) < 20:
        raise BadInput(f"{len(x)} states are too few for a rotation number; give at least 20.")
    # a section that extends no further than rounding of its largest state is a point
    still = 1e-14 * max(np.abs(x).max(initial=0.0), np.abs(y).max(initial=0.0))
    spread = [(plane, plane.std(axis=0)) for plane in _planes(x, y)]
    whitened = [plane / widths for plane, widths in spread if np.all(widths > still)]
    if not whitened:
        return Rotation(0.0, 0.0, 0.0, 0.0)
    holes = [float(radius.min() / radius.max()) for radius in (np.hypot(*p.T) for p in whitened)]
    best = int(np.argmax(holes))
    return _turns(whitened[best], holes[best])


def _planes(x: Array, y: Array) -> list[Array]:
    """Ways to look at a section, each about its middle."""
    both = np.concatenate([x, y], axis=1)
    both = both - weighted_mean(both)
    # directions in which the section extends most; more states tell them no better
    axes = np.linalg.svd(both[: min(len(both), 4000)], full_matrices=False)[2]
    widest = np.argsort(-x.std(axis=0))[:4]
    planes = [both[:, [n, x.shape[1] + n]] for n in widest]
    planes.append(np.stack([both[:-1] @ axes[0], both[1:] @ axes[0]], axis=1))
    planes.append(both @ axes[:2].T)
    return planes


def _turns(plane: Array, hole: float) -> Rotation:
    turns = np.diff(np.arctan2(plane[:, 1], plane[:, 0])) / PERIOD
    # each turn modulo 1 on the sheet around the middle of them all
    middle = np.angle(np.exp(1j * PERIOD * turns).mean()) / PERIOD
    turns = middle + (turns - middle + 0.5) % 1.0 - 0.5
    half = len(turns) // 2
    parts = (turns, turns[:half], turns[half:])
    mean, first, second = (float(weighted_mean(part)) for part in parts)
    size = np.sum(plane**2, axis=1)
    drift = abs(float(weighted_mean(size[half:]) / weighted_mean(size[:half])) - 1.0)
    return Rotation(abs(mean - round(mean)), abs(first - second), hole, drift)


# --- Lyapunov exponents ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Lyapunov(HtmlRepr):
    """The largest Lyapunov exponents of a motion.

    Attributes
    ----------
    exponents : ndarray
        In descending order, per unit of time; a multiplier mu of an orbit of period T is
        exp(T exponent) in modulus.
    error : ndarray
        Difference between the averages over the two halves of the run.
    periods : int
        Over how many periods it was averaged.
    """

    exponents: Array
    error: Array
    periods: int

    def table(self) -> Sheet:
        columns = [
            Column("exponent", self.exponents.tolist()),
            Column("error", self.error.tolist()),
        ]
        return Sheet(columns, title=f"Averages over {self.periods} periods")


@one_thread
def lyapunov(
    state: Any,
    *,
    periods: int,
    count: int = 2,
    settle: int = 0,
    t0: float = 0.0,
    seed: int = 0,
    m: float | None = None,
    **on: Unpack[ModelParameters],
) -> Lyapunov:
    """The largest Lyapunov exponents of a lattice, saltations included.

    Perturbations are carried along the exact motion and orthonormalised once in a period
    (Benettin); the rates are averaged by `weighted_mean`, far sharper on a torus. The forcing's
    phase is no degree of freedom: a torus of one frequency beside the forcing has one exponent
    zero, a periodic motion none.

    Parameters
    ----------
    state, t0, on
        As in `simulate`.
    periods : int
        Over which to average.
    count : int
        How many exponents, at most 2 N.
    settle : int
        Periods to let pass before.
    seed : int
        Of the first perturbations.
    m : float, optional
        On smooth walls (21) of this hardness instead of rigid ones.

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> b = symmetric(a=0.7, gamma=0.06, k=0.2)
    >>> found = lyapunov(b.state(5), a=0.7, gamma=0.06, k=0.2, periods=200, count=1)
    >>> bool(abs(found.exponents[0]) < 0.01)  # a stable breather of an undamped ring is neutral
    True
    """
    start, conditions = start_of(state, m, t0, **on)
    sites, wanted = start.u.size, whole("count", count, 1)
    if wanted > 2 * sites:
        raise BadInput(f"count = {count}: {sites} sites have {2 * sites} exponents.")
    before, length = whole("settle", settle, 0), whole("periods", periods, 10)
    return exponents(start, conditions, length, wanted, settle=before, t0=t0, seed=seed)


def exponents(
    state: State,
    conditions: Conditions | SmoothConditions,
    periods: int,
    count: int,
    *,
    settle: int = 0,
    t0: float = 0.0,
    seed: int = 0,
) -> Lyapunov:
    """`lyapunov`, of a state and under conditions that have been checked."""
    rng = np.random.default_rng(whole("seed", seed, 0))
    du, dv = rng.normal(size=(2, count, state.u.size))
    columns = np.linalg.qr(np.concatenate([du, dv], axis=1).T)[0]
    growth = []
    for turned in variations_along(state, conditions, settle + periods, within_period(t0)):
        # column i of Q R grows by R_ii beyond those before it; Householder's Q is orthonormal where
        # k = 0 annihilates a direction, too, of which the logarithm is then -inf
        columns, sizes = np.linalg.qr(turned(columns))
        with np.errstate(divide="ignore"):
            growth.append(np.log(np.abs(np.diag(sizes))))
    rates = np.array(growth[settle:]) / PERIOD
    mean = weighted_mean(rates)
    half = len(rates) // 2
    early, late = weighted_mean(rates[:half]), weighted_mean(rates[half:])
    differs = early != late  # not so where k = 0 annihilates a direction: both are -inf
    error = np.zeros(count)
    error[differs] = np.abs(early[differs] - late[differs])
    order = np.argsort(-mean)
    return Lyapunov(mean[order], error[order], periods)
