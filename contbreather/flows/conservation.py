"""Conserved quantities of a flow, and what they make of its periodic orbits.

Where H is conserved periodic orbits come in families, and none of them is isolated. They are in

    x' = f(x, p) + lambda grad H,

which has the same periodic orbits and no others: along one of them H would change by lambda times
the integral of |grad H|^2, so lambda is zero. With this unknown an orbit is isolated once its
period or its energy is given, which so become parameters (F. J. Munoz-Almaraz, E. Freire, J. Galan,
E. Doedel and A. Vanderbauwhede, Physica D 181, 1, 2003). Of several quantities each has its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief
from ..continuation.algebra.newton import Array
from ..errors import BadInput
from .functions import (
    Function,
    Params,
    check_function,
    offset,
    place,
    rows_of,
    slopes,
    slopes_along,
    values,
)
from .jacobian import Slopes

_DRIFTS = 1e-7  # of what its terms add up to: a rate of change that is no rounding
_ASIDE = 1e-3  # of the size of a state: how far off it the gradient of the unfolding looks
_LEAVES = 1e-8  # imaginary part of an index that is none of rounding where two of them meet
_CONSTANT = 1e-8  # relative error of a Poisson matrix that is the same at all states

Quantities = Mapping[str, Function]  # of (t, x, p), by name


@dataclass(frozen=True, eq=False)
class Unfolded:
    """A field plus lambda times the gradient of each quantity, by the name of that lambda.

    Near any solution lambda is rounding: so the gradient, over steps of these sizes, need not be
    exact, but analytic, as it is differentiated by complex steps.
    """

    f: Any  # (t, x, p), perhaps with a `jacobian`
    quantities: Quantities
    steps: Array

    @classmethod
    def near(cls, f: Function, quantities: Quantities, states: Array) -> Unfolded:
        sizes = abs(states).max(axis=1)
        return cls(f, quantities, _ASIDE * np.maximum(sizes, _ASIDE * sizes.max()))

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        field, n = rows_of(self.f(t, x, p), x), len(x)
        one = (1,) * (x.ndim - 1)
        ways = np.diag(self.steps).reshape(n, n, *one)
        for name, quantity in self.quantities.items():
            if p.get(name):
                both = np.stack([x[:, None] + ways, x[:, None] - ways], axis=1)
                ahead, behind = values(quantity, 0.0, both.reshape(n, -1), p).reshape(2, *x.shape)
                field = field + p[name] * (ahead - behind) / (2 * self.steps.reshape(n, *one))
        return field

    # --- its derivative, in states as of the field: lambda adds rounding --------------------------

    jacobian = property(lambda self: self)

    def is_sparse(self, *at: Any) -> bool:
        given = getattr(self.f, "jacobian", None)
        return given is not None and bool(given.is_sparse(*at))

    def slopes(self, _: Any, t: Any, x: Array, p: Params, names: tuple[str, ...]) -> Slopes:
        inner = slopes(self.f, t, x, p)[1][:, : len(x)]
        return values(self, t, x, p), inner, self._along(t, x, p, names)

    def entries(self, _: Any, t: Any, x: Array, p: Params, names: tuple[str, ...]) -> Slopes:
        inner = self.f.jacobian.entries(self.f, t, x, p, ())[1]
        return values(self, t, x, p), inner, self._along(t, x, p, names)

    def _along(self, t: Any, x: Array, p: Params, names: tuple[str, ...]) -> Array:
        # in parameters: what is linear in lambda is differentiated where that is 0, not rounding
        p = {**p, **dict.fromkeys(self.quantities, 0.0)}
        return slopes_along(self, t, x, p, names, np.empty((len(x), 0)))[1]


@dataclass(frozen=True, eq=False)
class Conservation:
    """Conserved quantities, and what is given of an orbit: its time, or the first of them."""

    quantities: Quantities
    held: str
    across: Array  # (k - 1, n): where orbits are shifted by symmetries, of k quantities
    time: str = "period"  # or "omega": the frequency

    @property
    def timed(self) -> bool:
        return self.held == self.time

    def given(self, p: Params) -> Any:
        """The period or the level that is held; and the frequency of a period in its place."""
        return 2 * math.pi / p["omega"] if self.held == "omega" else p[self.held]

    @property
    def lambdas(self) -> tuple[str, ...]:
        count = len(self.quantities)
        return tuple(f"lambda{i + 1}" for i in range(count)) if count > 1 else ("lambda",)

    def gradients(self, states: Array, p: Params) -> list[Array]:
        """Differentiate all quantities at states, shape (n, m): arrays (m, n)."""
        return [slopes(H, 0.0, states, p)[1][0, :-1].T for H in self.quantities.values()]

    def poisson(self, f: Function, states: Array, p: Params) -> Array | None:
        """Find J in ``f = J grad H``, if it is the same constant and regular matrix everywhere:
        of canonical variables, in any order. None of others."""
        n = len(states)
        # off the orbit, which may lie in a subspace: scattered by a tenth of its size
        x = states[:, np.arange(4 * n) * states.shape[1] // (4 * n)]
        x = x + 6 * offset(states)[:, None] * np.sin(np.arange(x.size) ** 2).reshape(x.shape)
        (G, *_), field = self.gradients(x, p), values(f, 0.0, x, p)
        inverse = np.linalg.pinv(G, rcond=_CONSTANT)
        J = field @ inverse.T
        # no gradient has a part along the shifts of a symmetry: there it is minus its transpose
        J = J - J.T @ (np.eye(n) - inverse @ G)
        off = abs(J @ G.T - field).max() / abs(field).max(), abs(J + J.T).max() / abs(J).max()
        return J if max(off) <= _CONSTANT < 1 / np.linalg.cond(J) else None


def quantities_of(conserves: Any) -> Quantities:
    """Make functions of (t, x, p) of what was given as `conserves`, and name them."""
    given = {"energy": conserves} if callable(conserves) else conserves
    if not (isinstance(given, Mapping) and given and all(map(callable, given.values()))):
        raise BadInput(f"conserves = {brief(given)}: a function of (x, p), or a dict of several")
    return {name: partial(_at_state, H) for name, H in given.items()}


def _at_state(quantity: Any, t: Any, x: Any, p: Params) -> Any:
    return quantity(x, p)


def refuse_drift(
    quantities: Quantities, f: Function, states: Array, params: Params, moved: Sequence[str] = ()
) -> None:
    """Refuse what is not conserved beside states, shape (n, m), also where parameters move."""
    x = states + offset(states)[:, None] * np.cos(np.arange(states.size)).reshape(states.shape)
    for name in ("", *(name for name in moved if name in params)):
        p = {**params, **({name: params[name] + 0.01 * (abs(params[name]) or 1.0)} if name else {})}
        for called, quantity in quantities.items():
            check_function(f"conserves ({called}), of x and p,", quantity, (), 0.0, x[:, 0], p)
        if drifts := drift(quantities, f, x, p, f" where {name} moves" if name else ""):
            raise BadInput(f"{drifts}; conserves= is a function of (x, p), constant along the flow")


def drift(quantities: Quantities, f: Function, x: Array, p: Params, where: str = "") -> str:
    """Say which quantity changes along the flow at states, shape (n, m), beyond rounding; empty if
    none does."""
    for called, quantity in quantities.items():
        terms = slopes(quantity, 0.0, x, p)[1][0, :-1] * values(f, 0.0, x, p)
        rates, size = terms.sum(axis=0), abs(terms).sum(axis=0).max()
        worst = int(abs(rates).argmax())
        if abs(rates[worst]) > _DRIFTS * size:
            return (
                f"{called} is not conserved{where}: it changes at the rate {rates[worst]:.3g} "
                f"{place(0.0, x[:, worst])}, of terms up to {size:.3g}"
            )
    return ""


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
    return on_axis(np.array(found, dtype=complex))


def on_axis(indices: NDArray[Any]) -> NDArray[np.complex128]:
    """Put on the real axis what is off it alone: indices leave it two at once, as conjugates."""
    apart = abs(indices[:, None] - indices.conj())
    two = apart.min(axis=1, initial=math.inf) < apart.diagonal()
    return np.where(two & (abs(indices.imag) > _LEAVES), indices, indices.real + 0j)
