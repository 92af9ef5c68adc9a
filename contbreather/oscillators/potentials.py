"""Functions of one variable and parameters, with their slopes: potentials, drives, damping.

A formula is read as that of a forcing is, never executed, and differentiated by SymPy; a callable
``V(u, p)`` by complex steps. What asks for a slope at a complex place differentiates it once more:
its imaginary part is then that of differences, which are as analytic as V.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..checks import brief
from ..continuation.algebra.derivatives import IMAGINARY
from ..errors import BadInput
from ..flows.flow import STENCIL
from ..lattice.formula import FUNCTIONS, read_formula

Params = Mapping[str, Any]
Function = Callable[..., Any]

_STEP = 2e-3  # of differences of order 8, relative to 1 + |u|: rounding 1e-13, truncation 1e-15


@dataclass(frozen=True)
class SmoothFunction:
    """A formula in one variable, or ``f(u, p)``, with its derivative.

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

    def __call__(self, u: Any, p: Params, order: int = 0) -> NDArray[Any]:
        if callable(self.given):
            return self.given(u, p)
        names, derivatives = _compiled(self.given, self.variable)
        value: NDArray[Any] = derivatives[order](u, *(p[name] for name in names))
        return value + 0.0 * u  # as many, if constant

    def slope(self, u: Any, p: Params) -> NDArray[Any]:
        """The derivative in the variable."""
        if not callable(self.given):
            return self(u, p, order=1)
        V, at = self.given, {name: np.real(value) for name, value in p.items()}
        exact = np.imag(V(np.real(u) + 1j * IMAGINARY, at)) / IMAGINARY
        if not np.iscomplexobj(sum(p.values(), u)):
            return np.asarray(exact)
        h = _STEP * (1 + abs(np.real(u)))
        once_more = sum(c * (V(u + k * h, p) - V(u - k * h, p)) for k, c in STENCIL) / h
        return np.asarray(exact + 1j * np.imag(once_more))

    def __str__(self) -> str:
        return str(getattr(self.given, "__name__", self.given))


@lru_cache(maxsize=64)
def _compiled(text: str, variable: str) -> tuple[tuple[str, ...], tuple[Function, ...]]:
    """The parameters of a formula, and functions of arrays of it and of its derivative."""
    import sympy  # dear to import

    letters = read_formula(text).letters
    symbols = {name: sympy.Symbol(name, real=True) for name in {*letters, variable}}
    # what was read holds numbers, names and functions alone
    formula = sympy.sympify(text, locals=symbols)
    names = sorted(str(symbol) for symbol in formula.free_symbols if str(symbol) != variable)
    if "t" in names or (names and variable not in (*letters, "t", "_")):
        on = "t" if "t" in names else ", ".join(names)
        raise BadInput(f"{brief(text)} depends on {on}: a function of {variable} was expected.")
    arguments = [symbols[variable], *(symbols[name] for name in names)]
    modules = [{**FUNCTIONS, "DiracDelta": np.zeros_like}, "numpy"]
    both = formula, sympy.simplify(sympy.diff(formula, symbols[variable]))
    return tuple(names), tuple(sympy.lambdify(arguments, f, modules, cse=True) for f in both)
