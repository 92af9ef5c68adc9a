"""A forcing written as a formula in t: read, never executed, and expanded in harmonics by FFT.

Slopes in the parameters are complex steps.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contbreather.checks import brief, real
from contbreather.errors import BadInput
from contbreather.lattice.forcing import (
    LARGEST,
    ComplexArray,
    Drive,
    FloatArray,
    Forcing,
    Harmonic,
    Harmonics,
    Periodic,
    Samples,
    TrigonometricSeries,
    check_size,
    response_of,
    spectrum_of,
)
from contbreather.parameters import CHOICES, NAMES

if TYPE_CHECKING:
    import sympy

HARMONIC: str = CHOICES["forcing"].default
RESERVED = (*NAMES, "p", "phi", "t")  # names that already mean something
LARGEST_POWER = 99  # of t or a function: beyond, nothing a forcing is made of
FINEST = 8192  # samples of a period
STEP = 1e-204  # in a parameter: no difference is taken; its root is above any slope that is let in
PROBES = np.sqrt(np.array([0.3, 1.7, 5.3, 11.0, 17.9, 31.1]))  # times that are on no grid

# --- reading --------------------------------------------------------------------------------------


def _power(x: Any, n: Any) -> Any:
    if np.ndim(n) == 0 and abs(n) > LARGEST_POWER:
        raise BadInput(f"the power {n:.10g} is too high: powers up to {LARGEST_POWER} are taken.")
    return np.power(x, n)


def _besselj(n: Any, x: Any) -> Any:
    from scipy.special import jv  # dear to import

    y, step = np.real(x), np.imag(x)  # of which jv itself would lose so small a one
    return jv(n, y) + 0.5j * step * (jv(n - 1, y) - jv(n + 1, y)) if np.any(step) else jv(n, y)


FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{f.__name__: f for f in (np.sin, np.cos, np.tan, np.sinh, np.cosh, np.tanh)},
    **{f.__name__: f for f in (np.exp, np.log, np.sqrt)},
    **{"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan},
    "sec": lambda x: 1.0 / np.cos(x),
    "csc": lambda x: 1.0 / np.sin(x),
    "cot": lambda x: 1.0 / np.tan(x),
    "sign": lambda x: np.sign(np.real(x)),
    **dict.fromkeys(("Abs", "abs"), lambda x: x * np.sign(np.real(x))),  # SymPy's name, Python's
    "besselj": _besselj,
    **dict.fromkeys(("Max", "max"), lambda x, y: np.where(np.real(x) > np.real(y), x, y)),
    **dict.fromkeys(("Min", "min"), lambda x, y: np.where(np.real(x) < np.real(y), x, y)),
}
_OF_TWO = frozenset(("besselj", "Max", "max", "Min", "min"))
OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.UAdd: operator.pos, ast.USub: operator.neg, ast.Add: operator.add, ast.Sub: operator.sub,
    ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: _power,
}  # fmt: skip
Value = Callable[[Mapping[str, Any]], Any]


class Formula(NamedTuple):
    """A formula that holds nothing but numbers, names, arithmetic and `FUNCTIONS`."""

    text: str
    letters: frozenset[str]  # names that need a value
    value: Value
    work: int  # operations on a sample: (1 + parameters) times the nodes

    def check_work(self, size: int) -> None:
        # some seconds; a thousand samples take as long as it takes to begin
        if (size + 1000) * self.work > 2e8:
            raise _too_large(self.text)


@lru_cache(maxsize=64)
def read_formula(text: str) -> Formula:
    """Read a formula, of which nothing is executed; `BadInput` for what is none.

    Examples
    --------
    >>> sorted(read_formula("a*cos(w*t)").letters)
    ['a', 'w']
    """
    try:
        if len(text) > 20_000:  # characters, as deep as Python may read it
            raise MemoryError
        # for a physicist ^ is a power, for Python something else that binds less than +
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval").body
        plain = ast.unparse(tree)  # which goes as deep as whatever is done with it later
    except (SyntaxError, ValueError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else str(error)
        raise BadInput(
            f"{brief(text)} is not a formula: {reason.partition(';')[0]}; write it as Python, with "
            "* for products and ** for powers."
        ) from None
    except (RecursionError, MemoryError):
        raise _too_large(text) from None
    value, letters = _value(tree), _names(tree) - {"t", "pi"}
    work = 5 * sum(isinstance(node, ast.expr) for node in ast.walk(tree))
    work += 200 * plain.count("besselj")
    formula = Formula(plain, letters, value, (1 + len(letters)) * work)
    formula.check_work(0)
    return formula


def _too_large(text: str) -> BadInput:
    return BadInput(
        f"the formula {brief(text)} is too large; give the harmonics with Fourier, or Samples."
    )


def _names(tree: ast.AST) -> frozenset[str]:
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return frozenset(names - FUNCTIONS.keys())


def _value(node: ast.expr) -> Value:
    """Evaluate a part of a formula where its names have values; no other is let in."""
    match node:
        case ast.Constant(value=number) if type(number) in (int, float):
            constant = np.float64(real(number))
            return lambda at: constant
        case ast.Name(id=name) if name not in FUNCTIONS:
            return lambda at: at[name]
        case ast.UnaryOp(op=op, operand=part) if type(op) in OPERATORS:
            do, parts = OPERATORS[type(op)], [part]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            do, parts = OPERATORS[type(op)], [left, right]
        case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]) if name in FUNCTIONS:
            do, wanted = FUNCTIONS[name], "2 arguments" if name in _OF_TWO else "1 argument"
            if len(parts) != int(wanted[0]):
                raise BadInput(f"cannot read the formula: {name} takes {wanted}, not {len(parts)}.")
            if name == "besselj" and _names(parts[0]) - {"pi"}:
                raise BadInput("the order of besselj must be a number, no parameter or formula.")
        case _:
            raise BadInput(
                f"the formula holds {brief(ast.unparse(node))}, which no formula may: use numbers, "
                f"names, + - * / ** and {', '.join(sorted(FUNCTIONS))}, each of something in "
                "parentheses."
            )
    inner = [_value(part) for part in parts]
    return lambda at: do(*[value(at) for value in inner])


# --- harmonics ------------------------------------------------------------------------------------


@lru_cache(maxsize=256)  # residual, Jacobian and sensitivities ask for the same few in turn
def _harmonics_of(formula: Formula, values: tuple[tuple[str, float], ...]) -> dict[str, Harmonics]:
    """Find those of f, under the name "", and of its slopes, under those of the parameters."""
    params = dict(values)
    size = 16
    resolved: Any = np.False_
    while not resolved.all() and size < FINEST:
        size *= 2
        formula.check_work(size)
        with np.errstate(all="ignore"):  # what is not finite is refused by name
            spectra, samples, resolved = _expanded(formula, params, size)
    at = " at " * bool(params) + ", ".join(f"{n} = {v:g}" for n, v in params.items())
    subject, largest = f"the forcing {brief(formula.text)}", float(abs(samples[0]).max())
    if not spectra[0][1:].any():
        what = "constant" if spectra[0].any() else "zero"
        raise BadInput(
            f"{subject} is {what}{at}; a breather needs one that moves it, for instance '-cos(t)'."
        )
    if np.isfinite(largest):
        check_size(largest, subject)
    for name, spectrum, row, fine in zip(["", *params], spectra, samples, resolved, strict=True):
        if name and not fine and abs(row).max() < 1e-15 * largest:
            spectrum[:] = 0.0  # a slope that is nothing but rounding
            continue
        slope = f"the forcing {brief(f'd/d{name} of {formula.text}')}"
        _check(slope if name else subject, at, spectrum, row, fine)
    floor = 1e-17 * float(abs(spectra[0]).max())
    responses = [response_of(spectrum, floor) for spectrum in spectra]
    return dict(zip(["", *params], responses, strict=True))


def _expanded(
    formula: Formula, params: Mapping[str, float], size: int
) -> tuple[ComplexArray, FloatArray, Any]:
    """Spectra of F and its slopes, in rows, their values, and whether so many samples do."""
    t, turns, _ = _times(size)
    at = {"t": t, "pi": np.float64(np.pi), **{n: np.float64(v) for n, v in params.items()}}
    steps = 1j * STEP * np.eye(len(params))[:, :, None]
    beside = at | {n: at[n] + step for n, step in zip(params, steps, strict=True)}
    values = np.zeros((1 + len(params), t.size))
    values[0] = formula.value(at)
    if params:
        values[1:] = np.imag(formula.value(beside)) / STEP
    spectra, resolved = _chopped(spectrum_of(values[:, :size]) * turns, values)
    return spectra, values, resolved


@lru_cache(maxsize=16)
def _times(size: int) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """A grid over the period, the probes, and these seven periods before; what turns a spectrum to
    t = 0; and all waves at the probes."""
    # between the multiples of pi/2, where jumps and poles are most of the time
    grid = 2.0 * np.pi * (np.fft.fftfreq(size) + 0.5 / size)
    m = np.arange(size // 2 + 1)
    waves = np.exp(1j * np.multiply.outer(m, PROBES))
    return np.r_[grid, PROBES, PROBES - 14.0 * np.pi], np.exp(-1j * np.pi / size * m), waves


def _chopped(spectra: ComplexArray, values: FloatArray) -> tuple[ComplexArray, Any]:
    """Without what may be rounding of values, or of times where F is steep; and whether the rest
    ends well below half of the harmonics. In between the samples too: one beyond all of them looks
    like one of these on the grid."""
    size, m = values.shape[1] - 12, np.arange(spectra.shape[1])
    sizes = abs(spectra)
    largest = sizes.max(axis=1)
    rounding = 2e-16 * largest + 1.5e-16 * (m * sizes).max(axis=1)
    parts = spectra.view(float)
    parts[abs(parts) < rounding[:, None]] = 0.0
    tail = abs(spectra[:, size // 4 + 1 :]).max(axis=1)
    there = np.einsum("nm,mt->nt", spectra, _times(size)[2]).real  # `@` would start threads
    missed = abs(there - values[:, size:-6]).max(axis=1)
    fine = (tail <= 4e-15 * largest) & (missed <= 1e-13 * largest + 10.0 * rounding)
    return spectra, fine & largest.any()  # all zero: perhaps but for a peak that no sample saw


def _check(subject: str, at: str, spectrum: ComplexArray, row: FloatArray, resolved: bool) -> None:
    """Check that F, or a slope of it, is finite, resolved and 2 pi periodic; without even harmonics
    where these are rounding."""
    size, even = float(abs(row).max()), abs(spectrum[::2])
    if not size <= LARGEST:
        raise BadInput(f"{subject} is not a finite real number at every t{at}.")
    # what is not resolved may be so steep that the rounding of times shows
    lopsided = np.linalg.norm(even) > (1e-12 if resolved else 1e-6) * np.linalg.norm(spectrum)
    periodic = abs(row[-12:-6] - row[-6:]).max() <= (1e-9 if resolved else 1e-6) * size
    if not resolved and (periodic or not lopsided):
        raise BadInput(
            f"{subject} is not resolved by {FINEST // 4} harmonics (a jump, a kink, a pole, too "
            "steep a flank?); give the harmonics you mean with Fourier."
        )
    if not periodic:
        raise BadInput(
            f"{subject} is not 2 pi periodic: t is the phase of the drive, and omega its frequency."
        )
    if not lopsided:
        spectrum[::2] = 0.0


# --- the forcing ----------------------------------------------------------------------------------


@dataclass(frozen=True, init=False, repr=False)
class Symbolic(Periodic):
    """A formula (or sympy expression) in ``t`` for F/a; other names in it are parameters.

    It is expanded in harmonics until the rest is below 4e-15 of the largest one; even ones below
    1e-12 are rounding. Nothing is executed. What drives no breather (not 2 pi periodic,
    not finite, with jumps, kinks or poles) is `BadInput`, and so is what would take long.

    Parameters
    ----------
    expression : str or sympy.Expr
        For instance ``"-cos(t) - 2.7*cos(3*t)"`` or ``"-cos(t)/(1 + e*cos(2*t))"``; ^ is a power.
    **params : float
        A value for every free symbol other than t. The names a, gamma, k, p, phi are taken.

    Examples
    --------
    >>> forcing = Symbolic("-cos(t) - c3*cos(3*t)", c3=2.7)
    >>> round(forcing.f(0.0), 14), round(forcing.at(c3=0.9).f(0.0), 14)
    (1.3, 1.1)
    """

    expression: str
    values: tuple[tuple[str, float], ...]

    def __init__(self, expression: str | sympy.Expr, /, **params: float) -> None:
        formula = read_formula(str(expression))
        _check_names(formula, params)
        object.__setattr__(self, "expression", formula.text)
        object.__setattr__(self, "values", tuple((n, float(params[n])) for n in sorted(params)))
        harmonics = _harmonics_of(formula, self.values)
        object.__setattr__(self, "_series", TrigonometricSeries(harmonics[""]))
        object.__setattr__(self, "_slopes", {name: harmonics[name] for name in params})

    @property
    def params(self) -> dict[str, float]:
        return dict(self.values)

    def _with(self, params: dict[str, float]) -> Symbolic:
        return Symbolic(self.expression, **params)

    def describe(self) -> str:
        return f"F = a ({self.expression})" + "".join(f", {n} = {v:.6g}" for n, v in self.values)

    def __repr__(self) -> str:
        return f"Symbolic({self.expression!r}{''.join(f', {n}={v!r}' for n, v in self.values)})"


def _check_names(formula: Formula, params: Mapping[str, float]) -> None:
    def listed(names: frozenset[str]) -> str:
        return brief(", ".join(sorted(names))).strip("'")

    for name, value in params.items():
        if not math.isfinite(real(value)):
            raise BadInput(f"forcing parameter {name} = {value!r} is not a finite number.")
    text, free, named = brief(formula.text), formula.letters, frozenset(params)
    if taken := free & set(RESERVED):
        raise BadInput(
            f"{listed(taken)} in {text}: the names {', '.join(RESERVED)} are taken (the "
            "amplitude a multiplies any forcing by itself); rename it."
        )
    if missing := free - named:
        raise BadInput(f"{text} needs a value for {listed(missing)}; the time is t.")
    if unknown := named - free:
        have = listed(free) or "none"
        raise BadInput(f"unknown forcing parameter {listed(unknown)}: {text} has {have}.")


def sampled(force: Callable[[float], float]) -> Samples:
    """Samples of anybody's function F(t), as many as tell all its harmonics."""

    name = getattr(force, "__name__", repr(force))

    def value(at: Mapping[str, Any]) -> FloatArray:
        try:
            return np.array([real(force(t)) for t in at["t"].tolist()])
        except (ArithmeticError, TypeError, ValueError) as error:
            raise BadInput(
                f"the forcing {brief(name)} is to be a function of t alone, a number at each: "
                f"{type(error).__name__}: {error}"
            ) from error

    formula = Formula(name, frozenset(), value, 1)
    series = TrigonometricSeries(_harmonics_of(formula, ())[""])
    # four samples to the shortest period, as `Samples` asks for
    size = max(8, 4 * max(m for m, _, _ in series.harmonics))
    return Samples(series.second().on_grid(size) + series.mean)


def as_formula(forcing: Forcing) -> str:
    """Formula that `forcing_of` makes a drive of, with numbers for its parameters; empty for the
    paper's.

    Examples
    --------
    >>> as_formula(Symbolic("-cos(t) - c3*cos(3*t)", c3=0.5))
    '-cos(t) - 0.5 * cos(3 * t)'
    """
    if isinstance(forcing, Harmonic):
        return ""
    if isinstance(forcing, Symbolic):
        values = {name: f"({value!r})" for name, value in forcing.values}
        text = re.sub(r"\w+", lambda word: values.get(word[0], word[0]), forcing.expression)
    else:
        rows = ((m, -m * m or 1, A, B) for m, A, B in forcing.harmonics)  # of f, but for a mean
        terms = (
            (F * C, f"{name}({m}*t)") for m, F, A, B in rows for C, name in ((A, "cos"), (B, "sin"))
        )
        text = " ".join(f"{C:+.15g}*{wave}" for C, wave in terms if C)
    return read_formula(text).text


def forcing_of(forcing: Drive | sympy.Expr | None, /, **params: float) -> Forcing:
    """A forcing from what was given: itself, a formula in t with values of the parameters in it, a
    function of t, or nothing for the harmonic one.

    Examples
    --------
    >>> forcing_of("-cos(t) - 2.7*cos(3*t)").highest
    3
    """
    given: Any = HARMONIC if forcing is None else forcing
    if isinstance(given, str) and given.replace(" ", "") == HARMONIC and not params:
        return Harmonic()
    if isinstance(given, str) or hasattr(given, "free_symbols"):
        return Symbolic(given, **params)
    known = hasattr(given, "harmonics")
    if isinstance(given, type) or not (known or callable(given)):
        raise BadInput(
            f"forcing = {given!r}: F/a was expected, a formula in t such as '-cos(t)', a function "
            "of t, or a Harmonic, Fourier, Symbolic or Samples."
        )
    drive: Forcing = given if known else sampled(given)
    return drive
