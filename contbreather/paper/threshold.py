"""The paper's rule for stability: a ring, and a threshold for the modulus of its multipliers.

"The loss of stability has been recorded ... when the eigenvalue of the monodromy matrix (or couple
of the complex conjugate eigenvalues) with the largest absolute value crossed a threshold of 1.005",
at N = 400. The monodromy matrix is (QS)^2, eq. (20), of the ring, with b of the exact breather of
the infinite chain. Which multiplier is the largest changes along the line, so the line is the
envelope of the curves of single multipliers: it is found by Newton's method for all pairs at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import real, row, whole
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.orbits.closed_form import symmetric
from contbreather.orbits.closure import smallest_amplitude
from contbreather.orbits.orbit import Orbit
from contbreather.parameters import NUMBERS, parameter
from contbreather.stability.characteristic import D
from contbreather.stability.counting import unstable_multipliers
from contbreather.stability.ring_multipliers import even_multipliers
from contbreather.stability.verdict import THRESHOLD

Array = NDArray[Any]
Path = Callable[[float], Orbit]

SITES = 400
NEAREST = 24  # pairs with the largest modulus; the next one to cross is among them
TINY = 1e-7  # step in gamma of the derivative of a multiplier
STRIDE = 3e-3  # longest step in gamma
SETTLED = 1e-12
upper = partial(symmetric, root=1)  # behind a wall, too: where the line ends is sought there
FIRST = 0.02  # of the couplings looked at; below there is no band to speak of


@dataclass(frozen=True, eq=False)
class ThresholdLine:
    """Where the largest multiplier over 2 pi has the modulus of the threshold, at one k.

    Attributes
    ----------
    kind : str
        ``"NS"`` for complex pairs, ``"PF"`` for a real multiplier.
    k, threshold : float
    sites : int or None
        Length of the ring; None for the infinite chain.
    gamma, a, angle : ndarray
        Along the line; the angle of the multiplier of QS in units of pi.
    """

    kind: str
    k: float
    sites: int | None
    threshold: float
    gamma: Array
    a: Array
    angle: Array

    def __repr__(self) -> str:
        chain = "infinite chain" if self.sites is None else f"ring of {self.sites}"
        reach = f"gamma {min(self.gamma):.6g} to {max(self.gamma):.6g}" if len(self.gamma) else ""
        return (
            f"<ThresholdLine {self.kind}, {chain}, k = {self.k:g}, threshold {self.threshold:g}: "
            f"{len(self.gamma)} points{', ' * bool(reach)}{reach}>"
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
    return first_crossing(lambda gamma: upper(a, gamma, k), FIRST, _pairs_of(sites), threshold)


def neimark_sacker_line(
    k: float, *, sites: int = SITES, threshold: float = THRESHOLD, points: int = 100
) -> ThresholdLine:
    """The paper's Neimark-Sacker line from the fold to the upper limit of existence.

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
    >>> line = neimark_sacker_line(0.8, points=9)
    >>> round(float(line.gamma.min()), 3)
    0.082
    """
    points, pairs = whole("points", points, 1), _pairs_of(sites)
    lowest = first_crossing(
        lambda gamma: upper(smallest_amplitude(gamma, k), gamma, k), FIRST, pairs, threshold
    )
    start = smallest_amplitude(lowest.gamma, k)
    crossings = {start: lowest}

    def at(a: float) -> ThresholdPoint:
        if a not in crossings:
            guess = crossings[min(crossings, key=lambda known: abs(known - a))].gamma
            crossings[a] = first_crossing(lambda gamma: upper(a, gamma, k), guess, pairs, threshold)
        return crossings[a]

    end = _upper_end(k, at, start)
    amplitudes = np.linspace(start, end, points)
    line = [at(float(a)) for a in amplitudes]
    gamma, angle = (np.array(column) for column in zip(*line, strict=True))
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
    nu = 1j * _depth(threshold)
    chain, ring = InfiniteChain(), Ring(sites)
    couplings = row("gamma", gamma, "couplings")
    parameter("k", k)
    amplitudes = []
    for coupling in couplings.tolist():
        at_zero = complex(D(coupling, nu, k, 0.0, ring)).real
        b = -at_zero / (complex(D(coupling, nu, k, 1.0, ring)).real - at_zero)
        p = 1.0 / (chain.chi(coupling) - chain.eta(coupling) - 2.0 * b / (1.0 + k) ** 2)
        amplitudes.append(math.hypot(1.0 - p * chain.chi(coupling), p * (1.0 - k) / (1.0 + k)))
    return ThresholdLine(
        "PF", k, sites, threshold, couplings, np.array(amplitudes), np.zeros(couplings.size)
    )


# --- the first pair to cross ------------------------------------------------------------------


def _pairs_of(sites: int | None) -> Callable[[Orbit], Array]:
    """Multipliers of QS in the open upper half plane that can pass a threshold."""
    ring = None if sites is None else Ring(sites)

    def pairs(breather: Orbit) -> Array:
        here = breather.gamma, breather.k, breather.representation.b
        mu = unstable_multipliers(*here) if ring is None else even_multipliers(ring, *here)
        return np.asarray(mu[mu.imag > 1e-9])

    return pairs


def _depth(threshold: float) -> float:
    """Im nu where ``|exp(i pi nu)|^2`` is the threshold."""
    if not 1.0 < real(threshold) < math.inf:
        raise BadInput(
            f"threshold = {threshold}: multipliers of a ring sit on the unit circle; a modulus "
            "above 1 is expected, 1.005 in the paper"
        )
    return -0.5 * math.log(threshold) / math.pi


def _excess(mu: Array, threshold: float) -> Array:
    return 2.0 * np.log(np.abs(mu)) - math.log(threshold)


def first_crossing(
    path: Path, guess: float, pairs: Callable[[Orbit], Array], threshold: float
) -> ThresholdPoint:
    """Newton's method on the envelope, from a coupling before it."""
    _depth(threshold)
    gamma = _before(path, guess, pairs, threshold)
    for _ in range(200):
        following, angle = _next(path, gamma, pairs, threshold)
        step = min(following - gamma, STRIDE)
        gamma += step
        if gamma >= NUMBERS["gamma"].high - TINY:
            break
        if abs(step) < SETTLED:
            return ThresholdPoint(gamma, angle)
    raise NotConverged(f"no pair of multipliers reaches the modulus {threshold} below 1/4")


def _before(path: Path, guess: float, pairs: Callable[[Orbit], Array], threshold: float) -> float:
    """A coupling at or below the guess where no pair is beyond the threshold."""
    gamma, back = guess, 1e-4
    while gamma > 0.0:
        mu = pairs(path(gamma))
        if mu.size == 0 or _excess(mu, threshold).max() <= 0.0:
            return gamma
        gamma, back = gamma - back, 2.0 * back
    raise NotConverged(f"pairs beyond the modulus {threshold} at every coupling below {guess}")


def _next(
    path: Path, gamma: float, pairs: Callable[[Orbit], Array], threshold: float
) -> tuple[float, float]:
    """Where, to first order, the first of all pairs reaches the threshold, and its angle."""
    here, there = pairs(path(gamma)), pairs(path(gamma + TINY))
    if here.size == 0 or there.size == 0:
        return math.inf, math.nan
    here = here[np.argsort(-np.abs(here))[:NEAREST]]
    there = there[np.argmin(np.abs(here[:, None] - there), axis=1)]
    excess = _excess(here, threshold)
    slope = (_excess(there, threshold) - excess) / TINY
    growing = slope > 0.0
    reached = np.where(growing, gamma - excess / np.where(growing, slope, 1.0), np.inf)
    first = int(reached.argmin())
    return float(reached[first]), float(np.angle(here[first]) / math.pi)


def _upper_end(k: float, at: Callable[[float], ThresholdPoint], start: float) -> float:
    """The amplitude at which the line leaves the region where breathers exist."""
    from scipy.optimize import brentq  # dear to import

    def margin(a: float) -> float:
        return upper(a, at(a).gamma, k).admissibility().margin

    low = start
    for high in np.arange(0.05 * math.ceil(start / 0.05 + 0.5), 1.0, 0.05).tolist():
        if margin(high) <= 0.0:
            return float(brentq(margin, low, high, xtol=1e-13))
        low = high
    return low
