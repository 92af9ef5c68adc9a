"""The equations of the breather and of its special points, for balls and jets alike.

A breather is a zero of (11); values come by name: p, phi, a, gamma, k and the coefficients of F/a.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from contbreather.certified import averages
from contbreather.certified.balls import Value
from contbreather.errors import BadInput
from contbreather.lattice.forcing import Forcing, Fourier, Harmonic

Values = Mapping[str, Value]


def check_forcing(forcing: Forcing) -> None:
    """Refuse a forcing whose coefficients are not exactly known."""
    if not isinstance(forcing, Harmonic | Fourier):
        raise BadInput(
            f"certify() knows Harmonic() and Fourier(...), whose coefficients are exact; those of "
            f"{forcing.describe()} are rounded: give the harmonics by Fourier."
        )


def response(values: Values) -> list[tuple[int, Value, Value]]:
    """``(m, A, B)`` of ``f = sum of A cos(m t) + B sin(m t)``, at unit amplitude: those of the
    force, divided by -m^2; without coefficients the force is -cos t."""
    harmonics: dict[int, list[Value]] = {}
    for name, value in values.items():
        if name[0] in "cs" and name[1:].isdigit():
            m = int(name[1:])
            harmonics.setdefault(m, [0, 0])[name[0] == "s"] = -value / m**2
    return [(m, *pair) for m, pair in sorted(harmonics.items())] or [(1, 1, 0)]


def driven(values: Values, order: int) -> Value:
    """``f`` at phi, or its derivative of this order."""
    total = 0
    for m, cosine, sine in response(values):
        s, c = _sine_cosine(m * values["phi"])
        turned = ((cosine, sine), (sine, -cosine), (-cosine, -sine))[order]
        total = total + (turned[0] * c + turned[1] * s) * m**order
    return total


def _sine_cosine(x: Value) -> tuple[Value, Value]:
    return x.sin_cos()


def loss(values: Values) -> Value:
    """``q = (1 - k)/(1 + k)``."""
    return (1 - values["k"]) / (1 + values["k"])


def closure(values: Values) -> list[Value]:
    """(11): site 0 is at its wall at phi, and the reset law."""
    p, a = values["p"], values["a"]
    height = p * averages.chi(values["gamma"]) + a * driven(values, 0) - 1
    return [height, a * driven(values, 1) - p * loss(values)]


def fold(values: Values) -> Value:
    """(T7), the determinant of the closure's Jacobian."""
    return averages.chi(values["gamma"]) * driven(values, 2) + loss(values) * driven(values, 1)


def pitchfork(values: Values) -> Value:
    """(T15), half the distance of b from where the half map has +1."""
    sigma = averages.sigma(values["gamma"])
    return values["a"] * driven(values, 2) - 2 * values["p"] * sigma


def saltation(values: Values) -> Value:
    """The entry b of the saltation matrix, (T8)."""
    pull = values["a"] * driven(values, 2) - values["p"] * averages.eta(values["gamma"])
    return (1 + values["k"]) ** 2 * pull / (2 * values["p"])


def equations(
    fixed: Values, names: Sequence[str], more: Callable[[Values], Value] | None = None
) -> Callable[[Sequence[Value]], list[Value]]:
    """The closure, and one equation more, in these unknowns; all other values are fixed."""

    def at(point: Sequence[Value]) -> list[Value]:
        values = {**fixed, **dict(zip(names, point, strict=True))}
        residuals = closure(values)
        return residuals if more is None else [*residuals, more(values)]

    return at
