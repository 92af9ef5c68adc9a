"""Formulas in t: read, never executed; evaluated with their slopes, exactly or on samples.

Each is walked through node by node, so that its cost is known before it is paid: what multiplies
formulas out by itself can be made to take for ever by a short one.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from contbreather.errors import BadInput
from contbreather.lattice.forcing import HIGHEST

LONGEST = 20_000  # characters
LARGEST = 200_000  # nodes, times what is carried along: the value and a slope for each parameter
LARGEST_POWER = 99
SAMPLED = 20_000  # the same for a formula on samples, weighted by what each operation costs
PRODUCTS = 4_000_000  # of coefficients, before a polynomial is sampled instead
SHOWN = 70  # characters of a formula in a sentence


class Function(NamedTuple):
    """Its value, its derivative from argument x and value y, and 1 if even, -1 if odd."""

    value: Callable[[Any], Any]
    slope: Callable[[Any, Any], Any]
    parity: int
    cost: int = 5


FUNCTIONS = {
    "sin": Function(np.sin, lambda x, y: np.cos(x), -1),
    "cos": Function(np.cos, lambda x, y: -np.sin(x), 1),
    "tan": Function(np.tan, lambda x, y: 1 + y * y, -1),
    "sec": Function(lambda x: 1 / np.cos(x), lambda x, y: y * np.tan(x), 1),
    "csc": Function(lambda x: 1 / np.sin(x), lambda x, y: -y / np.tan(x), -1),
    "cot": Function(lambda x: 1 / np.tan(x), lambda x, y: -1 - y * y, -1),
    "sinh": Function(np.sinh, lambda x, y: np.cosh(x), -1),
    "cosh": Function(np.cosh, lambda x, y: np.sinh(x), 1),
    "tanh": Function(np.tanh, lambda x, y: 1 - y * y, -1),
    "exp": Function(np.exp, lambda x, y: y, 0),
    "log": Function(np.log, lambda x, y: 1 / x, 0),
    "sqrt": Function(np.sqrt, lambda x, y: 0.5 / y, 0),
    "asin": Function(np.arcsin, lambda x, y: 1 / np.sqrt(1 - x * x), -1),
    "acos": Function(np.arccos, lambda x, y: -1 / np.sqrt(1 - x * x), 0),
    "atan": Function(np.arctan, lambda x, y: 1 / (1 + x * x), -1),
    "Abs": Function(np.abs, lambda x, y: np.sign(x), 1),
    "sign": Function(np.sign, lambda x, y: 0 * x, -1),
}
BESSEL = "besselj"  # of two arguments, the order first
NAMES = {*FUNCTIONS, BESSEL}
_ARITHMETIC = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_OPERATORS = (*_ARITHMETIC, ast.UAdd, ast.USub)


class NotExact(Exception):
    """This is not a trigonometric polynomial, or too long a one."""


class Dual(NamedTuple):
    """A value and its derivatives in the parameters it depends on."""

    value: Any
    slopes: Mapping[str, Any]


# --- reading --------------------------------------------------------------------------------------


def cut(text: str) -> str:
    """Not more of a text than a sentence bears."""
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 4]} ..."


def shown(text: str) -> str:
    """A formula as a sentence quotes it."""
    return repr(cut(text))


def parsed(text: str) -> ast.expr:
    """The formula as a tree that holds nothing but numbers, names, arithmetic and `NAMES`."""
    if len(text) > LONGEST:
        raise too_large(text)
    try:
        # for a physicist ^ is a power, for Python something else that binds less than +
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval").body
        ast.unparse(tree)  # as all will be done that goes through it from the top
    except (SyntaxError, ValueError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else str(error)
        raise BadInput(
            f"{shown(text)} is not a formula: {reason}; write it as Python, for instance "
            "'-cos(t) - 2.7*cos(3*t)'."
        ) from None
    except (RecursionError, MemoryError):
        raise too_large(text) from None
    nodes = list(ast.walk(tree))
    called = {node.func for node in nodes if isinstance(node, ast.Call)}
    for node in nodes:
        if node not in called:
            _check(node, text)
    return tree


def too_large(text: str) -> BadInput:
    return BadInput(
        f"the formula {shown(text)} is too large; give the harmonics with Fourier, or Samples."
    )


def _check(node: ast.AST, text: str) -> None:
    """Refuse whatever is no part of a formula."""
    match node:
        case ast.Constant(value=value):
            good = type(value) in (int, float)
        case ast.Name(id=name):
            good = name not in NAMES
        case ast.BinOp(op=op) | ast.UnaryOp(op=op):
            good = isinstance(op, _OPERATORS)
        case ast.Call(func=ast.Name(id=name), args=args) if name in NAMES:
            good, wanted = True, 2 if name == BESSEL else 1
            if len(args) != wanted:
                raise BadInput(
                    f"cannot read {shown(text)}: {name} takes {wanted} argument"
                    f"{'s' * (wanted > 1)}, not {len(args)}."
                )
        case _:
            good = isinstance(node, (*_OPERATORS, ast.Load))
    if not good:
        raise BadInput(
            f"{shown(text)} holds {shown(ast.unparse(node))}, which no forcing may: use numbers, "
            f"t, names of parameters, + - * / ** and {', '.join(sorted(NAMES))}, each of "
            "something in parentheses."
        )


def _names(tree: ast.expr) -> set[str]:
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} - NAMES


def letters(tree: ast.expr) -> frozenset[str]:
    """The names in a formula that need a value."""
    return frozenset(_names(tree) - {"t", "pi"})


def size(tree: ast.expr) -> int:
    return sum(isinstance(node, ast.expr) for node in ast.walk(tree))


def work(tree: ast.expr) -> int:
    """What a sample costs, in additions; one of a function of Bessel's costs as much as 200."""
    costs = {name: function.cost for name, function in FUNCTIONS.items()} | {BESSEL: 200}
    calls = sum(costs.get(getattr(node, "id", ""), 0) for node in ast.walk(tree))
    return size(tree) + calls + 10 * sum(isinstance(node, ast.Pow) for node in ast.walk(tree))


# --- what half a period does ----------------------------------------------------------------------


def parity(tree: ast.expr) -> int:
    """-1 where the formula proves F(t + pi) = -F(t), 1 where F(t + pi) = F(t), else 0."""
    match tree:
        case ast.Name(id="t"):
            return 0
        case ast.UnaryOp(operand=operand):
            return parity(operand)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            both = parity(left)
            return both if both == parity(right) else 0
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div(), right=right):
            return parity(left) * parity(right)
        case ast.BinOp(left=left, right=right):
            return _of_power(parity(left), parity(right), _number(right))
        case ast.Call(func=ast.Name(id=name), args=[*order, argument]):
            turns = _turns(argument)
            if turns is not None and turns.is_integer() and name in ("sin", "cos", "sec", "csc"):
                return -1 if turns % 2 else 1
            if turns is not None and turns.is_integer() and name in ("tan", "cot"):
                return 1
            inner = parity(argument)
            if name == BESSEL:
                return _of_power(inner, parity(order[0]), _number(order[0]))
            return FUNCTIONS[name].parity if inner == -1 else inner
    return 1  # a number or a parameter


def _of_power(base: int, exponent: int, number: float | None) -> int:
    """Of x^n, and of J_n(x) alike."""
    if exponent != 1 or base == 0:
        return 0
    if base == 1:
        return 1
    if number is None or not number.is_integer():
        return 0
    return -1 if number % 2 else 1


def _number(tree: ast.expr) -> float | None:
    """The value of a literal."""
    match tree:
        case ast.Constant():
            return _float(tree.value)
        case ast.UnaryOp(op=op, operand=ast.Constant(value=value)):
            return -_float(value) if isinstance(op, ast.USub) else _float(value)
    return None


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:  # a whole number of more than 308 digits
        return math.inf


def _turns(tree: ast.expr) -> float | None:
    """c of what is ``c t`` and something constant; None of anything else."""
    match tree:
        case ast.Name(id=name):
            return 1.0 if name == "t" else 0.0
        case ast.Constant():
            return 0.0
        case ast.UnaryOp(op=op, operand=operand):
            inner = _turns(operand)
            return -inner if inner is not None and isinstance(op, ast.USub) else inner
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
            one, other = _turns(left), _turns(right)
            both = one is not None and other is not None
            return float(_ARITHMETIC[type(op)](one, other)) if both else None
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            for factor, rest in ((left, right), (right, left)):
                number, inner = _number(factor), _turns(rest)
                if number is not None and inner is not None:
                    return number * inner
    return None if "t" in _names(tree) else 0.0


# --- values ---------------------------------------------------------------------------------------


def evaluate(tree: ast.expr, values: Mapping[str, Dual]) -> Dual:
    """The formula at what its names stand for: numbers, samples, or `Waves`."""
    match tree:
        case ast.Constant():
            return Dual(np.float64(_float(tree.value)), {})
        case ast.Name(id=name):
            return values[name]
        case ast.UnaryOp(op=op, operand=operand):
            x = evaluate(operand, values)
            return x if isinstance(op, ast.UAdd) else _chain(-x.value, (lambda: -1, x.slopes))
        case ast.BinOp(left=left, op=op, right=right):
            one, other = evaluate(left, values), evaluate(right, values)
            if isinstance(op, ast.Pow):
                _check_power(other.value, tree)
            return _combined(type(op), one, other)
        case ast.Call(func=ast.Name(id=name), args=args):
            return _called(name, *(evaluate(one, values) for one in args))
    raise AssertionError(tree)  # `parsed` lets nothing else pass


Part = tuple[Callable[[], Any], Mapping[str, Any]]  # a partial derivative, and slopes inside


def _chain(value: Any, *parts: Part) -> Dual:
    slopes: dict[str, Any] = {}
    for partial, inside in parts:
        outer = partial() if inside else None
        for name, slope in inside.items():
            term = outer * slope
            slopes[name] = slopes[name] + term if name in slopes else term
    return Dual(value, slopes)


def _combined(kind: type[ast.operator], one: Dual, other: Dual) -> Dual:
    x, y = one.value, other.value
    value = _ARITHMETIC[kind](x, y)
    partials: dict[type[ast.operator], tuple[Callable[[], Any], Callable[[], Any]]] = {
        ast.Add: (lambda: 1, lambda: 1),
        ast.Sub: (lambda: 1, lambda: -1),
        ast.Mult: (lambda: y, lambda: x),
        ast.Div: (lambda: 1 / y, lambda: -value / y),
        ast.Pow: (lambda: y * x ** (y - 1) if np.any(y) else 0.0, lambda: value * _log(x)),
    }
    first, second = partials[kind]
    return _chain(value, (first, one.slopes), (second, other.slopes))


def _log(x: Any) -> Any:
    if isinstance(x, Waves):
        raise NotExact
    return np.log(x)


def _check_power(exponent: Any, tree: ast.expr) -> None:
    if not isinstance(exponent, Waves) and np.ndim(exponent) == 0 and abs(exponent) > LARGEST_POWER:
        raise BadInput(
            f"the power {shown(ast.unparse(tree))} is too high: powers up to {LARGEST_POWER} are "
            "taken."
        )


def _called(name: str, *given: Dual) -> Dual:
    if name == BESSEL:
        return _bessel(*given)
    (x, slopes), function = given[0], FUNCTIONS[name]
    if isinstance(x, Waves):
        if name not in ("sin", "cos"):
            raise NotExact
        sine, cosine = x.sine_and_cosine()
        value, partial = (sine, cosine) if name == "sin" else (cosine, -sine)
        return _chain(value, (lambda: partial, slopes))
    y = function.value(x)
    return _chain(y, (lambda: function.slope(x, y), slopes))


def _bessel(order: Dual, argument: Dual) -> Dual:
    n, x = order.value, argument.value
    if isinstance(x, Waves) or isinstance(n, Waves):
        raise NotExact
    if np.ndim(n) or order.slopes:
        raise BadInput(f"the order of {BESSEL} must be a number, not a parameter or a formula.")
    from scipy import special  # dear to import

    partial = (lambda: 0.5 * (special.jv(n - 1, x) - special.jv(n + 1, x)), argument.slopes)
    return _chain(special.jv(n, x), partial)


class Waves:
    """``rate t + sum of c_m exp(i m t)``, m from -M to M, exact but for rounding."""

    __slots__ = ("c", "cost", "rate")
    __array_ufunc__ = None  # numpy's numbers leave arithmetic with these to us

    def __init__(self, c: Any, rate: float = 0.0, cost: int = 0) -> None:
        self.c, self.rate, self.cost = c, rate, cost

    @property
    def spectrum(self) -> dict[int, complex]:
        """``{m: C_m - i S_m}`` for m from 0."""
        if self.rate:
            raise NotExact
        middle = len(self.c) // 2
        return {m: complex((2 if m else 1) * c) for m, c in enumerate(self.c[middle:])}

    def __neg__(self) -> Waves:
        return Waves(-self.c, -self.rate, self.cost)

    def __add__(self, other: Any) -> Waves:
        if not isinstance(other, Waves):
            other = Waves(np.array([other], dtype=complex))
        short, long = sorted((self.c, other.c), key=len)
        margin = (len(long) - len(short)) // 2
        total = long.copy()
        total[margin : margin + len(short)] += short
        return Waves(total, self.rate + other.rate, self.cost + other.cost)

    def __sub__(self, other: Any) -> Waves:
        return self + -other

    def __rsub__(self, other: Any) -> Waves:
        return -self + other

    def __mul__(self, other: Any) -> Waves:
        if not isinstance(other, Waves):
            return Waves(self.c * other, self.rate and self.rate * other, self.cost)
        cost = self.cost + other.cost + len(self.c) * len(other.c)
        if self.rate or other.rate or cost > PRODUCTS:
            raise NotExact
        if len(self.c) + len(other.c) > 2 * HIGHEST + 2:
            raise NotExact
        return Waves(np.convolve(self.c, other.c), 0.0, cost)

    __radd__ = __add__
    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Waves:
        if isinstance(other, Waves):
            raise NotExact
        return Waves(self.c / other, self.rate and self.rate / other, self.cost)

    def __rtruediv__(self, other: Any) -> Waves:
        raise NotExact

    __rpow__ = __rtruediv__

    def __pow__(self, n: Any) -> Waves:
        if isinstance(n, Waves) or not float(n).is_integer() or n < 0:
            raise NotExact
        return math.prod([self] * int(n), start=Waves(np.ones(1, dtype=complex)))

    def sine_and_cosine(self) -> tuple[Waves, Waves]:
        """Of what is a multiple of t and a constant."""
        middle = len(self.c) // 2
        shift = self.c[middle].real
        if np.count_nonzero(self.c) > (shift != 0.0) or not float(self.rate).is_integer():
            raise NotExact
        if abs(self.rate) > HIGHEST:
            raise BadInput(
                f"the forcing has the harmonic {abs(self.rate):.10g}: harmonics up to {HIGHEST} "
                "are resolved in time."
            )
        # pi is rounded: where a quarter turn is meant, the other part would not quite vanish
        parts = np.array([np.cos(shift), np.sin(shift)])
        parts[abs(parts) < 4e-16 * min(max(1.0, abs(shift)), 100.0)] = 0.0
        half = 0.5 * complex(*parts)
        return self._pair(-1j * half), self._pair(half)

    def _pair(self, half: complex) -> Waves:
        """``half exp(i m t)`` and its conjugate, m the rate."""
        m = int(self.rate)
        c = np.zeros(2 * abs(m) + 1, dtype=complex)
        c[abs(m) + m] += half
        c[abs(m) - m] += half.conjugate()
        return Waves(c, 0.0, self.cost)
