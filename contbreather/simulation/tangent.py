"""What becomes of small perturbations along a run: the variational flow with its saltations.

Between impacts perturbations obey the unforced lattice, whatever the orbit does. At an impact of
site n only that site's pair changes, by the block of (19), with damping

    ``du+ = -k du-,   dv+ = -k dv- + b du-,   b = (1 + k)(u''/u' + mu)``,

both just before. A site that rests on its wall has no perturbation; where the wall lets go, nothing
jumps. So the tangent flow needs of an orbit only the list of its impacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import check_kind, numbers, whole
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import stiffness_of
from contbreather.signals import deferred
from contbreather.simulation.impacting import Run
from contbreather.simulation.smooth import SmoothConditions, SmoothRun, flown, rigid_or_smooth
from contbreather.simulation.states import PERIOD, On, State, check_state, reduced, within
from contbreather.simulation.stretches import Machine, walk

if TYPE_CHECKING:
    from contbreather.simulation.room import Law

Array = NDArray[Any]


def kicks(
    impacts: NDArray[np.void], rests: NDArray[np.void], conditions: Conditions, t0: float
) -> tuple[Array, Array, Array, Array]:
    """Events as the compiled loop wants them: time in its period, site, b (or a code), period.

    ``time`` of the tables counts from the start of the run; a NaN of b marks where a rest begins,
    an infinite one where it ends.
    """
    b = (1.0 + conditions.k) * (impacts["acceleration"] / impacts["before"] + conditions.damping)
    rests = _at_impacts(rests, impacts)
    codes = np.where(rests["begins"], np.nan, np.inf)
    period = np.concatenate([impacts["period"], rests["period"]])
    phase = np.concatenate([impacts["phase"], rests["phase"]])
    rough = np.concatenate([impacts["time"], rests["time"]]) - PERIOD * period
    # the phase is exact, the time says which turn it belongs to
    since = phase - reduced(t0)
    since += PERIOD * np.round((rough - since) / PERIOD)
    site = np.concatenate([impacts["site"], rests["site"]])
    entry = np.concatenate([b, codes])
    # at equal times the impact comes before the rest it leads to
    order = np.lexsort((np.isnan(entry), since, period))
    return since[order], site[order], entry[order], period[order]


def _at_impacts(rests: NDArray[np.void], impacts: NDArray[np.void]) -> NDArray[np.void]:
    """Rests that begin at the last impact listed: the rebounds after it take what is left away."""
    moved = rests.copy()
    for site in np.unique(rests["site"][rests["begins"]]):
        own = impacts[impacts["site"] == site]
        rows = np.flatnonzero(rests["begins"] & (rests["site"] == site))
        last = np.searchsorted(own["time"], rests["time"][rows], side="right") - 1
        for name in ("time", "period", "phase"):
            moved[name][rows[last >= 0]] = own[name][last[last >= 0]]
    return moved


def variation(run: Run | SmoothRun, vectors: ArrayLike | None = None) -> Array:
    """The derivative of a run's final state with respect to its first one, times some vectors.

    Parameters
    ----------
    run : Run or SmoothRun
    vectors : array_like, shape (2 N, m), optional
        Perturbations (u_0 .. u_N-1, u'_0 .. u'_N-1) of the first state, in columns; the identity
        unless given, for the whole matrix. A rigid run must not begin or end at an impact.

    Returns
    -------
    ndarray, shape (2 N, m)

    Examples
    --------
    >>> from contbreather.orbits import symmetric
    >>> from contbreather.simulation import simulate
    >>> b = symmetric(a=0.5, gamma=0.08, k=0.8)
    >>> matrix = variation(simulate(b.state(5), a=0.5, gamma=0.08, k=0.8, periods=1))
    >>> round(float(np.linalg.det(matrix)), 10)  # k^2 for each of the two impacts
    0.4096
    """
    from contbreather.simulation.law import law_of
    from contbreather.simulation.tangent_flow import CARRY

    check_kind(run, (Run, SmoothRun), "a run")
    sites = run.sites
    columns = np.eye(2 * sites) if vectors is None else numbers("vectors", vectors)
    if columns.ndim != 2 or len(columns) != 2 * sites:
        raise BadInput(
            f"perturbations of {sites} sites are columns of length {2 * sites}; "
            f"an array of shape {columns.shape} was given."
        )
    if isinstance(run, SmoothRun):
        return _smooth(run, columns)
    tables = run.impacts.copy(), run.rests.copy()
    for table in tables:
        table["time"] -= run.times[0]
    events = kicks(*tables, run.conditions, run.times[0])
    du, dv = np.ascontiguousarray(columns.T.reshape(-1, 2, sites).transpose(1, 0, 2))
    at_rest = resting(State(run.strobe.u[0], run.strobe.v[0]), run.conditions, run.times[0])
    rest = run.end - run.times[-1]
    spans = np.array([PERIOD] * run.periods + ([rest] if rest > 1e-12 else []))
    law, growth = law_of(run.conditions), np.empty((len(spans), 0))
    with deferred():
        CARRY(du, dv, at_rest, spans, 0, law, *events, growth, *room(law, sites))
    return np.concatenate([du, dv], axis=1).T


def room(law: Law, sites: int) -> tuple[Array, Array, Array]:
    """What drives perturbations and where they rest, both zeros, and room for a step."""
    return np.zeros(law.size), np.zeros(sites), np.empty((law.size, sites))


def _smooth(run: SmoothRun, columns: Array) -> Array:
    """Along a smooth run: its variational equations, integrated together with it."""
    span = (run.end - run.times[0]) / PERIOD
    if span == 0.0:
        return columns
    first = State(run.strobe.u[0], run.strobe.v[0])
    found = flown(run.conditions, first, reduced(run.times[0]), span, slopes=True, columns=columns)
    return np.asarray(found[1])


def resting(state: State, conditions: Conditions, t0: float) -> NDArray[np.int8]:
    """Sites that rest on a wall: at it, without velocity, pushed against it."""
    from contbreather.simulation.flow import driven
    from contbreather.simulation.law import law_of

    (u, v), c, law = state, conditions, law_of(conditions)
    pull = c.gamma * (stiffness_of(c.lattice) @ u) / c.lattice.masses + c.spring * u
    push = (1.0 + law.bonds.pulls[1]) * driven(law.force, reduced(t0))[0] - pull
    wall = (u == law.walls[1]).astype(np.int8) - (u == law.walls[0])
    return np.asarray((wall != 0) & (v == 0.0) & (wall * push > 0.0), dtype=np.int8)


@dataclass(frozen=True)
class Lyapunov:
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


def lyapunov(
    state: Any,
    *,
    periods: int,
    count: int = 2,
    settle: int = 0,
    t0: float = 0.0,
    seed: int = 0,
    m: float | None = None,
    **on: Unpack[On],
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
    start = check_state(state)
    conditions = rigid_or_smooth(start.u.size, m, **on)
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
    first = np.random.default_rng(whole("seed", seed, 0)).normal(size=(2, count, state.u.size))
    along = _grown_smooth if isinstance(conditions, SmoothConditions) else _grown
    rates = along(state, conditions, settle + periods, reduced(t0), *first)[settle:] / PERIOD
    mean = weighted_mean(rates)
    half = len(rates) // 2
    early, late = weighted_mean(rates[:half]), weighted_mean(rates[half:])
    differs = early != late  # not so where k = 0 annihilates a direction: both are -inf
    error = np.zeros(count)
    error[differs] = np.abs(early[differs] - late[differs])
    order = np.argsort(-mean)
    return Lyapunov(mean[order], error[order], periods)


def _grown(state: State, on: Any, periods: int, t0: float, du: Array, dv: Array) -> Array:
    """Logarithms by which perturbations grow in each period, orthonormalised after it."""
    from contbreather.simulation.law import law_of
    from contbreather.simulation.tangent_flow import CARRY

    start = within(state, on.walls)
    at_rest, law, grown = resting(start, on, t0), law_of(on), []
    own = room(law, state.u.size)
    for one in walk(Machine(start, on, t0), periods=periods, progress=False):
        if one.stop is not None:
            raise NotConverged(one.reason)
        growth, spans = np.empty((one.periods, len(du))), np.full(one.periods, PERIOD)
        events = kicks(one.impacts, one.rests, on, t0)
        with deferred():
            CARRY(du, dv, at_rest, spans, one.first, law, *events, growth, *own)
        grown.append(growth)
    return np.concatenate(grown)


def _grown_smooth(state: State, on: Any, periods: int, t0: float, du: Array, dv: Array) -> Array:
    """The same between smooth walls."""
    columns, grown = np.linalg.qr(np.concatenate([du, dv], axis=1).T)[0], []
    for _ in range(periods):
        x, turned, _ = flown(on, state, t0, 1.0, slopes=True, columns=columns)
        columns, sizes = np.linalg.qr(np.asarray(turned))
        grown.append(np.log(np.abs(np.diag(sizes))))
        state = State(*np.split(x, 2))
    return np.array(grown)


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
    weight = np.exp(-1.0 / (x * (1.0 - x)))
    return np.asarray(np.tensordot(weight / weight.sum(), values, axes=1))
