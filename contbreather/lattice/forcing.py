"""What drives the chain: ``F(t) = a * shape(t)``, 2 pi periodic, antisymmetric, the same on every site.

A forcing answers for ``f`` with ``f'' = F``, ``f(t + pi) = -f(t)`` (eq. (5)), always at unit
amplitude: the amplitude ``a`` belongs to the breather. Antisymmetry leaves odd harmonics only,
and then f is F with each harmonic m divided by ``-m^2``: no constants of integration are left.
Whatever the forcing was given as, inside it is one trigonometric series.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.errors import BadInput

if TYPE_CHECKING:
    import sympy

FloatArray = NDArray[np.float64]
RESERVED = ("a", "gamma", "k", "p", "phi", "t")  # names that already mean something
LONG = 12  # from so many harmonics on numpy beats a loop, even for one time

Harmonics = tuple[tuple[int, float, float], ...]  # (m, A, B): A cos(m t) + B sin(m t)


class Forcing(Protocol):
    """Everything a breather asks of its forcing; all values are at unit amplitude.

    ``f, df, d2f, d3f`` are f and its derivatives (``d2f`` is F itself): a float for a float, an
    array for an array. ``params`` are the forcing's own continuation parameters, `at` returns
    the forcing with some of them changed, ``f_param(name, t, order)`` is the derivative of
    the order-th derivative of f with respect to one of them.
    """

    @overload
    def f(self, t: float) -> float: ...
    @overload
    def f(self, t: FloatArray) -> FloatArray: ...
    @overload
    def df(self, t: float) -> float: ...
    @overload
    def df(self, t: FloatArray) -> FloatArray: ...
    @overload
    def d2f(self, t: float) -> float: ...
    @overload
    def d2f(self, t: FloatArray) -> FloatArray: ...
    @overload
    def d3f(self, t: float) -> float: ...
    @overload
    def d3f(self, t: FloatArray) -> FloatArray: ...
    @property
    def params(self) -> dict[str, float]: ...
    @property
    def highest(self) -> int: ...
    @property
    def harmonics(self) -> Harmonics: ...
    def at(self, **params: float) -> Forcing: ...
    def f_param(self, name: str, t: float, order: int = 0) -> float: ...
    def peak(self) -> float: ...
    def describe(self) -> str: ...


class _Series:
    """f as a trigonometric series, with its derivatives of any order."""

    __slots__ = ("harmonics", "m", "pair")

    def __init__(self, harmonics: Harmonics) -> None:
        self.harmonics = harmonics
        self.m = np.array([h[0] for h in harmonics], dtype=float)
        self.pair = np.array([[h[1], h[2]] for h in harmonics], dtype=float).reshape(-1, 2)

    def at(self, t: Any, order: int) -> Any:
        if isinstance(t, float | int):
            if len(self.harmonics) < LONG:
                return self._loop(t, order)
            return float(self._arrays(np.asarray(t, dtype=float), order))
        return self._arrays(np.asarray(t, dtype=float), order)

    def _loop(self, t: float, order: int) -> float:
        total = 0.0
        for m, a, b in self.harmonics:
            c, s = math.cos(m * t), math.sin(m * t)
            value = b * c - a * s if order % 2 else a * c + b * s
            total += value * m**order
        return -total if order % 4 >= 2 else total

    def _arrays(self, t: FloatArray, order: int) -> FloatArray:
        angle = np.multiply.outer(t, self.m)
        weight = self.pair * (self.m[:, None] ** order) * (-1.0 if order % 4 >= 2 else 1.0)
        if order % 2:
            return np.asarray(np.cos(angle) @ weight[:, 1] - np.sin(angle) @ weight[:, 0])
        return np.asarray(np.cos(angle) @ weight[:, 0] + np.sin(angle) @ weight[:, 1])


class _Periodic:
    """Shared by every forcing that is a series: evaluation, and the largest |f|."""

    if TYPE_CHECKING:

        @property
        def _f(self) -> _Series: ...

        def describe(self) -> str: ...

    def f(self, t: Any) -> Any:
        return self._f.at(t, 0)

    def df(self, t: Any) -> Any:
        return self._f.at(t, 1)

    def d2f(self, t: Any) -> Any:
        return self._f.at(t, 2)

    def d3f(self, t: Any) -> Any:
        return self._f.at(t, 3)

    @property
    def harmonics(self) -> Harmonics:
        return self._f.harmonics

    @property
    def highest(self) -> int:
        return max((m for m, a, b in self._f.harmonics if a or b), default=1)

    @property
    def params(self) -> dict[str, float]:
        return {}

    def peak(self) -> float:
        """Largest |f| at unit amplitude; ``a * peak() <= 1`` keeps the far field off its walls."""
        return _peak(self._f.harmonics)

    def _unknown(self, names: Sequence[str]) -> BadInput:
        have = ", ".join(self.params) or "none"
        return BadInput(
            f"unknown forcing parameter {', '.join(map(repr, names))}: "
            f"this forcing ({self.describe()}) has {have}."
        )


@lru_cache(maxsize=64)
def _peak(harmonics: Harmonics) -> float:
    series = _Series(harmonics)
    highest = max(m for m, _, _ in harmonics)
    t = np.linspace(0.0, math.pi, 32 * highest + 1)
    values = np.abs(series.at(t, 0))
    best = float(values.max())
    # every crest that could still win; the grid misses at most (highest h)^2/2 of a crest
    for start in t[values >= best * (1.0 - 0.01)]:
        x = float(start)
        for _ in range(6):
            curvature = series.at(x, 2)
            if curvature == 0.0:
                break
            x -= max(-0.1, min(0.1, series.at(x, 1) / curvature))
        best = max(best, abs(series.at(x, 0)))
    return best


@dataclass(frozen=True)
class Harmonic(_Periodic):
    """``F = -a cos t``, so ``f = a cos t``: the forcing of eq. (13).

    Examples
    --------
    >>> Harmonic().f(0.0), Harmonic().d2f(0.0)
    (1.0, -1.0)
    """

    @property
    def _f(self) -> _Series:
        return _COSINE

    def f(self, t: Any) -> Any:
        return math.cos(t) if isinstance(t, float | int) else np.cos(t)

    def df(self, t: Any) -> Any:
        return -math.sin(t) if isinstance(t, float | int) else -np.sin(t)

    def d2f(self, t: Any) -> Any:
        return -math.cos(t) if isinstance(t, float | int) else -np.cos(t)

    def d3f(self, t: Any) -> Any:
        return math.sin(t) if isinstance(t, float | int) else np.sin(t)

    @property
    def highest(self) -> int:
        return 1

    def peak(self) -> float:
        return 1.0

    def at(self, **params: float) -> Harmonic:
        if params:
            raise self._unknown(list(params))
        return self

    def f_param(self, name: str, t: float, order: int = 0) -> float:
        raise self._unknown([name])

    def describe(self) -> str:
        return "F = -a cos t"


_COSINE = _Series(((1, 1.0, 0.0),))


@dataclass(frozen=True, init=False, repr=False)
class Fourier(_Periodic):
    """A sum of odd harmonics: ``F/a = sum of C_m cos(m t) + S_m sin(m t)``.

    Parameters
    ----------
    cos, sin : mapping of odd positive int to float
        The coefficients of F/a. Their names as continuation parameters are ``c1, c3, ...``
        and ``s1, s3, ...`` (those given, zeros included): a small third harmonic can be grown
        from ``cos={1: -1.0, 3: 0.0}``.

    Raises
    ------
    BadInput
        For an even or non-positive order (not antisymmetric, or a mean), a coefficient that is
        not finite, or no forcing at all.

    Examples
    --------
    >>> Fourier(cos={1: -1.0}).f(0.0)
    1.0
    >>> Fourier.from_response(cos={1: 1.0, 3: 0.3}).params
    {'c1': -1.0, 'c3': -2.6999999999999997}
    """

    cos: tuple[tuple[int, float], ...]
    sin: tuple[tuple[int, float], ...]

    def __init__(
        self, cos: Mapping[int, float] | None = None, sin: Mapping[int, float] | None = None
    ) -> None:
        object.__setattr__(self, "cos", _coefficients("cos", cos or {}))
        object.__setattr__(self, "sin", _coefficients("sin", sin or {}))
        if not any(c for _, c in self.cos + self.sin):
            raise BadInput(
                "the forcing is zero: give at least one coefficient of an odd harmonic, "
                "for example cos={1: -1.0} for F = -a cos t."
            )
        c, s = dict(self.cos), dict(self.sin)
        orders = sorted({*c, *s})
        f = tuple((m, -c.get(m, 0.0) / m**2, -s.get(m, 0.0) / m**2) for m in orders)
        object.__setattr__(self, "_series", _Series(f))

    @classmethod
    def from_response(
        cls, cos: Mapping[int, float] | None = None, sin: Mapping[int, float] | None = None
    ) -> Fourier:
        """The same from the coefficients of f instead of F: F's are ``-m^2`` times those."""
        return cls(
            {m: -(m**2) * c for m, c in (cos or {}).items()},
            {m: -(m**2) * c for m, c in (sin or {}).items()},
        )

    @property
    def _f(self) -> _Series:
        return self._series  # type: ignore[attr-defined, no-any-return]

    @property
    def params(self) -> dict[str, float]:
        return {f"c{m}": v for m, v in self.cos} | {f"s{m}": v for m, v in self.sin}

    def at(self, **params: float) -> Fourier:
        """The same forcing with some coefficients changed."""
        if unknown := [name for name in params if name not in self.params]:
            raise self._unknown(unknown)
        return Fourier(
            {m: params.get(f"c{m}", v) for m, v in self.cos},
            {m: params.get(f"s{m}", v) for m, v in self.sin},
        )

    def f_param(self, name: str, t: float, order: int = 0) -> float:
        """Derivative of the order-th derivative of f with respect to one coefficient."""
        if name not in self.params:
            raise self._unknown([name])
        m = int(name[1:])
        unit = (m, -1.0 / m**2, 0.0) if name[0] == "c" else (m, 0.0, -1.0 / m**2)
        return float(_Series((unit,)).at(t, order))

    def describe(self) -> str:
        terms = [f"{v:+.6g} cos {_times(m)}" for m, v in self.cos]
        terms += [f"{v:+.6g} sin {_times(m)}" for m, v in self.sin]
        return f"F = a ({' '.join(terms)})"

    def __repr__(self) -> str:
        return f"Fourier(cos={dict(self.cos)}, sin={dict(self.sin)})"


def _times(m: int) -> str:
    return "t" if m == 1 else f"{m}t"


def _coefficients(kind: str, given: Mapping[int, float]) -> tuple[tuple[int, float], ...]:
    for m, value in given.items():
        if isinstance(m, bool) or not isinstance(m, int | np.integer) or m < 1 or m % 2 == 0:
            raise BadInput(
                f"{kind} harmonic {m!r}: the forcing must be antisymmetric, F(t + pi) = -F(t), "
                "which leaves the odd harmonics 1, 3, 5, ... only; drop the others."
            )
        if not _is_finite(value):
            raise BadInput(f"{kind} harmonic {m}: its coefficient {value!r} is no finite number.")
    return tuple(sorted((int(m), float(v)) for m, v in given.items()))


def _is_finite(value: object) -> bool:
    try:
        return math.isfinite(float(value))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False


# ---------------------------------------------------------------------------- samples


@dataclass(frozen=True, init=False, repr=False)
class Samples(_Periodic):
    """F/a known on the uniform grid ``2 pi j/M``, j = 0..M-1, interpolated trigonometrically.

    Parameters
    ----------
    values : array_like, shape (M,)
        M even and at least 8. The upper half of the spectrum must be empty to 1e-10 of the largest
        harmonic (at least four points to the period of the highest harmonic); then F and f
        are right to about that everywhere, and to rounding for exact samples.

    Raises
    ------
    BadInput
        When not finite, not antisymmetric to 1e-9 of the largest value, zero, or unresolved.

    Examples
    --------
    >>> import numpy as np
    >>> t = 2 * np.pi * np.arange(16) / 16
    >>> round(Samples(-np.cos(t)).f(0.0), 14)
    1.0
    """

    values: tuple[float, ...]

    def __init__(self, values: ArrayLike) -> None:
        try:
            given = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            given = np.full(1, np.nan)
        if given.ndim != 1 or not np.all(np.isfinite(given)):
            raise BadInput("samples of the forcing must be one row of finite numbers.")
        if given.size < 8 or given.size % 2:
            raise BadInput(
                f"{given.size} samples: give an even number, at least 8, on t = 2 pi j/M, "
                "so that every sample has its partner half a period later."
            )
        object.__setattr__(self, "values", tuple(given.tolist()))
        half = given.size // 2
        size, worst = np.max(np.abs(given)), np.max(np.abs(given[:half] + given[half:]))
        if worst > 1e-9 * size:
            raise BadInput(
                f"the samples are not antisymmetric: |F(t + pi) + F(t)| reaches {worst:.3g} where "
                f"|F| reaches {size:.3g}; the symmetric breather needs F(t + pi) = -F(t)."
            )
        object.__setattr__(self, "_series", _Series(self._resolve(given, float(size))))

    @staticmethod
    def _resolve(values: FloatArray, size: float) -> Harmonics:
        if size == 0.0:
            raise BadInput("the forcing is zero: its samples are all 0.")
        spectrum = _odd_spectrum(values)
        largest = max(abs(c) for c in spectrum.values())
        tail = max(abs(c) for m, c in spectrum.items() if 4 * m > values.size)
        if tail > 1e-10 * largest:
            raise BadInput(
                f"{values.size} samples do not resolve this forcing: harmonics above "
                f"{values.size // 4} still reach {tail / largest:.1e} of the largest, so it may be "
                "aliased; sample finer, or smooth it, or give its harmonics with Fourier."
            )
        return _response_of(spectrum, 2e-16 * largest)

    @property
    def _f(self) -> _Series:
        return self._series  # type: ignore[attr-defined, no-any-return]

    def at(self, **params: float) -> Samples:
        if params:
            raise self._unknown(list(params))
        return self

    def f_param(self, name: str, t: float, order: int = 0) -> float:
        raise self._unknown([name])

    def describe(self) -> str:
        return f"F = a times {len(self.values)} samples, harmonics up to {self.highest}"

    def __repr__(self) -> str:
        return f"Samples(<{len(self.values)} values>)"


def _odd_spectrum(values: FloatArray) -> dict[int, complex]:
    """``{m: C_m - i S_m}`` of the odd harmonics below the Nyquist one."""
    spectrum = 2.0 * np.fft.rfft(values) / values.size
    return {m: complex(spectrum[m]) for m in range(1, (values.size + 1) // 2, 2)}


def _response_of(spectrum: Mapping[int, complex], floor: float) -> Harmonics:
    """f from the spectrum of F, without what is only rounding."""
    kept = {m: c for m, c in spectrum.items() if abs(c) > floor}
    return tuple((m, -c.real / m**2, c.imag / m**2) for m, c in sorted(kept.items()))


# --------------------------------------------------------------------------- symbolic


@dataclass(frozen=True, init=False, repr=False)
class Symbolic(_Periodic):
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
            if not _is_finite(value):
                raise BadInput(f"forcing parameter {name} = {value!r} is no finite number.")
        object.__setattr__(self, "expression", text)
        values = tuple(sorted((name, float(value)) for name, value in params.items()))
        object.__setattr__(self, "values", values)
        compiled = _compile(text)
        self._check_names(set(compiled.names))
        harmonics, slopes = compiled.resolve(dict(values))
        object.__setattr__(self, "_series", _Series(harmonics))
        object.__setattr__(self, "_slopes", {n: _Series(h) for n, h in slopes.items()})
        object.__setattr__(self, "_proof", compiled.proof)

    def _check_names(self, free: set[str]) -> None:
        given = {name for name, _ in self.values}
        if taken := sorted(free & set(RESERVED)):
            raise BadInput(
                f"{', '.join(taken)} in {self.expression!r}: the names {', '.join(RESERVED)} are "
                "taken (the amplitude a multiplies any forcing by itself); rename it."
            )
        if missing := sorted(free - given):
            raise BadInput(f"{self.expression!r} needs a value for {', '.join(missing)}.")
        if unknown := sorted(given - free):
            raise BadInput(
                f"unknown forcing parameter {', '.join(unknown)}: {self.expression!r} has "
                f"{', '.join(sorted(free)) or 'none'}."
            )

    @property
    def _f(self) -> _Series:
        return self._series  # type: ignore[attr-defined, no-any-return]

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

    def describe(self) -> str:
        values = "".join(f", {n} = {v:.6g}" for n, v in self.values)
        return f"F = a ({self.expression}){values}; antisymmetry verified {self._proof}"  # type: ignore[attr-defined]

    def __repr__(self) -> str:
        values = "".join(f", {n}={v!r}" for n, v in self.values)
        return f"Symbolic({self.expression!r}{values})"


_FUNCTIONS = frozenset(
    "sin cos tan sec csc cot exp log sqrt sinh cosh tanh asin acos atan besselj Abs sign".split()
)
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
    return ast.unparse(tree)


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
            raise BadInput(f"the forcing {self.text!r} is zero or not finite at {dict(params)}.")
        slopes = {n: _response_of(s(params), 1e-17 * largest) for n, s in self.slopes.items()}
        return _response_of(spectrum, 1e-17 * largest), slopes


@lru_cache(maxsize=64)
def _compile(text: str) -> _Compiled:
    import sympy

    t = sympy.Symbol("t", real=True)
    tree = ast.walk(ast.parse(text, mode="eval"))
    names = {node.id for node in tree if isinstance(node, ast.Name)} - _FUNCTIONS - {"t", "pi"}
    symbols = {name: sympy.Symbol(name, real=True) for name in sorted(names)}
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
            odd = _odd_spectrum(values)
            largest = max(abs(c) for c in odd.values())
            tail = max(abs(c) for m, c in odd.items() if 4 * m > size)
            probe = _Series(_response_of(odd, 0.0)).at(_PROBES, 2) - sample(_PROBES, params)
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
    worst = float(np.max(np.abs(values[:half] + values[half:])))
    if worst > 1e-12 * size:
        raise BadInput(
            f"the forcing {text!r} is not antisymmetric: |F(t + pi) + F(t)| reaches {worst:.3g} "
            f"where |F| reaches {size:.3g}; the breather needs F(t + pi) = -F(t), "
            "hence also period 2 pi and no mean."
        )
