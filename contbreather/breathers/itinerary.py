"""Which site hits which wall, in what order, and how that closes: what an orbit is asked to be.

An orbit of period 2 pi n is a list of impacts ``(site, wall)``. A symmetric one, ``u(t + pi n) =
-u(t)``, is known from half of it: its section is half a period long and closes with the sign -1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from contbreather.breathers.refusals import ImpossibleSequence
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Walls
from contbreather.lattice.finite import Basis, Finite

Sequenced = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Itinerary:
    """Lattice, impacts of one section in order, and how the section closes.

    Parameters
    ----------
    lattice : Ring, Lattice
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
        No impact; a site off the lattice; a wall that is not +1 or -1.

    Examples
    --------
    >>> from contbreather.lattice import Ring
    >>> Itinerary(Ring(20), ((0, 1), (0, -1))).length == 2 * math.pi
    True
    >>> Itinerary(Ring(20), ((0, 1),), symmetric=True).length == math.pi
    True
    """

    lattice: Finite
    impacts: Sequenced
    turns: int = 1
    symmetric: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "impacts", checked_impacts(self.lattice, self.impacts))
        if not _whole(self.turns) or self.turns < 1:
            raise BadInput(f"turns = {self.turns!r}: periods are 2 pi n with a whole n >= 1.")
        if self.symmetric and self.turns % 2 == 0:
            raise BadInput(
                f"a symmetric orbit of period {2 * self.turns} pi: u(t + pi n) = -u(t) needs an "
                f"odd n, because the forcing changes sign after pi; n = {self.turns} was given."
            )

    @property
    def sites(self) -> int:
        return self.lattice.sites

    @cached_property
    def basis(self) -> Basis:
        return self.lattice.basis(self.hit)

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
        """Whether one site alone hits its walls."""
        return len(self.hit) == 1

    def whole(self) -> Itinerary:
        """The impacts of the full period, without use of the symmetry."""
        if not self.symmetric:
            return self
        mirrored = tuple((n, -wall) for n, wall in self.impacts)
        return Itinerary(self.lattice, self.impacts + mirrored, self.turns)

    def doubled(self) -> Itinerary:
        """The same impacts twice, over twice the period."""
        if self.symmetric:
            raise BadInput(
                "a symmetric orbit does not double its period; break its symmetry first: unfolded"
            )
        return Itinerary(self.lattice, self.impacts * 2, 2 * self.turns)

    def describe(self) -> str:
        told = " ".join(f"{n}{'+' if wall > 0 else '-'}" for n, wall in self.impacts)
        half = ", half of a symmetric orbit" if self.symmetric else ""
        return f"{self.lattice.describe()}, period {2 * self.turns} pi, impacts {told}{half}"


def check_walls(itinerary: Itinerary, walls: Walls) -> None:
    """`BadInput` where a site hits a wall that is not there, or half an orbit cannot stand for the
    other half."""
    for site, _ in walls.own:
        if not 0 <= site < itinerary.sites:
            raise BadInput(
                f"walls of site {site}: there is no such site on the "
                f"{itinerary.lattice.describe()}; sites are 0 to {itinerary.sites - 1}."
            )
    for site, wall in itinerary.impacts:
        if math.isinf(walls.position(site, wall)):
            raise ImpossibleSequence(
                f"impact ({site}, {wall:+d}): site {site} has no wall on that side.",
                sequence=itinerary.impacts,
            )
    if itinerary.symmetric and not walls.symmetric:
        raise BadInput(
            "the walls are not symmetric, so no orbit is its own mirror image half a period "
            "later: there is no half section and no pitchfork; shoot the whole period, "
            "symmetric=False."
        )


def checked_impacts(lattice: Finite, impacts: Sequence[Any]) -> Sequenced:
    """The impacts as pairs of whole numbers, or what is wrong with them."""
    try:
        pairs = [(site, wall) for site, wall in impacts]
    except (TypeError, ValueError) as error:
        raise ImpossibleSequence(
            f"sequence = {impacts!r}: impacts are pairs (site, wall), for instance "
            f"((0, 1), (0, -1)); {error}.",
            sequence=impacts,
        ) from error
    sites = lattice.sites
    if not pairs:
        raise ImpossibleSequence(
            "the sequence of impacts is empty: without impacts a lattice only follows its "
            "forcing; give pairs (site, wall), for instance ((0, 1), (0, -1)).",
            sequence=impacts,
        )
    for site, wall in pairs:
        if not _whole(site) or not -sites < site < sites:
            raise ImpossibleSequence(
                f"impact ({site!r}, {wall!r}): no such site on the {lattice.describe()}; sites are "
                f"whole numbers from 0 to {sites - 1}.",
                sequence=impacts,
            )
        if isinstance(wall, bool) or wall not in (1, -1):
            raise ImpossibleSequence(
                f"impact ({site!r}, {wall!r}): walls are +1 and -1.", sequence=impacts
            )
    return tuple((int(site) % sites, int(wall)) for site, wall in pairs)


def _whole(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
