"""Normal form of the pitchfork: which way the arms of asymmetric breathers bend, and how strongly.

Along an arm every symmetric quantity is even in the asymmetry ``delta = t2 - t1 - pi``. With
``e = delta^2/4`` the equations of asymmetric breathers, the third divided by delta, are three for
(p, phi, parameter) that depend on e and are regular at e = 0:

    ``a f(phi) + 2p [h(0) - h(pi)] + e [a f''(phi)/2 + 4p h''(0)] = 1``,
    ``a f'(phi) - p q + e a f'''(phi)/2 = 0``,
    ``a f''(phi) + 4p h''(0) + e [a f''''(phi)/6 + (8/3) p h''''(0)] = 0``   (up to e^2).

h is the periodic Green's function about mid period, ``h(0) - h(pi) = chi/2, h''(0) = -sigma/2``.
One linear solve gives the slope of the parameter in e, hence ``delta^2/(parameter - its value)``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice import Forcing, Lattice
from contbreather.lattice.periodic import Wave, wave, wave_slope

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class PitchforkForm:
    """How the arms leave a pitchfork.

    Attributes
    ----------
    free : str
        The parameter.
    coefficient : float
        Limit of ``(t2 - t1 - pi)^2/(parameter - its value at the pitchfork)``.
    supercritical : bool
        The arms exist where the symmetric breather has lost its stability.
    """

    free: str
    coefficient: float
    supercritical: bool

    @property
    def criticality(self) -> str:
        return "supercritical" if self.supercritical else "subcritical"


def pitchfork_form(
    a: float,
    gamma: float,
    k: float,
    p: float,
    phi: float,
    forcing: Forcing,
    lattice: Lattice,
    *,
    free: str = "a",
) -> PitchforkForm:
    """Criticality and coefficient of the pitchfork of a symmetric breather.

    Parameters
    ----------
    a, gamma, k, p, phi : float
        The symmetric breather at its pitchfork.
    forcing : Forcing
    lattice : InfiniteChain or Ring
    free : str
        a, gamma, k, or a parameter of the forcing.

    Raises
    ------
    BadInput
        If there is no such parameter, or these numbers are no pitchfork.

    Examples
    --------
    At gamma = 0 everything is elementary:

    >>> from contbreather.lattice import Harmonic, InfiniteChain
    >>> q, c = 1 / 9, math.pi**2 - 4
    >>> a, p = 2 * math.sqrt(4 + (math.pi * q) ** 2) / c, 2 * math.pi / c
    >>> phi = -math.pi + math.atan(math.pi * q / 2)
    >>> form = pitchfork_form(a, 0.0, 0.8, p, phi, Harmonic(), InfiniteChain())
    >>> form.criticality, round(form.coefficient, 3)
    ('supercritical', 9.166)
    """
    q = (1.0 - k) / (1.0 + k)
    f = (forcing.f(phi), forcing.df(phi), forcing.d2f(phi), forcing.d3f(phi))
    h = wave(lattice, gamma, 0)
    at = h.about(0.0)
    rise = at[0] - h.about(math.pi)[0]
    off = a * f[2] + 4.0 * p * at[2]
    if abs(off) > 1e-6 * (abs(a * f[2]) + p):
        raise BadInput(
            f"a = {a}, gamma = {gamma}, p = {p}, phi = {phi} is no pitchfork: "
            f"a f''(phi) - 2 p sigma is {off:.2g}, not 0."
        )
    matrix = np.array(
        ((2.0 * rise, a * f[1], 0.0), (-q, a * f[2], 0.0), (4.0 * at[2], a * f[3], 0.0))
    )
    matrix[:, 2] = _slopes(a, gamma, k, p, phi, forcing, lattice, free)
    bend = np.array(
        (
            0.5 * a * f[2] + 4.0 * p * at[2],
            0.5 * a * f[3],
            a * _fourth(forcing, phi) / 6.0 + 8.0 / 3.0 * p * fourth_slope(h),
        )
    )
    speed = float(np.linalg.solve(matrix, -bend)[2])
    # along the symmetric branch only the first two equations hold; the third then tells stability
    along = np.linalg.solve(matrix[:2, :2], -matrix[:2, 2])
    crossing = float(matrix[2, :2] @ along + matrix[2, 2])
    return PitchforkForm(free, 4.0 / speed, speed * crossing > 0.0)


def _slopes(
    a: float,
    gamma: float,
    k: float,
    p: float,
    phi: float,
    forcing: Forcing,
    lattice: Lattice,
    free: str,
) -> tuple[float, float, float]:
    """Derivatives of the three equations in the parameter, at e = 0."""
    if free == "a":
        return forcing.f(phi), forcing.df(phi), forcing.d2f(phi)
    if free == "gamma":
        h = wave_slope(lattice, gamma, 0)
        return 2.0 * p * (h.about(0.0)[0] - h.about(math.pi)[0]), 0.0, 4.0 * p * h.about(0.0)[2]
    if free == "k":
        return 0.0, 2.0 * p / (1.0 + k) ** 2, 0.0
    if free in forcing.params:
        first, second, third = (a * forcing.f_param(free, phi, order) for order in range(3))
        return first, second, third
    have = ", ".join(("a", "gamma", "k", *forcing.params))
    raise BadInput(f"unknown parameter {free!r}: this breather has {have}.")


def _fourth(forcing: Forcing, phi: float) -> float:
    """Fourth derivative of f."""
    return sum(
        m**4 * (A * math.cos(m * phi) + B * math.sin(m * phi)) for m, A, B in forcing.harmonics
    )


def fourth_slope(h: Wave) -> float:
    """Fourth derivative of a `Wave` at mid period."""
    return 24.0 * h.powers[2] + h.first + 16.0 * h.second
