"""The paper's rule for stability: a ring, and a threshold for the modulus of its multipliers.

"The loss of stability has been recorded ... when the eigenvalue of the monodromy matrix (or couple
of the complex conjugate eigenvalues) with the largest absolute value crossed a threshold of 1.005",
at N = 400. The monodromy matrix is (QS)^2, eq. (20), of the ring, with b of the exact breather of
the infinite chain. Which multiplier is the largest changes along the line, so the line is the
envelope of the curves of single multipliers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import row, whole
from contbreather.errors import NotConverged
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.one_thread import one_thread
from contbreather.orbits.closed_form import symmetric
from contbreather.orbits.closure import smallest_amplitude
from contbreather.orbits.orbit import Orbit
from contbreather.parameters import NUMBERS, parameter
from contbreather.stability.one_impact import half_map
from contbreather.stability.verdict import THRESHOLD, check_threshold
from contbreather.stability.zeros import nearest_pair, outermost

Array = NDArray[Any]

SITES = 400
upper = partial(symmetric, root=1)  # behind a wall, too: where the line ends is sought there


@dataclass(frozen=True, eq=False)
class ThresholdLine:
    """Line at one k on which the largest multiplier over 2 pi has the modulus of the threshold.

    Attributes
    ----------
    kind : str
        ``"NS"`` for complex pairs, ``"PF"`` for a real multiplier.
    k, threshold : float
    sites : int
        Length of the ring.
    gamma, a, angle : ndarray
        Along the line; the angle of the multiplier of QS in units of pi.
    """

    kind: str
    k: float
    sites: int
    threshold: float
    gamma: Array
    a: Array
    angle: Array

    def __repr__(self) -> str:
        reach = f", gamma {min(self.gamma):.6g} to {max(self.gamma):.6g}" if self.gamma.size else ""
        return (
            f"<ThresholdLine {self.kind}, ring of {self.sites}, k = {self.k:g}, threshold "
            f"{self.threshold:g}: {self.gamma.size} points{reach}>"
        )


class ThresholdPoint(NamedTuple):
    """The first coupling at which a pair reaches the threshold, and the angle/pi of that pair."""

    gamma: float
    angle: float


def neimark_sacker_point(
    a: float, k: float, *, sites: int | None = SITES, threshold: float = THRESHOLD
) -> ThresholdPoint:
    """The coupling at which the paper's rule sees the Neimark-Sacker bifurcation.

    Parameters
    ----------
    a, k : float
        Amplitude of the forcing, restitution.
    sites : int or None
        Length of the ring; None for the limit of long rings, where only an isolated pair of the
        infinite chain can be beyond a threshold.
    threshold : float
        For moduli over the full period 2 pi.

    Raises
    ------
    BadInput
        If the threshold is not above 1.
    NotConverged
        If no pair reaches the threshold.

    Examples
    --------
    >>> [round(neimark_sacker_point(0.2, 0.8, sites=n).gamma, 7) for n in (200, 400, 800)]
    [0.082409, 0.0915527, 0.0968769]
    """
    return _first(lambda gamma: upper(a, gamma, k), sites, threshold)


def neimark_sacker_line(
    k: float, *, sites: int = SITES, threshold: float = THRESHOLD, points: int = 100
) -> ThresholdLine:
    """Follow the paper's Neimark-Sacker line from the fold to the upper limit of existence.

    Parameters
    ----------
    k : float
    sites : int
    threshold : float
    points : int
        Values of a, evenly spaced; each point on the line is exact.

    Returns
    -------
    ThresholdLine

    Examples
    --------
    >>> line = neimark_sacker_line(0.8, sites=100, points=9)
    >>> round(float(line.gamma.min()), 3)
    0.048
    """
    from scipy.optimize import brentq  # dear to import

    points = whole("points", points, 1)
    lowest = _first(
        lambda gamma: upper(smallest_amplitude(gamma, k), gamma, k), sites, threshold
    )  # on the fold
    start = smallest_amplitude(lowest.gamma, k)
    crossings = {start: lowest}

    def at(a: float) -> ThresholdPoint:
        if a not in crossings:
            guess = crossings[min(crossings, key=lambda known: abs(known - a))].gamma
            crossings[a] = _first(lambda gamma: upper(a, gamma, k), sites, threshold, guess)
        return crossings[a]

    def margin(a: float) -> float:
        return upper(a, at(a).gamma, k).admissibility().margin

    # in steps of 0.05 to where the line leaves the region in which breathers exist
    end, steps = start, np.arange(0.05 * math.ceil(start / 0.05 + 0.5), 1.0, 0.05).tolist()
    for high in steps:
        if margin(high) <= 0.0:
            end = float(brentq(margin, end, high, xtol=1e-13))
            break
        end = high
    amplitudes = np.linspace(start, end, points)
    gamma, angle = np.array([at(a) for a in amplitudes.tolist()]).T
    return ThresholdLine("NS", k, sites, threshold, gamma, amplitudes, angle)


def pitchfork_line(
    k: float, gamma: Iterable[float], *, sites: int = SITES, threshold: float = THRESHOLD
) -> ThresholdLine:
    """The paper's pitchfork line: a real multiplier of QS at the square root of the threshold.

    D is linear in b, so at each coupling b is known at once, from it p by (19) and a by (13).

    Examples
    --------
    >>> round(float(pitchfork_line(0.8, [0.05]).a[0]), 6)  # exact line: 0.803643
    0.803983
    """
    check_threshold(threshold)
    radius, chain, ring = math.sqrt(threshold), InfiniteChain(), Ring(sites)
    couplings = row("gamma", gamma, "couplings")
    parameter("k", k)
    amplitudes = []
    for coupling in couplings.tolist():
        D = half_map(coupling, k, 0.0, ring).gradient(0.0, radius)
        b = -D.value.real / D.d_b.real
        p = 1.0 / (chain.chi(coupling) - chain.eta(coupling) - 2.0 * b / (1.0 + k) ** 2)
        amplitudes.append(math.hypot(1.0 - p * chain.chi(coupling), p * (1.0 - k) / (1.0 + k)))
    return ThresholdLine(
        "PF", k, sites, threshold, couplings, np.array(amplitudes), np.zeros(couplings.size)
    )


# --- the first pair to cross ------------------------------------------------------------------


@one_thread
def _first(
    path: Callable[[float], Orbit], sites: int | None, threshold: float, guess: float = 0.02
) -> ThresholdPoint:
    """Find the first coupling, next to a guess, at which a pair of multipliers of QS passes the
    circle of a threshold; below 0.02 there is no band to speak of."""
    from scipy.optimize import brentq  # dear to import

    lattice: Any = InfiniteChain() if sites is None else Ring(sites)
    check_threshold(threshold)
    radius = math.sqrt(threshold)  # of QS; its square they have over 2 pi

    def map_at(gamma: float) -> Any:  # of the infinite chain's breather, as one of the lattice
        breather = path(gamma)
        return half_map(gamma, breather.k, breather.representation.b, lattice)

    @cache
    def excess(gamma: float) -> float:
        map = map_at(gamma)
        if sites is None:
            return outermost(map.unstable_multipliers(), radius)
        return float(map.outermost(radius))

    low, back, last = guess, 1e-4, NUMBERS["gamma"].high - 1e-7
    while excess(low) > 0.0:
        low, back = low - back, 2.0 * back
        if low <= 0.0:
            raise NotConverged(
                f"pairs beyond the modulus {radius**2:g} at every coupling below {guess}"
            )
    high = low
    while excess(high) <= 0.0:
        if high >= last:
            reason = f"no pair of multipliers reaches the modulus {radius**2:g} below 1/4"
            raise NotConverged(reason)
        low, high = high, min(high + 3e-3, last)
    gamma = float(brentq(excess, low, high, xtol=1e-12))
    map = map_at(gamma)
    if sites is None:
        return ThresholdPoint(gamma, nearest_pair(map.unstable_multipliers(), radius))
    near = map.reduced.around(radius)
    return ThresholdPoint(gamma, nearest_pair(map.coupled if near is None else near.zeros, radius))
