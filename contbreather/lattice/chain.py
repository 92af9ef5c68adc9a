"""The infinite chain and the ring: the band of each, its means and its modes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import brief, number, whole
from contbreather.errors import BadInput
from contbreather.lattice.band_averages import (
    UniformLattice,
    band_averages,
    check_gamma,
    means_of_chains,
    quarter_wave,
)
from contbreather.lattice.finite import ALL_ALIKE, ROWS, PlaneWaves, plane_waves
from contbreather.parameters import NUMBERS

FloatArray = NDArray[np.float64]


LONGEST = 10**7  # sites of a ring: of longer ones a few rows of numbers fill the memory


@dataclass(frozen=True, repr=False)
class InfiniteChain(UniformLattice):
    """The infinite chain with nearest-neighbour coupling, eq. (1).

    Examples
    --------
    >>> round(InfiniteChain().chi(0.12), 13)
    2.0678739703938
    """

    spring: float = 0.0  # to the ground, at every site
    sites = None  # no end: there is a far field

    def __post_init__(self) -> None:
        wanted = "0 <= spring < 1, a band below the drive (above that take a ring of 40 sites)"
        spring = number("spring", self.spring, 0.0, 1.0, wanted)
        check_gamma(0.0, spring)
        object.__setattr__(self, "spring", spring)
        object.__setattr__(self, "_expansions", band_averages(None, spring))

    def with_spring(self, spring: float) -> InfiniteChain:
        return self if spring == self.spring else _with_spring(spring)

    def __repr__(self) -> str:
        return f"InfiniteChain({self.spring or ''})"

    def describe(self) -> str:
        return "infinite chain"

    def tau(self, gamma: Any, edge: Any = None) -> Any:
        """``<cot(pi w/2)/w>``: what a mean push does; infinite where no spring holds the chain.

        ``edge``, the lower one of the band, is the root of the spring unless given: 1/tau is smooth
        in both.
        """
        edge = np.sqrt(self.spring) if edge is None else edge
        stiff = 0.5 * math.pi * edge * np.sqrt(edge * edge + 4.0 * gamma)
        with np.errstate(divide="ignore"):
            return np.divide(1.0, stiff) + self.mean(gamma, "tau")

    def dtau(self, gamma: float) -> float:
        """Derivative of `tau` with respect to gamma, for a spring above 0."""
        s, edge = self.spring, self.spring + 4.0 * gamma
        return self.slope(gamma, "tau") - 4.0 / (math.pi * edge * math.sqrt(s * edge))

    def distance(self, n: Any) -> Any:
        """Number of bonds from site n to the impacting site 0; of an array for each."""
        return abs(n)

    def beside(self, n: int) -> tuple[int, ...]:
        return (n - 1, n + 1)


_with_spring = lru_cache(maxsize=64)(InfiniteChain)


class Chains:
    """Infinite chains of many couplings, and perhaps of as many springs."""

    sites = None
    tau = InfiniteChain.tau

    def __init__(self, gamma: FloatArray, spring: Any = 0.0) -> None:
        self.spring, self._means = spring, means_of_chains(gamma, spring)

    def mean(self, gamma: FloatArray, name: str) -> FloatArray:
        """A mean of each chain, at its own coupling."""
        return self._means[name]


@dataclass(frozen=True)
class Ring(UniformLattice):
    """A ring of ``sites`` sites: the same chain closed on itself.

    One site is a single oscillator (the coupling drops out); on two sites both neighbours are
    the same one, so its stiffness matrix is ``gamma [[2, -2], [-2, 2]]``.

    Examples
    --------
    >>> abs(Ring(200).chi(0.12) - InfiniteChain().chi(0.12)) < 1e-15
    True
    """

    sites: int
    spring = 0.0  # closed forms of rings are without
    driven_modes = ALL_ALIKE
    highest_gamma = NUMBERS["gamma"].domain[1]  # of curves

    def __new__(cls, *sites: int, **given: Any) -> Ring:
        for name in (name for name in ROWS if name in given):
            raise BadInput(
                f"{name} = {brief(given[name])}: all sites of a ring are alike; rows are of "
                f"Lattice(stiffness, {name}=), masses also of Oscillators"
            )
        return super().__new__(cls)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sites", whole("sites", self.sites, 1))
        if self.sites > LONGEST:
            raise BadInput(
                f"sites = {self.sites}: a ring has at most {LONGEST}; one that long is the "
                "infinite chain, InfiniteChain()."
            )
        object.__setattr__(self, "_expansions", band_averages(self.sites))

    # ----------------------------------------------------------------- as a finite lattice

    @property
    def masses(self) -> FloatArray:
        return np.ones(self.sites)

    drive = springs = dampings = restitutions = masses
    even = True

    def basis(self, hit: tuple[int, ...]) -> PlaneWaves:
        """The modes that impacts at the sites `hit` can excite."""
        return plane_waves(self.sites, hit)

    def beside(self, n: int) -> tuple[int, ...]:
        return tuple(sorted({(n + d) % self.sites for d in (-1, 1)} - {n}))

    def describe(self) -> str:
        return f"ring of {self.sites}"

    # ------------------------------------------------------------------ as a chain of period N

    def distance(self, n: Any) -> Any:
        """Number of bonds from site n to site 0, the shorter way round; of an array for each."""
        half = self.sites // 2
        return abs((n + half) % self.sites - half)

    def first_harmonic(self, gamma: float, n: ArrayLike, by: str = "") -> FloatArray:
        m, size = self.distance(np.asarray(n)), self.sites
        if not (by and size % 2 and size * math.sqrt(1.0 - 4.0 * check_gamma(gamma)) < 1.0):
            return super().first_harmonic(gamma, n, by)
        theta, weight, _ = self.nodes(0.0)  # as `excess_slope` does
        q, c = np.transpose([quarter_wave(j, size) for j in range(theta.size)])
        wave = np.cos(2.0 * np.pi / size * (np.multiply.outer(m, np.arange(q.size)) % size))
        return np.asarray(4.0 * wave @ (weight * q / ((1.0 - 4.0 * gamma) + 4.0 * gamma * c) ** 2))

    def frequencies(self, gamma: float) -> FloatArray:
        """``w_j = 2 sqrt(gamma) |sin(pi j/N)|``, j = 0..N-1."""
        gamma = check_gamma(gamma)
        j = np.arange(self.sites)
        # sin(pi j/N) and sin(pi (N-j)/N) must be the same number: degenerate pairs stay so
        return 2.0 * math.sqrt(gamma) * np.sin(np.pi * np.minimum(j, self.sites - j) / self.sites)

    def nodes(self, gamma: float) -> tuple[FloatArray, ...]:
        """The ring's own modes, those at theta and -theta counted together.

        Returns
        -------
        theta, weight, w : ndarray, shape (N//2 + 1,)
        """
        j = np.arange(self.sites // 2 + 1)
        weight = np.where((j == 0) | (2 * j == self.sites), 1.0, 2.0) / self.sites
        return 2.0 * np.pi * j / self.sites, weight, self.frequencies(gamma)[: j.size]


def lattice_of(given: object) -> UniformLattice:
    """The lattice that was given, the infinite chain if none was; anything else is refused."""
    if given is None:
        return InfiniteChain()
    if isinstance(given, type) or not hasattr(given, "first_harmonic"):
        raise BadInput(
            f"lattice = {given!r}: this needs InfiniteChain() or, for a ring of 20 sites, Ring(20)"
            "; where any finite one is taken OpenChain(9), Grid(5, 5), Lattice(stiffness) do, too."
        )
    if getattr(given, "spring", 0.0):
        raise BadInput(
            f"lattice = {given!r}: springs to the ground belong to the motion, not to its lattice; "
            "give them by spring=..., on InfiniteChain()."
        )
    return cast(UniformLattice, given)
