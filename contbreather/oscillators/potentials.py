"""Functions of one variable and parameters, with their derivatives: potentials, drives, damping.

A formula is read as that of a forcing is, never executed, and differentiated by SymPy. A callable
``V(u, p)`` is differentiated by complex steps, and these once more by differences.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief
from ..continuation.algebra.derivatives import IMAGINARY
from ..errors import BadInput
from ..lattice.formula import FUNCTIONS, read_formula

Params = Mapping[str, Any]
Function = Callable[[Any, Params], Any]

_STEP = 2e-3  # of differences of order 8, relative to 1 + |u|: rounding 1e-13, truncation 1e-15
_STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))


@dataclass(frozen=True)
class SmoothFunction:
    """A formula in one variable, or ``f(u, p)``, with two derivatives.

    Parameters
    ----------
    given : str or callable
    variable : str
        The letter that stands for the variable; all others in a formula are parameters.

    Examples
    --------
    >>> quartic = SmoothFunction("u**2/2 + b*u**4/4", "u")
    >>> quartic.names, float(quartic.slope(2.0, {"b": 0.5}))
    (('b',), 6.0)
    """

    given: Any
    variable: str

    def __post_init__(self) -> None:
        if not callable(self.given):
            object.__setattr__(self, "given", read_formula(str(self.given)).text)
            _compiled(self.given, self.variable)

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters of a formula; of a callable they are not known."""
        return () if callable(self.given) else _compiled(self.given, self.variable)[0]

    def __call__(self, u: Any, p: Params) -> NDArray[Any]:
        return self._functions[0](u, p)

    def slope(self, u: Any, p: Params) -> NDArray[Any]:
        """The derivative in the variable."""
        return self._functions[1](u, p)

    def curvature(self, u: Any, p: Params) -> NDArray[Any]:
        """The second derivative in the variable."""
        return self._functions[2](u, p)

    @property
    def _functions(self) -> tuple[Function, ...]:
        if callable(self.given):
            return _by_steps(self.given)
        return _compiled(self.given, self.variable)[1]

    def __str__(self) -> str:
        return str(getattr(self.given, "__name__", self.given))


@lru_cache(maxsize=64)
def _compiled(text: str, variable: str) -> tuple[tuple[str, ...], tuple[Function, ...]]:
    """Differentiate a formula twice, and make functions of arrays of all three."""
    import sympy  # dear to import

    letters = read_formula(text).letters
    symbols = {name: sympy.Symbol(name, real=True) for name in {*letters, variable}}
    # what was read holds numbers, names and functions alone
    formula = sympy.sympify(text, locals=symbols)
    names = sorted(str(symbol) for symbol in formula.free_symbols if str(symbol) != variable)
    if "t" in names:
        raise BadInput(f"{brief(text)} depends on t: a function of {variable} was expected.")
    arguments = [symbols[variable], *(symbols[name] for name in names)]
    modules = [{**FUNCTIONS, "DiracDelta": np.zeros_like}, "numpy"]
    derivatives = (sympy.diff(formula, symbols[variable], order) for order in (1, 2))
    functions = [formula, *map(sympy.simplify, derivatives)]
    compiled = [sympy.lambdify(arguments, each, modules, cse=True) for each in functions]
    return tuple(names), tuple(partial(_at, each, tuple(names)) for each in compiled)


def _at(compiled: Function, names: tuple[str, ...], u: Any, p: Params) -> Any:
    return compiled(u, *[p[name] for name in names]) + 0.0 * u  # as many, if constant


@lru_cache(maxsize=64)
def _by_steps(function: Function) -> tuple[Function, ...]:
    def slope(u: Any, p: Params) -> Any:
        return np.imag(function(np.real(u) + 1j * IMAGINARY, p)) / IMAGINARY

    def curvature(u: Any, p: Params) -> Any:
        h = _STEP * (1 + abs(np.real(u)))
        return sum(c * (slope(u + k * h, p) - slope(u - k * h, p)) for k, c in _STENCIL) / h

    return function, slope, curvature
