"""The forced response where a spring holds every site: ``f'' + spring f = F``.

Harmonic m of f is divided by ``spring - m^2`` instead of ``-m^2``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from contbreather.lattice.forcing import Forcing, Harmonics, Periodic, Series


@dataclass(frozen=True)
class SpringResponse(Periodic):
    """The response to a forcing, with the spring as one of its parameters.

    Attributes
    ----------
    of : Forcing
    spring : float
        Below 1, the square of the lowest harmonic.

    Examples
    --------
    >>> from contbreather.lattice import Harmonic
    >>> spring_response(Harmonic(), 0.2).f(0.0)
    1.25
    """

    of: Forcing
    spring: float

    def __post_init__(self) -> None:
        # -F_m/m^2 of the free lattice becomes F_m/(spring - m^2)
        object.__setattr__(self, "_series", Series(self._scaled(self.of.harmonics)))

    def _scaled(self, harmonics: Harmonics, power: int = 1) -> Harmonics:
        """Divided by ``1 - spring/m^2``; with the second power the slope of that."""

        def scale(m: int) -> float:
            # d/ds of m^2/(m^2 - s) is m^2/(m^2 - s)^2
            return float(m * m / (m * m - self.spring) ** power)

        return tuple((m, scale(m) * A, scale(m) * B) for m, A, B in harmonics)

    @property
    def params(self) -> dict[str, float]:
        return {**self.of.params, "spring": self.spring}

    def _with(self, params: dict[str, float]) -> SpringResponse:
        spring = params.pop("spring")
        return spring_response(self.of.at(**params), spring)

    def _slope(self, name: str) -> Series:
        """In a parameter of the forcing or in the spring."""
        if name == "spring":
            return Series(self._scaled(self.of.harmonics, 2))
        return Series(self._scaled(self.of.slope_harmonics(name)))

    def describe(self) -> str:
        return self.of.describe()


@lru_cache(maxsize=256)
def spring_response(forcing: Forcing, spring: float) -> SpringResponse:
    """`SpringResponse`, kept: residual, Jacobian and sensitivities ask for the same few in turn."""
    return SpringResponse(forcing, spring)
