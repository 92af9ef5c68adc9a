"""A forcing written as a formula: taken apart, verified, and differentiated in its parameters."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contbreather.errors import BadInput
from contbreather.lattice import formula
from contbreather.lattice.forcing import (
    FloatArray,
    Forcing,
    Harmonic,
    Harmonics,
    Periodic,
    Series,
    check_size,
    is_finite,
    odd_spectrum,
    response_of,
)
from contbreather.lattice.formula import Dual, NotExact, Waves, cut, shown

if TYPE_CHECKING:
    import sympy

HARMONIC = "-cos(t)"
# names that already mean something
RESERVED = ("a", "gamma", "k", "damping", "spring", "p", "phi", "t")


@dataclass(frozen=True, init=False, repr=False)
class Symbolic(Periodic):
    """A formula (or sympy expression) in ``t`` for F/a; other names in it are parameters.

    A trigonometric polynomial is taken apart exactly; anything else analytic and periodic is
    expanded numerically until the rest is below 4e-15 of the largest harmonic. Antisymmetry is
    verified symbolically where the formula shows it, otherwise numerically, and `describe` says
    which. Nothing is executed, and no formula takes longer than a moment: it is refused instead.

    Parameters
    ----------
    expression : str or sympy.Expr
        For instance ``"-cos(t) - 2.7*cos(3*t)"`` or ``"-cos(t)/(1 + e*cos(2*t))"``; ^ is a power.
    **params : float
        A value for every free symbol other than t. The names a, gamma, k, p, phi are taken.

    Raises
    ------
    BadInput
        No formula, a missing or unknown parameter, not antisymmetric (hence also: not 2 pi
        periodic, or with a mean), not finite, with kinks that no series resolves, or too large.

    Examples
    --------
    >>> forcing = Symbolic("-cos(t) - c*cos(3*t)", c=2.7)
    >>> round(forcing.f(0.0), 14), round(forcing.at(c=0.9).f(0.0), 14)
    (1.3, 1.1)
    """

    expression: str
    values: tuple[tuple[str, float], ...]

    def __init__(self, expression: str | sympy.Expr, /, **params: float) -> None:
        read = _read(str(expression))
        for name, value in params.items():
            if not is_finite(value):
                raise BadInput(f"forcing parameter {name} = {value!r} is not a finite number.")
        object.__setattr__(self, "expression", read.text)
        values = tuple(sorted((name, float(value)) for name, value in params.items()))
        object.__setattr__(self, "values", values)
        self._check_names(read.letters)  # before anything is said of times
        f, slopes, proof = _resolved(read, dict(values))
        object.__setattr__(self, "_series", Series(f))
        object.__setattr__(self, "_slopes", {n: Series(h) for n, h in slopes.items()})
        object.__setattr__(self, "_proof", proof)

    def _check_names(self, free: frozenset[str]) -> None:
        given = {name for name, _ in self.values}
        if taken := sorted(free & set(RESERVED)):
            raise BadInput(
                f"{', '.join(taken)} in {shown(self.expression)}: the names {', '.join(RESERVED)} "
                "are taken (the amplitude a multiplies any forcing by itself); rename it."
            )
        if missing := sorted(free - given):
            raise BadInput(
                f"{shown(self.expression)} needs a value for {cut(', '.join(missing))}; the time "
                "is t."
            )
        if unknown := sorted(given - free):
            raise BadInput(
                f"unknown forcing parameter {cut(', '.join(unknown))}: {shown(self.expression)} "
                f"has {cut(', '.join(sorted(free))) or 'none'}."
            )

    @property
    def params(self) -> dict[str, float]:
        return dict(self.values)

    def at(self, /, **params: float) -> Symbolic:
        """The same expression with other values of its parameters."""
        if unknown := [name for name in params if name not in self.params]:
            raise self._unknown(unknown)
        return Symbolic(self.expression, **(self.params | params))

    def _slope(self, name: str) -> Series:
        slopes: dict[str, Series] = self._slopes  # type: ignore[attr-defined]
        if name not in slopes:
            raise self._unknown([name])
        return slopes[name]

    def describe(self) -> str:
        values = "".join(f", {n} = {v:.6g}" for n, v in self.values)
        return f"F = a ({self.expression}){values}; antisymmetry verified {self._proof}"  # type: ignore[attr-defined]

    def __repr__(self) -> str:
        values = "".join(f", {n}={v!r}" for n, v in self.values)
        return f"Symbolic({self.expression!r}{values})"


def forcing_of(given: Forcing | str | sympy.Expr | None) -> Forcing:
    """A forcing from what was given: itself, a formula in t, or nothing for the harmonic one.

    Examples
    --------
    >>> forcing_of("-cos(t) - 2.7*cos(3*t)").highest
    3
    """
    if given is None or (isinstance(given, str) and given.replace(" ", "") == HARMONIC):
        return Harmonic()
    if isinstance(given, str) or hasattr(given, "free_symbols"):
        return Symbolic(given)
    if isinstance(given, type) or not hasattr(given, "harmonics"):
        raise BadInput(
            f"forcing = {given!r}: F/a was expected, a formula in t such as '-cos(t)', or a "
            "Harmonic, Fourier, Symbolic or Samples."
        )
    return given


class _Read(NamedTuple):
    """A formula, and what is known of it for all values of its parameters."""

    text: str
    tree: ast.expr
    letters: frozenset[str]
    work: int
    parity: int

    def about(self, name: str) -> str:
        """What a sentence calls the formula, or its slope in a parameter."""
        return f"the forcing {shown(f'd/d{name} of {self.text}' if name else self.text)}"


@lru_cache(maxsize=64)
def _read(text: str) -> _Read:
    tree = formula.parsed(text)
    letters = formula.letters(tree)
    carried = 1 + len(letters)
    if carried * formula.size(tree) > formula.LARGEST:
        raise formula.too_large(text)
    work = carried * formula.work(tree)
    return _Read(ast.unparse(tree), tree, letters, work, formula.parity(tree))


Spectrum = Mapping[int, complex]  # C_m - i S_m by m
Resolved = tuple[Harmonics, dict[str, Harmonics], str]  # f, its slopes, how it was verified


def _resolved(read: _Read, params: Mapping[str, float]) -> Resolved:
    with np.errstate(all="ignore"):  # what is not finite is refused by name
        try:
            spectra, proven = _exact(read, params)
        except NotExact:
            spectra, proven = _sampled(read, params), False
    proof = "symbolically" if proven or read.parity == -1 else "numerically"
    largest = max((abs(c) for c in spectra[""].values()), default=0.0)
    if largest == 0.0:
        raise BadInput(
            f"{read.about('')} is zero{_at(params)}; a breather needs one that moves it, "
            "for instance '-cos(t)'."
        )
    check_size(largest, read.about(""))
    responses = {name: response_of(one, 1e-17 * largest) for name, one in spectra.items()}
    return responses.pop(""), responses, proof


def _at(params: Mapping[str, float]) -> str:
    return f" at {', '.join(f'{n} = {v:g}' for n, v in params.items())}" if params else ""


def _values(read: _Read, params: Mapping[str, float], t: Any) -> dict[str, Any]:
    """The formula at t under the name "", its slopes under those of the parameters."""
    known = {n: Dual(np.float64(v), {n: np.float64(1.0)}) for n, v in params.items()}
    known |= {"t": Dual(t, {}), "pi": Dual(np.float64(np.pi), {})}
    value, slopes = formula.evaluate(read.tree, known)
    return {"": value, **slopes}


def _exact(read: _Read, params: Mapping[str, float]) -> tuple[dict[str, Spectrum], bool]:
    """Harmonics of a trigonometric polynomial, and whether no even one is left even by rounding."""
    t = Waves(np.zeros(1, dtype=complex), 1.0)
    zero = Waves(np.zeros(1, dtype=complex))
    found: dict[str, Spectrum] = {}
    proven = True
    for name, value in _values(read, params, t).items():
        spectrum = (zero + value).spectrum
        largest = max(map(abs, spectrum.values()))
        if not np.isfinite(largest):
            raise BadInput(f"{read.about(name)} is not finite{_at(params)}; correct the formula.")
        if even := [m for m, c in spectrum.items() if m % 2 == 0 and abs(c) > 1e-12 * largest]:
            raise BadInput(
                f"{read.about(name)} has the even harmonic {even[0]}: it is not antisymmetric, "
                "F(t + pi) = -F(t); keep odd harmonics only."
            )
        found[name] = {m: c for m, c in spectrum.items() if m % 2}
        proven = proven and not any(c for m, c in spectrum.items() if m % 2 == 0)
    return found, proven


def _sampled(read: _Read, params: Mapping[str, float]) -> dict[str, Spectrum]:
    if read.work > formula.SAMPLED:
        raise formula.too_large(read.text)
    found: dict[str, Spectrum | None] = {"": None}
    size = 32
    while size <= 8192 and None in found.values():
        t = np.concatenate([2.0 * np.pi * np.arange(size) / size, _PROBES, _PROBES - 6.0 * np.pi])
        for name, raw in _values(read, params, t).items():
            if found.get(name) is None:
                values = np.broadcast_to(raw, t.shape)
                found[name] = _expanded(read, name, values[:size], *np.split(values[size:], 2))
        size *= 2
    for name, spectrum in found.items():
        if spectrum is None:
            raise BadInput(
                f"{read.about(name)} is not resolved by 2048 harmonics (a jump, a kink, too "
                "steep a flank?); give the harmonics you mean with Fourier."
            )
    return found  # type: ignore[return-value]  # none is None


_PROBES = np.sqrt(np.array([0.3, 1.7, 5.3, 11.0, 17.9, 31.1]))


def _expanded(
    read: _Read, name: str, values: FloatArray, between: FloatArray, before: FloatArray
) -> Spectrum | None:
    """The odd harmonics of samples over a period, if they give those in between, too."""
    if not all(np.isfinite(part).all() for part in (values, between, before)):
        raise BadInput(f"{read.about(name)} is not a finite real number at every t.")
    _check_antisymmetric(read, name, values)
    check_size(float(np.max(np.abs(values))), read.about(name))
    if read.parity != -1 and np.max(np.abs(before - between)) > 1e-9 * np.max(np.abs(values)):
        raise BadInput(f"{read.about(name)} is not 2 pi periodic.")
    odd = odd_spectrum(values)
    largest = max(abs(c) for c in odd.values())
    tail = max(abs(c) for m, c in odd.items() if 4 * m > values.size)
    probe = Series(response_of(odd, 0.0)).at(_PROBES, 2) - between
    # off the grid too: a harmonic above it would hide in the samples
    if tail > 4e-15 * largest or np.max(np.abs(probe)) > 1e-13 * max(largest, 1e-300):
        return None
    return {m: c for m, c in odd.items() if abs(c) > 2e-16 * largest}


def _check_antisymmetric(read: _Read, name: str, values: FloatArray) -> None:
    half = values.size // 2
    size = float(np.max(np.abs(values)))
    middle = float(np.median(np.abs(values)))
    if size / 1e10 > middle > 0.0:
        raise BadInput(
            f"{read.about(name)} has a pole, or a peak like one: it reaches {size:.2g}, and half "
            f"of the time it is below {middle:.2g}."
        )
    worst = float(np.max(np.abs(values[:half] + values[half:])))
    if read.parity != -1 and worst > 1e-12 * size:  # what is proven may be rounded by more
        raise BadInput(
            f"{read.about(name)} is not antisymmetric: |F(t + pi) + F(t)| reaches {worst:.3g} "
            f"where |F| reaches {size:.3g}; the breather needs F(t + pi) = -F(t), "
            "hence also period 2 pi and no mean."
        )
