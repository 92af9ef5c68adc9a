"""What a lattice moves under: forcing, coupling, losses, springs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

from contbreather.breathers.closure import check_amplitude, restitution_ratio
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, Harmonic

OWN = ("a", "gamma", "k", "damping", "spring")


@dataclass(frozen=True)
class Conditions:
    """Every parameter of the motion, and its forcing.

    Attributes
    ----------
    a, gamma, k : float
        Amplitude of the forcing, coupling, restitution coefficient.
    damping, spring : float
        ``u'' + damping u' + spring u + ...``, per unit mass.
    forcing : Forcing
    """

    a: float
    gamma: float
    k: float
    damping: float = 0.0
    spring: float = 0.0
    forcing: Forcing = field(default_factory=Harmonic)

    def checked(self) -> Conditions:
        """The same, or what is wrong with it. Derivatives by differences look beyond the edges of
        the domain, where everything is defined still: so this is asked where numbers come in."""
        check_amplitude(self.a)
        restitution_ratio(self.k)
        for name in ("gamma", "damping", "spring"):
            value = getattr(self, name)
            try:
                number = float(value)
            except (TypeError, ValueError):
                number = math.nan
            if not 0.0 <= number < math.inf:
                raise BadInput(f"{name} = {value!r}: a finite number, at least 0, is wanted.")
        return self.at({})

    @property
    def params(self) -> dict[str, float]:
        """All parameters by name, those of the forcing last."""
        return {**{name: getattr(self, name) for name in OWN}, **self.forcing.params}

    def at(self, params: Mapping[str, float]) -> Conditions:
        """The same with other values of its parameters."""
        own = tuple(float(params.get(name, value)) for name, value in self.params.items())
        return _moved(self.forcing, own)


@lru_cache(maxsize=256)
def _moved(forcing: Forcing, values: tuple[float, ...]) -> Conditions:
    names = tuple(forcing.params)
    if names:
        forcing = forcing.at(**dict(zip(names, values[len(OWN) :], strict=True)))
    a, gamma, k, damping, spring = values[: len(OWN)]
    return Conditions(a, gamma, k, damping, spring, forcing)
