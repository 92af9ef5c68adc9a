"""The largest Lyapunov exponents of a lattice: perturbations carried along a motion, and
orthonormalised once in a period."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions
from contbreather.simulation.rotation import weighted_mean
from contbreather.simulation.smooth import SmoothConditions, rigid_or_smooth
from contbreather.simulation.states import PERIOD, ModelParameters, State, check_state, reduced
from contbreather.simulation.variation import along

Array = NDArray[Any]


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
    rng = np.random.default_rng(whole("seed", seed, 0))
    du, dv = rng.normal(size=(2, count, state.u.size))
    columns = np.linalg.qr(np.concatenate([du, dv], axis=1).T)[0]
    growth = []
    for turned in along(state, conditions, settle + periods, reduced(t0)):
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
