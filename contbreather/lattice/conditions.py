"""What a lattice moves under: forcing, coupling, losses, springs, walls."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

from contbreather.checks import whole
from contbreather.errors import BadInput
from contbreather.lattice.chain import InfiniteChain
from contbreather.lattice.forcing import Forcing, Harmonic
from contbreather.parameters import NAMES, parameter


def restitution_ratio(k: float) -> float:
    """``q = (1 - k)/(1 + k)``: the loss at an impact; `BadInput` unless k is in [0, 1]."""
    number = parameter("k", k)
    return (1.0 - number) / (1.0 + number)  # of (7) and (13): f'(phi) = p q


Pair = tuple[float, float]  # low and high; infinite where there is no wall


@dataclass(frozen=True)
class Walls:
    """Where each site has its walls: `of_all` sites, but for those with `own` ones.

    Examples
    --------
    >>> Walls.given({3: (None, 0.8)}).at(3)
    (-inf, 0.8)
    """

    of_all: Pair = (-1.0, 1.0)
    own: tuple[tuple[int, Pair], ...] = ()

    @classmethod
    def given(cls, walls: Any) -> Walls:
        """From a pair ``(low, high)`` for all sites or a dict of them by site, None for a wall
        that is not there, for a site without walls too."""
        if walls is None or isinstance(walls, Walls):
            return walls or cls()
        if isinstance(walls, Mapping):
            pairs = (
                (whole("walls of site", site, 0), _pair(pair, f"walls[{site!r}]"))
                for site, pair in walls.items()
            )
            return cls(own=tuple(sorted(pairs)))
        return cls(_pair(walls, "walls"))

    @cached_property
    def _by_site(self) -> dict[int, Pair]:
        return dict(self.own)

    def at(self, site: int) -> Pair:
        """Low and high wall of a site."""
        return self._by_site.get(int(site), self.of_all)

    def position(self, site: int, wall: int) -> float:
        """Where its wall +1 or -1 is."""
        return self.at(site)[wall > 0]  # of (low, high)

    @property
    def symmetric(self) -> bool:
        """Whether every site has both its walls equally far from 0."""
        return all(low == -high for low, high in (self.of_all, *self._by_site.values()))


def _pair(ends: Any, name: str) -> Pair:
    if ends is None:
        ends = (None, None)
    try:
        low, high = ends
        pair = (-math.inf if low is None else float(low), math.inf if high is None else float(high))
    except (TypeError, ValueError):
        pair = (math.nan, math.nan)  # refused below: nan < nan is false
    if not pair[0] < pair[1]:
        raise BadInput(
            f"{name} = {ends!r}: two numbers low < high are expected, None for a wall that is not "
            "there."
        )
    return pair


@dataclass(frozen=True)
class Conditions:
    """Every parameter of the motion, its forcing, and where it happens.

    Attributes
    ----------
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    damping, spring : float
        ``u'' + damping u' + spring u + ...``, per unit mass.
    forcing : Forcing
    walls : Walls
    lattice : InfiniteChain, Ring or Lattice
    """

    a: float
    gamma: float
    k: float
    damping: float = 0.0
    spring: float = 0.0
    forcing: Forcing = field(default_factory=Harmonic)
    walls: Walls = Walls()
    lattice: Any = field(default_factory=InfiniteChain)

    def checked(self) -> Conditions:
        """The same, or what is wrong with it. Derivatives by differences look beyond the edges of
        the domain, where everything is defined still: so this is asked where numbers come in."""
        for name in NAMES:
            # how far gamma goes its lattice knows: no further than 1/4 on chain and ring
            other = {"high": math.inf, "why": ""} if name == "gamma" else {}
            parameter(name, getattr(self, name), **other)
        return self.at({})

    @property
    def params(self) -> dict[str, float]:
        """All parameters by name, those of the forcing last."""
        return {**{name: getattr(self, name) for name in NAMES}, **self.forcing.params}

    def at(self, params: Mapping[str, float]) -> Conditions:
        """The same with other values of its parameters."""
        values = tuple(float(params.get(name, value)) for name, value in self.params.items())
        # lattices of the same numbers are equal, and each keeps its name
        name = getattr(self.lattice, "name", "")
        return _moved(self.forcing, self.walls, self.lattice, values, name)


@lru_cache(maxsize=256)
def _moved(
    forcing: Forcing, walls: Walls, lattice: Any, values: tuple[float, ...], _: str
) -> Conditions:
    names = tuple(forcing.params)
    if names:
        forcing = forcing.at(**dict(zip(names, values[len(NAMES) :], strict=True)))
    a, gamma, k, damping, spring = values[: len(NAMES)]
    return Conditions(a, gamma, k, damping, spring, forcing, walls, lattice)
