"""Verdicts: each names the lattice it is about, and the threshold where there is one.

The infinite chain has a sharp answer, the number of isolated multipliers outside the unit circle.
A finite lattice has none: on a ring waves that come back amplified put its band at
``|mu| - 1 = O(1/N)``, so the paper's rule compares the largest multiplier with a threshold. Its
"eigenvalues of the monodromy matrix ... crossed a threshold of 1.005" are those of (QS)^2, eq.
(20): read so, the Neimark-Sacker line at a = 0.2, k = 0.8 is at gamma = 0.0824, 0.0916, 0.0969 for
N = 200, 400, 800.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import brief, real
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import check_gamma
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.parameters import parameter
from contbreather.stability.one_impact import EDGE, HalfMap, half_map
from contbreather.stability.saltation import check_finite
from contbreather.stability.scattering import OverReflection, over_reflection, over_reflects
from contbreather.tables import HtmlRepr, Sheet, yes_or_no

Array = NDArray[Any]

THRESHOLD = 1.005  # the paper's, for multipliers over the full period 2 pi


@dataclass(frozen=True, repr=False)
class Verdict(HtmlRepr):
    """Stability of an orbit: on which lattice, and by which threshold.

    Attributes
    ----------
    lattice : str
    period : float
        Of the orbit.
    threshold : float or None
        For the moduli of multipliers over the period. None on the infinite chain, whose answer is
        exact: isolated multipliers strictly outside the unit circle.
    unstable : int
        How many multipliers are beyond that, a pair counting two; NaN where an impact vanishes, at
        VI, and multipliers mean nothing.
    certain : bool
        False where one of them sits on the unit circle to within rounding, at ``exp(i pi nu)``, or
        where gamma is within rounding of 1/4.
    """

    lattice: str
    period: float
    threshold: float | None
    unstable: float
    certain: bool = True
    nu: float = math.nan
    map: Any = field(kw_only=True, compare=False)

    @property
    def stable(self) -> bool | None:
        """None where nothing can be said."""
        return None if math.isnan(self.unstable) else self.unstable == 0

    def __bool__(self) -> bool:
        return bool(self.stable)

    def blank(self) -> Verdict:
        """The verdict where there is none: an impact vanishes, and its saltation has a pole."""
        return replace(self, unstable=math.nan, certain=False)

    @property
    def _of_half(self) -> bool:
        return self.threshold is None and self.map is not None and self.map.sign < 0

    @cached_property
    def multipliers(self) -> Array:
        """Multipliers beyond the threshold over the period, largest first; on the infinite chain
        those outside the unit circle, of a symmetric breather over half its period (QS)."""
        if self.stable is None:
            return np.empty(0, dtype=complex)
        if self.threshold is None:
            return self.map.unstable_multipliers()
        mu = self.map.over_period
        mu = mu[np.abs(mu) > self.threshold]
        return mu[np.lexsort((-mu.imag, -np.round(np.abs(mu), 12)))]  # conjugates side by side

    @cached_property
    def largest(self) -> float:
        """Largest modulus of all multipliers; the band of the infinite chain has 1."""
        if self.stable is None:
            return math.nan
        if self.threshold is None:
            return float(np.abs(self.multipliers).max(initial=1.0))
        return float(np.abs(self.map.over_period).max(initial=self.map.idle))

    @cached_property
    def over_reflecting(self) -> bool:
        """True if waves come back amplified: long enough rings are weakly unstable.

        Raises
        ------
        BadInput
            Unless this is about a symmetric breather on the infinite chain.
        """
        return over_reflects(self._half())

    @cached_property
    def over_reflection(self) -> OverReflection:
        """By how much, and at which angle."""
        return over_reflection(self._half())

    def _half(self) -> HalfMap:
        if self._of_half:
            half: HalfMap = self.map
            return half
        raise BadInput(
            f"{self.lattice}: over-reflection is known of symmetric breathers on the infinite "
            "chain; ask symmetric(a, gamma, k).stability() for it."
        )

    def table(self) -> Sheet:
        half = self._of_half
        circle = "the unit circle" if self.threshold is None else "the threshold"
        which = f"multipliers {'of QS ' * half}outside {circle}"
        rows: list[tuple[str, Any]] = [
            ("lattice", self.lattice),
            ("stable", yes_or_no(self.stable)),
            (which, None if self.stable is None else self.unstable),
        ]
        if self.threshold is not None:
            rows += [("threshold", self.threshold), ("largest |multiplier|", self.largest)]
        elif half and self.stable is not None:
            rows += [("waves come back amplified", yes_or_no(self.over_reflecting))]
        rows += [(f"multiplier {i}", complex(mu)) for i, mu in enumerate(self.multipliers, 1)]
        return Sheet.of([(name, None if value != value else value) for name, value in rows])

    def describe(self) -> str:
        if self.stable is None:
            return f"{self.lattice}: nothing is said of stability where an impact vanishes"
        several = f"{self.unstable or 'no'} multiplier{'s' * (self.unstable > 1)}"
        if self.threshold is None:
            word = "stable, " if self.stable else "unstable, "
            return f"{self.lattice}: {word}{several} of {self._on_the_chain()}"
        word, sign = ("stable", "<=") if self.stable else (f"unstable, {several}", ">")
        return (
            f"{self.lattice}: {word}; largest |multiplier| over {self.period / math.pi:.4g} pi "
            f"{self.largest:.9g} {sign} threshold {self.threshold:g}"
        )

    def _on_the_chain(self) -> str:
        half = self.map.sign < 0
        text = f"{'QS' if half else 'the orbit'} outside the unit circle"
        if not self.certain and 0.25 * (1.0 - self.map.lattice.spring) - self.map.gamma <= EDGE:
            text += "; uncertain, the band's edge is within rounding of mu = -1"
        elif not self.certain:
            text += f"; one on it to within rounding, at the angle {self.nu:.6g} pi"
        if half and self.over_reflecting:
            text += "; reflects waves amplified, so long rings are weakly unstable"
        return text

    def __repr__(self) -> str:
        return f"<{self.describe()}>"


def threshold_on(lattice: Any, threshold: float | None) -> float:
    """The paper's unless one is given; the infinite chain takes none."""
    if threshold is not None and lattice.sites is None:
        raise BadInput(
            f"threshold = {brief(threshold)}: the infinite chain has none, its verdict is exact; "
            "name a finite lattice, Ring(400) or 'ring:400'"
        )
    return THRESHOLD if threshold is None else threshold


def check_threshold(threshold: float, neutral: bool = True) -> None:
    """Refuse what is no threshold for a lattice, with modes that are neutral or without."""
    if not 1.0 <= real(threshold) < math.inf or (neutral and threshold == 1.0):
        wanted = "a finite modulus of at least 1 is expected"
        if neutral:
            wanted = (
                "a lattice without damping always has multipliers on the unit circle, so a finite "
                "threshold above 1 is expected"
            )
        raise BadInput(f"threshold = {brief(threshold)}: {wanted} (the paper takes 1.005).")


def verdict(map: Any, threshold: float = THRESHOLD) -> Verdict:
    """The verdict on an orbit, by its map of small perturbations; on a finite lattice it is
    unstable if a multiplier over the period exceeds a threshold in modulus, of at least 1, and
    above that where some modes are neutral.

    Examples
    --------
    >>> from contbreather.stability.chain_map import OrbitMap
    >>> verdict(OrbitMap(0.04, 0.8, [(0, 0.0, 0.5), (0, 3.0, 0.5)]))
    <infinite chain: stable, no multiplier of the orbit outside the unit circle>
    """
    name = map.lattice.describe()
    if map.lattice.sites is None:
        count = map.count()
        return Verdict(name, map.period, None, count.count, count.certain, count.nu, map=map)
    # modes without impacts are on the circle where nothing damps them
    check_threshold(threshold, neutral=map.idle == 1.0)
    beyond = int(np.count_nonzero(np.abs(map.over_period) > threshold))
    return Verdict(name, map.period, float(threshold), beyond, map=map)


def stability(
    gamma: float,
    k: float,
    b: float,
    lattice: Any = InfiniteChain(),
    *,
    sites: int | None = None,
    threshold: float = THRESHOLD,
) -> Verdict:
    """Is a symmetric breather with this saltation stable, in the infinite chain or on a ring?

    Parameters
    ----------
    gamma, k, b : float
        Coupling, restitution, off-diagonal entry of the saltation matrix (19).
    lattice : InfiniteChain or Ring
    sites : int, optional
        Short for ``lattice=Ring(sites)``.
    threshold : float
        On a ring: unstable if a multiplier over 2 pi exceeds it in modulus.

    Raises
    ------
    BadInput
        For parameters out of range, or a threshold not above 1.

    Examples
    --------
    >>> stability(0.11, 0.8, -0.28657)
    <infinite chain: unstable, 2 multipliers of QS outside the unit circle; reflects waves \
amplified, so long rings are weakly unstable>
    >>> stability(0.05, 0.8, 0.2, sites=400)
    <ring of 400: stable; largest |multiplier| over 2 pi 1.00035565 <= threshold 1.005>
    """
    on = lattice if sites is None else Ring(sites)
    if not isinstance(on, InfiniteChain | Ring):
        raise BadInput(f"lattice = {on!r}: stability is known for InfiniteChain() and Ring(sites).")
    gamma, k = check_gamma(gamma, on.spring), parameter("k", k)
    check_finite(k, b)
    return verdict(half_map(gamma, k, b, on), threshold)
