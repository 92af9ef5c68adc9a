"""Means over the modes of the infinite chain, enclosed: chi, eta, sigma, psi, motions of all sites;
and the equations of the breather and of its special points, for balls and jets alike.

With ``w^2 = 2 gamma (1 - cos theta)`` and whole l > 0,

    ``<cos(n theta)/(l^2 - w^2)> = xi_l^n/(l sqrt(l^2 - 4 gamma))``,
    ``xi_l = -4 gamma/(l + sqrt(l^2 - 4 gamma))^2``,
    ``<w^2j cos(n theta)> = (-1)^n binomial(2j, j + n) gamma^j =: m_j(n)``.

All means are sums over l of the former (partial fractions of tan, cot, 1/sin; the Fourier series of
the motion). The term next to the band is kept, the others are expanded in ``w^2/l^2`` up to
``(w^2/l^2)^J``. What is cut off is bounded, with ``x = 4 gamma <= 1``, ``|m_j| <= x^j``:

- chi, eta, psi: coefficient j of x is at most ``(4/pi) s_j``, ``s_j`` the sum over l of l^-(2j+2),
  l^-2j (l = 3, 5, ...) or l^-2j (l = 4, 6, ...), so at most ``(4/pi) 3 9^-j``. From j = J + 1 on
  that makes ``(27/2 pi) 9^-(J+1) < 5 9^-(J+1)``, its derivative in gamma
  ``4 (12/pi) sum of j 9^-j <= 18 (J + 2) 9^-(J+1)``.
- motion: ``sum over j > J of w^2j/l^(2j+2) = (w/l)^(2J+2)/(l^2 - w^2)``, so derivative r in time is
  off by at most ``(4/pi) sum over l of l^r l^-(2J+2)/(l^2 - 1) <= 3^r 9^-(J+1)/pi`` (r = 0, 1, 2;
  the sum over l = 3, 5, ... of 1/(l^2 - 1) is 1/4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from math import comb, factorial

from flint import arb, arb_mat, arb_poly

from contbreather.certified.balls import Ball, Jet, Value, working
from contbreather.errors import BadInput
from contbreather.lattice.forcing import Forcing, Fourier, Harmonic

J = 40  # powers of w^2 kept: 9^-41 < 2^-129
POWERS = 18  # odd powers of the time from mid flight kept in a motion


def _odd(s: int) -> Ball:
    """The sum of l^-s over l = 3, 5, 7, ..."""
    return (1 - arb(2) ** -s) * arb(s).zeta() - 1


def _even(s: int) -> Ball:
    """The sum of l^-s over l = 4, 6, 8, ..."""
    return arb(2) ** -s * (arb(s).zeta() - 1)


@lru_cache(maxsize=1)
def _coefficients() -> dict[str, list[Ball]]:
    """Coefficients of gamma^j, j = 0..J, the terms next to the band left out; beyond the precision
    in use."""
    with working():
        f = 4 / arb.pi()
        return {
            "chi": [f * comb(2 * j, j) * _odd(2 * j + 2) for j in range(J + 1)],
            "eta": [arb(0)] + [f * comb(2 * j, j) * _odd(2 * j) for j in range(1, J + 1)],
            "psi": [f / 2] + [-f * comb(2 * j, j) * _even(2 * j) for j in range(1, J + 1)],
        }


def _rest(name: str, gamma: Value) -> Value:
    total = arb(0)
    for c in reversed(_coefficients()[name]):
        total = total * gamma + c
    # bounds of the powers beyond J, and of their slopes
    value, slope = (arb(0, 5 * arb(9) ** -(J + 1)), arb(0, 18 * (J + 2) * arb(9) ** -(J + 1)))
    return total + (Jet([value, slope], prec=2) if isinstance(gamma, Jet) else value)


def chi(gamma: Value) -> Value:
    """``<tan(pi w/2)/w>``, (10)."""
    return 4 / arb.pi() * (1 - 4 * gamma).rsqrt() + _rest("chi", gamma)


def eta(gamma: Value) -> Value:
    """``<w tan(pi w/2)>``."""
    return 4 / arb.pi() * ((1 - 4 * gamma).rsqrt() - 1) + _rest("eta", gamma)


def psi(gamma: Value) -> Value:
    """``<w cot(pi w/2)>``."""
    return -4 / arb.pi() * ((1 - gamma).rsqrt() - 1) + _rest("psi", gamma)


def sigma(gamma: Value) -> Value:
    """``<w/sin(pi w)>``."""
    return (eta(gamma) + psi(gamma)) / 2


# --- the motion of a site between two impacts of site 0 -----------------------------------------


@lru_cache(maxsize=1)
def _weights() -> arb_mat:
    """``(4/pi) (-1)^i W_ij/(2i+1)!``, W as in `contbreather.lattice.periodic_green`: the
    coefficient of ``<w^2j cos(n theta)>`` and the (2i+1)-th power of the time from mid flight."""
    with working():
        quarter, odd = arb(1) / 4, range(3, 2 * J + 2, 2)
        # Dirichlet's beta, 1 - 3^-s + 5^-s - ...
        beta = [quarter**s * (arb(s).zeta(quarter) - arb(s).zeta(3 * quarter)) for s in odd]
        gaps = [1 - arb.pi() / 4] + [1 - value for value in beta]
        rows = [
            [
                4 / arb.pi() * (-1) ** i / factorial(2 * i + 1) * (gaps[j - i] if j >= i else 1)
                for j in range(J + 1)
            ]
            for i in range(POWERS)
        ]
        return arb_mat(rows)


def first_harmonic(gamma: Ball, n: int) -> Ball:
    """``<cos(n theta)/(1 - w^2)>``."""
    r = (1 - 4 * gamma).sqrt()
    return (-4 * gamma / (1 + r) ** 2) ** n / r


def free_flight_enclosure(gamma: Ball, n: int) -> tuple[Ball, arb_poly, list[Ball]]:
    """Site n between two impacts per unit p: ``-s sin y + P(y) + error``, y the time from mid
    flight; s, P, and the errors of displacement, velocity and acceleration.

    Cut off are, beside the powers of w^2 above, the powers of y from 2 POWERS + 1 on. All ``|W| <=
    1`` and ``sum of |m_j| <= 1/sqrt(1 - 4 gamma)``, so of derivative r there remain less than
    ``(4/pi)/sqrt(1 - 4 gamma)`` times the sum of ``|y|^(i - r)/(i - r)!`` over odd i > 2 POWERS,
    which is at most twice its first term.
    """
    moments = [comb(2 * j, j + n) * (-1) ** n * gamma**j for j in range(J + 1)]
    coefficients = _weights() * arb_mat([[m] for m in moments])
    powers = [x for i in range(POWERS) for x in (arb(0), coefficients[i, 0])]
    size = 4 / arb.pi() / (1 - 4 * gamma).sqrt()
    first = 2 * POWERS + 1
    errors = [
        arb(
            0,
            (3**r * arb(9) ** -(J + 1) / arb.pi()).upper()
            # no time from mid flight is beyond pi/2 < 1.6
            + (2 * size * arb(1.6) ** (first - r) / factorial(first - r)).upper(),
        )
        for r in range(3)
    ]
    return 4 / arb.pi() * first_harmonic(gamma, n), arb_poly(powers), errors


def reach(gamma: Ball, n: int) -> Ball:
    """An upper bound, over all times and all sites from n on, of what a unit impact does there.

    By the Fourier series ``(4/pi) sum of |xi_l|^n/(l sqrt(l^2 - 4 gamma))``, which falls with n;
    with ``|xi_l| <= |xi_3|`` and ``l sqrt(l^2 - 4 gamma) >= l^2 - 1`` for l = 3, 5, ... the terms
    beyond the first are at most ``|xi_3|^n/4``.
    """
    r = (1 - 4 * gamma).sqrt()
    first, third = 4 * gamma / (1 + r) ** 2, 4 * gamma / (3 + (9 - 4 * gamma).sqrt()) ** 2
    return (4 / arb.pi() * (first**n / r + third**n / 4)).upper()


# --- the equations --------------------------------------------------------------------------------
# A breather is a zero of (11); values come by name: p, phi, a, gamma, k and coefficients of F/a.

Values = Mapping[str, Value]


def check_forcing(forcing: Forcing) -> None:
    """Refuse a forcing whose coefficients are not exactly known."""
    if not isinstance(forcing, Harmonic | Fourier):
        raise BadInput(
            "a proof takes Harmonic() or, in Python, Fourier(...), whose coefficients are exact; "
            f"those of {forcing.describe()} are rounded: give the harmonics by Fourier."
        )


def force_response(values: Values) -> list[tuple[int, Value, Value]]:
    """``(m, A, B)`` of ``f = sum of A cos(m t) + B sin(m t)``, at unit amplitude: those of the
    force, divided by -m^2; without coefficients the force is -cos t."""
    harmonics: dict[int, list[Value]] = {}
    for name, value in values.items():
        if name[0] in "cs" and name[1:].isdigit():
            m = int(name[1:])
            harmonics.setdefault(m, [0, 0])[name[0] == "s"] = -value / m**2
    return [(m, *pair) for m, pair in sorted(harmonics.items())] or [(1, 1, 0)]


def turned(cosine: Value, sine: Value, angle: Value, order: int) -> Value:
    """``cosine cos(angle) + sine sin(angle)``, or its first or second derivative in the angle."""
    s, c = angle.sin_cos()
    return (cosine * c + sine * s, sine * c - cosine * s, -cosine * c - sine * s)[order]


def driven(values: Values, order: int) -> Value:
    """``f`` at phi, or its derivative of this order."""
    phi = values["phi"]
    return sum(turned(c, s, m * phi, order) * m**order for m, c, s in force_response(values))


def loss(values: Values) -> Value:
    """``q = (1 - k)/(1 + k)``."""
    return (1 - values["k"]) / (1 + values["k"])


def closure(values: Values) -> list[Value]:
    """(11): site 0 is at its wall at phi, and the reset law."""
    p, a = values["p"], values["a"]
    height = p * chi(values["gamma"]) + a * driven(values, 0) - 1
    return [height, a * driven(values, 1) - p * loss(values)]


def fold_condition(values: Values) -> Value:
    """(T7), the determinant of the closure's Jacobian."""
    return chi(values["gamma"]) * driven(values, 2) + loss(values) * driven(values, 1)


def pitchfork_condition(values: Values) -> Value:
    """(T15), half the distance of b from where the half map has +1."""
    return values["a"] * driven(values, 2) - 2 * values["p"] * sigma(values["gamma"])


def saltation_enclosure(values: Values) -> Value:
    """The entry b of the saltation matrix, (T8)."""
    pull = values["a"] * driven(values, 2) - values["p"] * eta(values["gamma"])
    return (1 + values["k"]) ** 2 * pull / (2 * values["p"])


def scaled_values(values: Values) -> dict[str, Value]:
    """Parameters with the time in units of 1/omega; p and phi are in it already."""
    own = dict(values)
    if (omega := own.pop("omega", None)) is not None:
        own |= {name: own[name] / (omega * omega) for name in ("a", "gamma")}
    return own


def equations(
    fixed: Values, names: Sequence[str], more: Callable[[Values], Value] | None = None
) -> Callable[[Sequence[Value]], list[Value]]:
    """The closure, and one equation more, in these unknowns; all other values are fixed."""

    def at(point: Sequence[Value]) -> list[Value]:
        values = scaled_values({**fixed, **dict(zip(names, point, strict=True))})
        residuals = closure(values)
        return residuals if more is None else [*residuals, more(values)]

    return at
