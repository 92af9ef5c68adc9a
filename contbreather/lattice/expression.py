"""A forcing written as a formula: sympy takes it apart, verifies it and differentiates it.

sympy is imported when the first formula is met, not before.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contbreather.errors import BadInput
from contbreather.lattice.forcing import (
    FloatArray,
    Harmonics,
    Periodic,
    Series,
    is_finite,
    odd_spectrum,
    response_of,
)

if TYPE_CHECKING:
    import sympy

LARGEST_POWER = 99
# names that already mean something
RESERVED = ("a", "gamma", "k", "damping", "spring", "p", "phi", "t")


@dataclass(frozen=True, init=False, repr=False)
class Symbolic(Periodic):
    """A sympy expression (or its text) in ``t`` for F/a; other free symbols are parameters.

    A trigonometric polynomial is taken apart exactly; anything else analytic and periodic is
    expanded numerically until the rest is below 4e-15 of the largest harmonic. Antisymmetry is
    verified symbolically where sympy can, otherwise numerically, and `describe` says which.

    Parameters
    ----------
    expression : str or sympy.Expr
        For instance ``"-cos(t) - 2.7*cos(3*t)"`` or ``"-cos(t)/(1 + e*cos(2*t))"``.
    **params : float
        A value for every free symbol other than t. The names a, gamma, k, p, phi are taken.

    Raises
    ------
    BadInput
        Not an expression, a missing or unknown parameter, not antisymmetric (hence also: not
        2 pi periodic, or with a mean), not finite, or with kinks that no series resolves.

    Examples
    --------
    >>> forcing = Symbolic("-cos(t) - c*cos(3*t)", c=2.7)
    >>> round(forcing.f(0.0), 14), round(forcing.at(c=0.9).f(0.0), 14)
    (1.3, 1.1)
    """

    expression: str
    values: tuple[tuple[str, float], ...]

    def __init__(self, expression: str | sympy.Expr, **params: float) -> None:
        text = _canonical(expression)
        for name, value in params.items():
            if not is_finite(value):
                raise BadInput(f"forcing parameter {name} = {value!r} is no finite number.")
        object.__setattr__(self, "expression", text)
        values = tuple(sorted((name, float(value)) for name, value in params.items()))
        object.__setattr__(self, "values", values)
        self._check_names(_letters(text))  # before anything is said of a time dependence
        compiled = _compile(text)
        harmonics, slopes = compiled.resolve(dict(values))
        object.__setattr__(self, "_series", Series(harmonics))
        object.__setattr__(self, "_slopes", {n: Series(h) for n, h in slopes.items()})
        object.__setattr__(self, "_proof", compiled.proof)

    def _check_names(self, free: set[str]) -> None:
        given = {name for name, _ in self.values}
        if taken := sorted(free & set(RESERVED)):
            raise BadInput(
                f"{', '.join(taken)} in {self.expression!r}: the names {', '.join(RESERVED)} are "
                "taken (the amplitude a multiplies any forcing by itself); rename it."
            )
        if missing := sorted(free - given):
            time = "" if "t" in _words(self.expression) else "; the time is t"
            raise BadInput(f"{self.expression!r} needs a value for {', '.join(missing)}{time}.")
        if unknown := sorted(given - free):
            raise BadInput(
                f"unknown forcing parameter {', '.join(unknown)}: {self.expression!r} has "
                f"{', '.join(sorted(free)) or 'none'}."
            )

    @property
    def _f(self) -> Series:
        return self._series  # type: ignore[attr-defined]

    @property
    def params(self) -> dict[str, float]:
        return dict(self.values)

    def at(self, **params: float) -> Symbolic:
        """The same expression with other values of its parameters."""
        if unknown := [name for name in params if name not in self.params]:
            raise self._unknown(unknown)
        return Symbolic(self.expression, **(self.params | params))

    def f_param(self, name: str, t: float, order: int = 0) -> float:
        """Derivative of the order-th derivative of f with respect to one parameter."""
        if name not in self.params:
            raise self._unknown([name])
        return float(self._slopes[name].at(t, order))  # type: ignore[attr-defined]

    def slope_harmonics(self, name: str) -> Harmonics:
        """The series of the derivative of f with respect to one parameter."""
        slopes: dict[str, Series] = self._slopes  # type: ignore[attr-defined]
        return slopes[name].harmonics

    def describe(self) -> str:
        values = "".join(f", {n} = {v:.6g}" for n, v in self.values)
        return f"F = a ({self.expression}){values}; antisymmetry verified {self._proof}"  # type: ignore[attr-defined]

    def __repr__(self) -> str:
        values = "".join(f", {n}={v!r}" for n, v in self.values)
        return f"Symbolic({self.expression!r}{values})"


_FUNCTIONS = {"sin", "cos", "tan", "sec", "csc", "cot", "sinh", "cosh", "tanh", "besselj"}
_FUNCTIONS |= {"exp", "log", "sqrt", "asin", "acos", "atan", "Abs", "sign"}
_GRAMMAR = (
    ast.Expression,
    ast.BinOp,
    ast.UnaryOp,
    ast.Call,
    ast.Name,
    ast.Constant,
    ast.Load,
    ast.operator,
    ast.unaryop,
)


def _canonical(expression: str | sympy.Expr) -> str:
    """The expression as text that holds nothing but formulas (sympy would run anything)."""
    if not isinstance(expression, str):
        expression = str(expression)
    try:
        tree = ast.parse(expression.strip(), mode="eval")
    except SyntaxError as error:
        raise BadInput(
            f"{expression!r} is no formula: {error.msg}; write it as Python, for instance "
            "'-cos(t) - 2.7*cos(3*t)'."
        ) from None
    for node in ast.walk(tree):
        good = isinstance(node, _GRAMMAR)
        if isinstance(node, ast.Call):
            good = isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS
        if isinstance(node, ast.Constant):
            good = isinstance(node.value, int | float)
        if not good:
            raise BadInput(
                f"{expression!r} holds {ast.unparse(node)!r}, which no forcing may: use numbers, "
                f"t, names of parameters, + - * / ** and {', '.join(sorted(_FUNCTIONS))}."
            )
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            _check_power(node, expression)
    return ast.unparse(tree)


def _check_power(node: ast.BinOp, expression: str) -> None:
    """sympy multiplies powers out: refuse those that would take it for ever."""
    names = any(isinstance(part, ast.Name) for part in ast.walk(node.right))
    sizes = [n.value for n in ast.walk(node.right) if isinstance(n, ast.Constant)]
    numbers = [size for size in sizes if isinstance(size, int | float)]
    towers = any(isinstance(part, ast.Pow) for part in ast.walk(node.right))
    if towers or (not names and any(abs(x) > LARGEST_POWER for x in numbers)):
        raise BadInput(
            f"{ast.unparse(node)!r} in {expression!r}: powers up to {LARGEST_POWER} are taken."
        )


def _words(text: str) -> set[str]:
    """All names in a formula, functions left out."""
    nodes = ast.walk(ast.parse(text, mode="eval"))
    return {node.id for node in nodes if isinstance(node, ast.Name)} - _FUNCTIONS


def _letters(text: str) -> set[str]:
    """The names in a formula that need a value."""
    return _words(text) - {"t", "pi"}


Spectrum = Callable[[Mapping[str, float]], dict[int, complex]]


class _Compiled(NamedTuple):
    """A forcing expression made ready: its spectrum and those of its parameter slopes."""

    text: str
    names: tuple[str, ...]
    proof: str
    spectrum: Spectrum
    slopes: dict[str, Spectrum]

    def resolve(self, params: Mapping[str, float]) -> tuple[Harmonics, dict[str, Harmonics]]:
        spectrum = self.spectrum(params)
        largest = max((abs(c) for c in spectrum.values()), default=0.0)
        if not math.isfinite(largest) or largest == 0.0:
            where = ", ".join(f"{name} = {value:g}" for name, value in params.items())
            raise BadInput(
                f"the forcing {self.text!r} {'is zero' if largest == 0.0 else 'is not finite'}"
                f"{f' at {where}' if where else ''}; a breather needs one that moves it, "
                "for instance '-cos(t)'."
            )
        slopes = {n: response_of(s(params), 1e-17 * largest) for n, s in self.slopes.items()}
        return response_of(spectrum, 1e-17 * largest), slopes


@lru_cache(maxsize=64)
def _compile(text: str) -> _Compiled:
    import sympy

    t = sympy.Symbol("t", real=True)
    symbols = {name: sympy.Symbol(name, real=True) for name in sorted(_letters(text))}
    try:
        expression = sympy.sympify(text, locals={**symbols, "t": t})
    except (sympy.SympifyError, TypeError, ValueError) as error:
        raise BadInput(f"sympy cannot read the forcing {text!r}: {error}") from None
    if expression.has(sympy.zoo, sympy.oo, sympy.nan):
        raise BadInput(f"the forcing {text!r} is not finite; correct the formula.")
    exact = _trigonometric(expression, t)
    if exact is None:
        return _compile_sampled(text, t, symbols, expression)
    if even := sorted(m for m in exact if m % 2 == 0):
        raise BadInput(
            f"the forcing {text!r} has the even harmonic {even[0]}: it is not antisymmetric, "
            "F(t + pi) = -F(t); keep odd harmonics only."
        )
    order = tuple(symbols.values())
    slopes = {
        name: _exact_spectrum(order, {m: (c.diff(v), s.diff(v)) for m, (c, s) in exact.items()})
        for name, v in symbols.items()
    }
    return _Compiled(text, tuple(symbols), "symbolically", _exact_spectrum(order, exact), slopes)


def _compile_sampled(text: str, t: Any, symbols: Mapping[str, Any], expression: Any) -> _Compiled:
    import sympy

    order = tuple(symbols.values())
    residue = sympy.simplify(sympy.expand(expression + expression.subs(t, t + sympy.pi)))
    proof = "symbolically" if residue == 0 else "numerically"
    slopes = {
        name: _sampled_spectrum(f"d/d{name} of {text}", (t, *order), expression.diff(v))
        for name, v in symbols.items()
    }
    spectrum = _sampled_spectrum(text, (t, *order), expression)
    return _Compiled(text, tuple(symbols), proof, spectrum, slopes)


def _trigonometric(expression: Any, t: Any) -> dict[int, tuple[Any, Any]] | None:
    """``{m: (C_m, S_m)}`` if the expression is a trigonometric polynomial in t, else None."""
    import sympy

    waves = sympy.expand(sympy.expand(expression.rewrite(sympy.exp)), power_exp=True)
    parts: dict[int, Any] = {}
    for term in sympy.Add.make_args(waves):
        rest, wave = term.as_independent(t, as_Add=False)
        wave = sympy.powsimp(wave)
        if wave == 1:
            m = sympy.Integer(0)
        elif isinstance(wave, sympy.exp):
            m = sympy.expand(wave.exp / (sympy.I * t))
        else:
            return None
        if not m.is_Integer:
            return None
        parts[int(m)] = parts.get(int(m), sympy.Integer(0)) + rest
    found = {}
    for m in sorted(m for m in parts if m >= 0):
        c, s = (sympy.simplify(part) for part in sympy.expand_complex(2 * parts[m]).as_real_imag())
        if c != 0 or s != 0:
            found[m] = (c, -s)
    return found


def _exact_spectrum(order: Sequence[Any], table: Mapping[int, tuple[Any, Any]]) -> Spectrum:
    import sympy

    function = sympy.lambdify(order, list(table.values()), "math")

    def spectrum(params: Mapping[str, float]) -> dict[int, complex]:
        values = function(*(params[str(s)] for s in order))
        return {m: complex(c, -s) for m, (c, s) in zip(table, values, strict=True)}

    return spectrum


def _sampled_spectrum(text: str, order: Sequence[Any], expression: Any) -> Spectrum:
    import sympy

    function = sympy.lambdify(order, expression, ["numpy", "scipy"])

    def sample(t: FloatArray, params: Mapping[str, float]) -> FloatArray:
        with np.errstate(all="ignore"):  # what is not finite is refused right below
            raw = np.asarray(function(t, *(params[str(s)] for s in order[1:])))
        if np.iscomplexobj(raw) or not np.all(np.isfinite(raw)):
            raise BadInput(f"the forcing {text!r} is not a finite real number at every t.")
        return np.array(np.broadcast_to(raw, t.shape), dtype=float)

    def spectrum(params: Mapping[str, float]) -> dict[int, complex]:
        size = 32
        while size <= 8192:
            values = sample(2.0 * np.pi * np.arange(size) / size, params)
            _check_antisymmetric(text, values)
            odd = odd_spectrum(values)
            largest = max(abs(c) for c in odd.values())
            tail = max(abs(c) for m, c in odd.items() if 4 * m > size)
            probe = Series(response_of(odd, 0.0)).at(_PROBES, 2) - sample(_PROBES, params)
            # off the grid too: a harmonic above it would hide in the samples
            if tail <= 4e-15 * largest and np.max(np.abs(probe)) <= 1e-13 * max(largest, 1e-300):
                return {m: c for m, c in odd.items() if abs(c) > 2e-16 * largest}
            size *= 2
        raise BadInput(
            f"the forcing {text!r} is not resolved by 2048 harmonics (a jump or a kink?); give the "
            "harmonics you mean with Fourier."
        )

    return spectrum


_PROBES = np.sqrt(np.array([0.3, 1.7, 5.3, 11.0, 17.9, 31.1]))


def _check_antisymmetric(text: str, values: FloatArray) -> None:
    half = values.size // 2
    size = float(np.max(np.abs(values)))
    if size > 1e10 * float(np.median(np.abs(values))) > 0.0:
        raise BadInput(f"the forcing {text!r} has a pole: it reaches {size:.2g} near it.")
    worst = float(np.max(np.abs(values[:half] + values[half:])))
    if worst > 1e-12 * size:
        raise BadInput(
            f"the forcing {text!r} is not antisymmetric: |F(t + pi) + F(t)| reaches {worst:.3g} "
            f"where |F| reaches {size:.3g}; the breather needs F(t + pi) = -F(t), "
            "hence also period 2 pi and no mean."
        )
