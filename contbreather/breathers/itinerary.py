"""Which site hits which wall, in what order, and how that closes: what an orbit is asked to be.

An orbit of period 2 pi n is a list of impacts ``(site, wall)``. A symmetric one, ``u(t + pi n) =
-u(t)``, is known from half of it: its section is half a period long and closes with the sign -1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.breathers.refusals import ImpossibleSequence
from contbreather.errors import BadInput
from contbreather.lattice import Ring

FloatArray = NDArray[np.float64]
Sequenced = tuple[tuple[int, int], ...]


class Basis(NamedTuple):
    """The modes of a ring that some impact sees, orthonormal over the sites.

    Mode j is ``sqrt(weight) cos(2 pi order (n - origin)/N)``, or the sine. Impacts of one site
    alone see its even modes only, half of all.
    """

    sites: int
    origin: int
    order: NDArray[np.int64]  # (K,)
    sine: NDArray[np.bool_]  # (K,)
    weight: FloatArray  # (K,)
    q: FloatArray  # (K,): w^2 = 4 gamma q

    def at(self, n: ArrayLike) -> FloatArray:
        """Value of each mode at the sites n, shape ``(..., K)``."""
        apart = (np.asarray(n)[..., None] - self.origin) * self.order % self.sites
        angle = 2.0 * np.pi / self.sites * apart
        return np.asarray(np.sqrt(self.weight) * np.where(self.sine, np.sin(angle), np.cos(angle)))

    def to_sites(self, modes: FloatArray) -> FloatArray:
        """Amplitudes of modes ``(..., K)`` as values at all sites ``(..., N)``."""
        scaled = modes / np.sqrt(self.weight)
        half = self.sites // 2 + 1
        spectrum = np.zeros((*modes.shape[:-1], half), dtype=complex)
        spectrum[..., self.order[~self.sine]] = scaled[..., ~self.sine]
        spectrum[..., self.order[self.sine]] -= 1j * scaled[..., self.sine]
        return np.roll(np.fft.irfft(spectrum, self.sites), self.origin, axis=-1)

    def from_sites(self, values: FloatArray) -> FloatArray:
        """Amplitudes of the modes, shape ``(..., K)``; what no impact sees is dropped."""
        spectrum = np.fft.rfft(np.roll(values, -self.origin, axis=-1))[..., self.order]
        return np.asarray(np.sqrt(self.weight) * np.where(self.sine, -spectrum.imag, spectrum.real))


@lru_cache(maxsize=128)
def basis_of(sites: int, hit: tuple[int, ...]) -> Basis:
    """The modes of a ring that impacts at the sites ``hit`` can excite."""
    half = sites // 2
    order, sine = np.arange(half + 1), np.zeros(half + 1, dtype=bool)
    if len(set(hit)) > 1:
        waves = np.arange(1, (sites + 1) // 2)
        order = np.concatenate([order, waves])
        sine = np.concatenate([sine, np.ones(waves.size, dtype=bool)])
    alone = (order == 0) | (2 * order == sites)
    return Basis(
        sites,
        hit[0],
        order,
        sine,
        np.where(alone, 1.0, 2.0) / sites,
        np.sin(np.pi * order / sites) ** 2,
    )


@dataclass(frozen=True)
class Itinerary:
    """Ring, impacts of one section in order, and how the section closes.

    Parameters
    ----------
    sites : int
        N, at least 1.
    impacts : sequence of (site, wall)
        Of one period; of half a period if `symmetric`. Walls are +1 and -1. Impacts of one site
        come in this order; those of different sites may overtake each other.
    turns : int
        n, for the period 2 pi n.
    symmetric : bool
        The second half of the period repeats the first with opposite sign; n must be odd.

    Raises
    ------
    BadInput
        No impact; a site off the ring; a wall that is not +1 or -1; all impacts on one wall,
        which would push an undamped ring away for ever.

    Examples
    --------
    >>> Itinerary(20, ((0, 1), (0, -1))).length == 2 * math.pi
    True
    >>> Itinerary(20, ((0, 1),), symmetric=True).length == math.pi
    True
    """

    sites: int
    impacts: Sequenced
    turns: int = 1
    symmetric: bool = False

    def __post_init__(self) -> None:
        Ring(self.sites)
        object.__setattr__(self, "impacts", checked_impacts(self.sites, self.impacts))
        if not _whole(self.turns) or self.turns < 1:
            raise BadInput(f"turns = {self.turns!r}: periods are 2 pi n with a whole n >= 1.")
        if self.symmetric and self.turns % 2 == 0:
            raise BadInput(
                f"a symmetric orbit of period {2 * self.turns} pi: u(t + pi n) = -u(t) needs an "
                f"odd n, because the forcing changes sign after pi; n = {self.turns} was given."
            )
        walls = {wall for _, wall in self.impacts}
        if not self.symmetric and len(walls) == 1:
            raise ImpossibleSequence(
                f"the sequence {self.impacts} hits the wall at {walls.pop():+d} only: every impact "
                "pushes the undamped ring the same way and it never comes back; let it hit both.",
                sequence=self.impacts,
            )

    @property
    def ring(self) -> Ring:
        return Ring(self.sites)

    @property
    def basis(self) -> Basis:
        return basis_of(self.sites, tuple(n for n, _ in self.impacts))

    @property
    def count(self) -> int:
        """Impacts in a section."""
        return len(self.impacts)

    @property
    def period(self) -> float:
        return 2.0 * math.pi * self.turns

    @property
    def sign(self) -> float:
        """The state after a section is this many times that before."""
        return -1.0 if self.symmetric else 1.0

    @property
    def length(self) -> float:
        """Of a section."""
        return 0.5 * self.period if self.symmetric else self.period

    @property
    def hit(self) -> tuple[int, ...]:
        """The sites that hit a wall."""
        return tuple(sorted({n for n, _ in self.impacts}))

    @property
    def local(self) -> bool:
        """Whether one site alone hits its walls: then the ring moves as its own mirror image."""
        return len(self.hit) == 1

    def whole(self) -> Itinerary:
        """The impacts of the full period, without use of the symmetry."""
        if not self.symmetric:
            return self
        mirrored = tuple((n, -wall) for n, wall in self.impacts)
        return Itinerary(self.sites, self.impacts + mirrored, self.turns)

    def doubled(self) -> Itinerary:
        """The same impacts twice, over twice the period."""
        if self.symmetric:
            raise BadInput(
                "a symmetric orbit does not double its period; break its symmetry first: unfolded"
            )
        return Itinerary(self.sites, self.impacts * 2, 2 * self.turns)

    def describe(self) -> str:
        told = " ".join(f"{n}{'+' if wall > 0 else '-'}" for n, wall in self.impacts)
        half = ", half of a symmetric orbit" if self.symmetric else ""
        return f"ring of {self.sites}, period {2 * self.turns} pi, impacts {told}{half}"


def checked_impacts(sites: int, impacts: Sequence[Any]) -> Sequenced:
    """The impacts as pairs of whole numbers, or what is wrong with them."""
    try:
        pairs = [(site, wall) for site, wall in impacts]
    except (TypeError, ValueError) as error:
        raise ImpossibleSequence(
            f"sequence = {impacts!r}: impacts are pairs (site, wall), for instance "
            f"((0, 1), (0, -1)); {error}.",
            sequence=impacts,
        ) from error
    if not pairs:
        raise ImpossibleSequence(
            "the sequence of impacts is empty: without impacts the ring only follows its forcing; "
            "give pairs (site, wall), for instance ((0, 1), (0, -1)).",
            sequence=impacts,
        )
    for site, wall in pairs:
        if not _whole(site) or not -sites < site < sites:
            raise ImpossibleSequence(
                f"impact ({site!r}, {wall!r}): no such site on a ring of {sites}; sites are whole "
                f"numbers from 0 to {sites - 1}.",
                sequence=impacts,
            )
        if isinstance(wall, bool) or wall not in (1, -1):
            raise ImpossibleSequence(
                f"impact ({site!r}, {wall!r}): walls are +1 and -1.", sequence=impacts
            )
    return tuple((int(site) % sites, int(wall)) for site, wall in pairs)


def _whole(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
