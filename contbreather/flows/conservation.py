"""Conserved quantities of a flow, and what they make of its periodic orbits.

Where H is conserved periodic orbits come in families, and none of them is isolated. They are in

    x' = f(x, p) + lambda grad H,

which has the same periodic orbits and no others: along one of them H would change by lambda times
the integral of |grad H|^2, so lambda is zero. With this unknown an orbit is isolated once its
period or its energy is given, which so become parameters (F. J. Munoz-Almaraz, E. Freire, J. Galan,
E. Doedel and A. Vanderbauwhede, Physica D 181, 1, 2003). Of several quantities each has its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief, check_kind
from ..continuation.algebra.newton import Array
from ..errors import BadInput
from .functions import Function, Params, check_function, offset, place, rows_of, slopes, values

_DRIFTS = 1e-7  # of what its terms add up to: a rate of change that is no rounding
ASIDE = 1e-3  # of the size of a state: how far off it the gradient of the unfolding looks
_LEAVES = 1e-8  # imaginary part of an index that is none of rounding where two of them meet
CONSTANT = 1e-8  # relative error of a Poisson matrix that is the same at all states


@dataclass(frozen=True, eq=False)
class Quantity:
    """A function ``H(x, p)`` as one of (t, x, p)."""

    function: Callable[[Any, Any], Any]

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        return self.function(x, p)


@dataclass(frozen=True, eq=False)
class Unfolded:
    """A field plus lambda times the gradient of each quantity, by the name of that lambda.

    Near any solution lambda is rounding: so the gradient need not be exact, but analytic, as it is
    differentiated by complex steps.
    """

    f: Function
    quantities: Mapping[str, Function]
    steps: Array

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        field = rows_of(self.f(t, x, p), x)
        aside = self.steps.reshape(-1, *(1,) * (x.ndim - 1))
        for name, quantity in self.quantities.items():
            if p.get(name):
                ways = np.eye(len(x)).reshape(len(x), *aside.shape) * aside
                rise = [
                    values(quantity, 0.0, at.reshape(len(x), -1), p).reshape(x.shape)
                    for at in (x[:, None] + ways, x[:, None] - ways)
                ]
                field = field + p[name] * (rise[0] - rise[1]) / (2 * aside)
        return field


@dataclass(frozen=True, eq=False)
class Conservation:
    """What is conserved, and what is given of an orbit: its "period", or the first quantity."""

    quantities: tuple[Function, ...]
    names: tuple[str, ...]
    held: str
    # (k - 1, n): where orbits are shifted by the symmetries of all quantities but one
    across: Array

    @property
    def lambdas(self) -> tuple[str, ...]:
        count = len(self.names)
        return tuple(f"lambda{i + 1}" for i in range(count)) if count > 1 else ("lambda",)

    def named(self, time: str) -> tuple[str, str]:
        """Names of the time and of the first quantity as unknowns: "held" of the one that is a
        parameter."""
        return ("held", self.names[0]) if self.held == "period" else (time, "held")

    def gradients(self, states: Array, p: Params) -> list[Array]:
        """Differentiate all quantities at states, shape (n, m): arrays (m, n)."""
        return [slopes(H, 0.0, states, p)[1][0, :-1].T for H in self.quantities]

    def poisson(self, f: Function, states: Array, p: Params) -> Array | None:
        """Find J in ``f = J grad H``, if it is the same constant and regular matrix everywhere:
        of canonical variables, in any order. None of others."""
        n = len(states)
        # off the orbit, which may lie in a subspace: scattered by a tenth of its size
        x = states[:, np.arange(4 * n) * states.shape[1] // (4 * n)]
        scattered = np.sin(np.arange(1.0, x.size + 1) ** 2).reshape(x.shape)
        x = x + 6 * offset(states)[:, None] * scattered
        (gradient, *_), field = self.gradients(x, p), values(f, 0.0, x, p)
        J = np.linalg.lstsq(gradient, field.T)[0].T
        off = abs(J @ gradient.T - field).max(), abs(J + J.T).max()
        least = CONSTANT * abs(field).max(), CONSTANT * abs(J).max()
        known = off[0] <= least[0] and off[1] <= least[1] and np.linalg.cond(J) < 1 / CONSTANT
        return J if known else None


def quantities_of(conserves: Any) -> tuple[tuple[Function, ...], tuple[str, ...]]:
    """Make functions of (t, x, p) of what was given as `conserves`, and name them."""
    given: Mapping[str, Any]
    if callable(conserves):
        given = {"energy": conserves}
    elif isinstance(conserves, Mapping):
        given = conserves
    else:
        check_kind(conserves, Sequence, "conserves=H, a function of (x, p), or several of them")
        given = {f"conserved{i}" if i else "energy": H for i, H in enumerate(conserves)}
    if not given or not all(callable(H) for H in given.values()):
        raise BadInput(f"conserves must be functions of (x, p), got {brief(conserves)}")
    return tuple(Quantity(H) for H in given.values()), tuple(given)


def refuse_drift(
    quantities: Iterable[Function],
    names: Sequence[str],
    f: Function,
    states: Array,
    params: Params,
    moved: tuple[str, ...] = (),
) -> None:
    """Refuse what is not conserved beside states, shape (n, m), also where parameters move."""
    x = states + offset(states)[:, None] * np.cos(np.arange(states.size)).reshape(states.shape)
    for name in ("", *(name for name in moved if name in params)):
        p = {**params, **({name: params[name] + 0.01 * (abs(params[name]) or 1.0)} if name else {})}
        for quantity, called in zip(quantities, names, strict=True):
            check_function(f"conserves ({called})", quantity, (), 0.0, x[:, 0], p)
            gradient, field = slopes(quantity, 0.0, x, p)[1][0, :-1], values(f, 0.0, x, p)
            rates, sizes = (gradient * field).sum(axis=0), abs(gradient * field).sum(axis=0)
            worst = int(abs(rates).argmax())
            if abs(rates[worst]) > _DRIFTS * sizes.max():
                where = place(0.0, x[:, worst])
                why = f" where {name} moves" if name else ""
                raise BadInput(
                    f"{called} is not conserved{why}: it changes at the rate {rates[worst]:.3g} "
                    f"{where}, of terms of size {sizes[worst]:.3g}; conserves= is a function of "
                    "(x, p) that is constant along the flow"
                )


def off_circle(indices: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Tell which pairs of these indices are off the unit circle, by more than rounding."""
    return np.asarray((abs(indices.imag) > _LEAVES) | (abs(indices.real) > 1 + _LEAVES**1.25))


def indices_of(mu: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Stability indices ``(mu + 1/mu) / 2`` of multipliers that come in pairs, one for each pair:
    real and at most 1 in size where the pair is on the unit circle.

    Where pairs meet at +1 or -1 rounding moves mu by its root, and these by no more than itself.
    """
    left, found = [*mu[np.argsort(-abs(mu), kind="stable")]], []
    while len(left) > 1:
        first = left.pop(0)
        left.pop(int(np.argmin([abs(first * other - 1) for other in left])))
        found.append((first + 1 / first) / 2)
    indices = np.array(found, dtype=complex)
    return np.where(abs(indices.imag) > _LEAVES, indices, indices.real)
