"""What a run is made of: a state, and the conditions it moves under."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import number
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, Harmonic, check_gamma

Array = NDArray[Any]
PERIOD = 2.0 * math.pi
OUTSIDE = 1e-9  # beyond a wall by more than this is no rounding
FASTEST = 1e6
HEAVIEST = 1e4  # damping; steps are 3/mu at most, and a period takes 2 pi mu/3 of them


class State(NamedTuple):
    """Displacements and velocities of all sites of a ring, site 0 first; arrays of shape (N,)."""

    u: Array
    v: Array


@dataclass(frozen=True)
class Conditions:
    """Forcing, coupling, walls and damping of an impacting ring.

    Parameters
    ----------
    a : float
        Amplitude of the forcing.
    gamma : float
        Coupling in [0, 1/4).
    k : float
        Restitution coefficient in [0, 1].
    damping : float
        mu of the linear damping ``mu u'`` on every site, from 0 to 1e4.
    forcing : Forcing
    """

    a: float
    gamma: float
    k: float
    damping: float = 0.0
    forcing: Forcing = field(default_factory=Harmonic)

    def __post_init__(self) -> None:
        number("gamma", self.gamma, -math.inf, math.inf, "a coupling")
        check_gamma(self.gamma)
        number("a", self.a, 0.0, math.inf, "an amplitude, at least 0")
        number("k", self.k, 0.0, 1.0, "a restitution coefficient between 0 and 1")
        wanted = "a damping coefficient, at least 0 and at most 1e4"
        number("damping", self.damping, 0.0, HEAVIEST, wanted)

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """Orders and coefficients of a g(t), ``g'' + mu g' = F/a``: the forced uniform motion."""
        m, c, s = self.response
        turned = (c - 1j * s) / (1.0 - 1j * self.damping / m)
        return m, np.ascontiguousarray(turned.real), np.ascontiguousarray(-turned.imag)

    @property
    def force(self) -> tuple[Array, Array, Array]:
        """Orders and coefficients of F(t)."""
        m, c, s = self.response
        return m, -(m**2) * c, -(m**2) * s

    @property
    def response(self) -> tuple[Array, Array, Array]:
        """Orders and coefficients of a f(t), f'' = F/a."""
        table = np.array(self.forcing.harmonics, dtype=float).reshape(-1, 3)
        m, c, s = (np.ascontiguousarray(column) for column in table.T)
        return m, self.a * c, self.a * s

    def as_params(self) -> dict[str, float]:
        """The numbers by name, as a problem's parameters would be called."""
        return {"a": self.a, "gamma": self.gamma, "k": self.k, "damping": self.damping}


def check_state(state: Any, *, walls: bool = True) -> State:
    """A copy of a state as two float arrays, or what is wrong with it.

    Raises
    ------
    BadInput
        Not a pair of rows of equal length, not finite, or (with `walls`) outside the walls.
    """
    u, v = _rows(state)
    if u.ndim != 1 or u.shape != v.shape or u.size < 1:
        raise BadInput(
            f"a state is a pair (u, v) of rows of equal length, one entry for each site of the "
            f"ring; shapes {u.shape} and {v.shape} were given."
        )
    for name, row in (("u", u), ("v", v)):
        bad = np.flatnonzero(~np.isfinite(row))
        if bad.size:
            raise BadInput(f"{name}[{bad[0]}] = {row[bad[0]]} of the state is no finite number.")
    fast = int(np.abs(v).argmax())
    if abs(v[fast]) > FASTEST:
        raise BadInput(
            f"v[{fast}] = {v[fast]:.3g}: velocities above {FASTEST:g} blow up the energy; the "
            "walls are at distance 1 and the forcing has period 2 pi, so those of interest are "
            "of order 1."
        )
    if walls:
        _within_walls(u)
    return State(u, v)


def _rows(state: Any) -> tuple[Array, Array]:
    try:
        u, v = state
        return np.array(u, dtype=float), np.array(v, dtype=float)
    except (TypeError, ValueError) as error:
        raise BadInput(f"a state is a pair (u, v) of rows of numbers; {error}.") from error


def _within_walls(u: Array) -> None:
    n = int(np.abs(u).argmax())
    if abs(u[n]) > 1.0 + OUTSIDE:
        raise BadInput(
            f"u[{n}] = {u[n]:.12g} lies outside the walls at -1 and 1; start with all sites "
            "between them."
        )
    np.clip(u, -1.0, 1.0, out=u)


def reduced(t0: ArrayLike) -> float:
    """A time within one period of the forcing, [0, 2 pi)."""
    t = number("t0", t0, -1e300, 1e300, "a time")
    return t % PERIOD
