"""sympy derives by itself what is written by hand in the package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers.closure import Closure

if TYPE_CHECKING:
    import sympy

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class DerivedClosure:
    """Eq. (11) and its derivatives as sympy matrices.

    ``chi`` is left a function of gamma and f one of (phi, c), c standing for any parameter of the
    forcing, so what is derived holds for every lattice and every forcing.
    """

    residual: sympy.Matrix
    jacobian: sympy.Matrix
    sensitivity: Mapping[str, sympy.Matrix]  # by a, gamma, k, c

    def evaluate(
        self, matrix: sympy.Matrix, closure: Closure, x: FloatArray, params: Mapping[str, float]
    ) -> FloatArray:
        """One of the matrices in numbers, by substituting those of a closure.

        The parameter c is the forcing's first, if it has one."""
        import sympy

        own = closure.forcing.params
        forcing = closure.forcing.at(**{n: params.get(n, v) for n, v in own.items()})
        s, chi, f = _symbols()
        p, phi = float(x[0]), float(x[1])
        gamma = params["gamma"]
        orders = (forcing.f(phi), forcing.df(phi), forcing.d2f(phi))
        # highest derivatives first: a derivative must not be taken of a number put in before
        table: list[tuple[Any, float]] = [(chi.diff(s["gamma"]), closure.lattice.dchi(gamma))]
        if own:
            first = next(iter(own))
            table += [
                (f.diff(s["c"], *[s["phi"]] * i), forcing.f_param(first, phi, i)) for i in (1, 0)
            ]
        table += [(f.diff(s["phi"], i) if i else f, orders[i]) for i in (2, 1, 0)]
        table += [(chi, closure.lattice.chi(gamma))]
        table += [(s["p"], p), (s["phi"], phi), (s["a"], params["a"]), (s["k"], params["k"])]
        values = sympy.Matrix(matrix).doit()
        for symbol, value in table:
            values = values.xreplace({symbol: sympy.Float(value, 17)})
        return np.array(values.evalf(17).tolist(), dtype=float)


def _symbols() -> tuple[dict[str, Any], Any, Any]:
    import sympy

    s = {n: sympy.Symbol(n, real=True) for n in ("p", "phi", "a", "gamma", "k", "c")}
    return s, sympy.Function("chi")(s["gamma"]), sympy.Function("f")(s["phi"], s["c"])


def derive_closure() -> DerivedClosure:
    """Write down (11), let sympy differentiate it."""
    import sympy

    s, chi, f = _symbols()
    q = (1 - s["k"]) / (1 + s["k"])
    residual = sympy.Matrix([s["p"] * chi + s["a"] * f - 1, s["a"] * f.diff(s["phi"]) - s["p"] * q])
    return DerivedClosure(
        residual,
        residual.jacobian([s["p"], s["phi"]]),
        {name: residual.diff(s[name]) for name in ("a", "gamma", "k", "c")},
    )


def flight_identities() -> dict[str, sympy.Expr]:
    """What must vanish if the answer of one mode between impacts is right.

    The answer is ``v(s) = sin(w (pi/2 - s))/(w cos(pi w/2))``, per unit p, continued by
    ``v(s + pi) = -v(s)``. Each value is an expression that simplifies to 0."""
    import sympy

    s, w = sympy.symbols("s w", positive=True)
    v = sympy.sin(w * (sympy.pi / 2 - s)) / (w * sympy.cos(sympy.pi * w / 2))
    speed = v.diff(s)
    before, after = -speed.subs(s, sympy.pi), speed.subs(s, 0)  # on both sides of s = 0
    identities = {
        "free motion: v'' + w^2 v": speed.diff(s) + w**2 * v,
        "antisymmetry: v(pi) + v(0)": v.subs(s, sympy.pi) + v.subs(s, 0),
        "the impact takes 2p: v'(0-) - v'(0+) - 2": before - after - 2,
        "symmetric impact (7): v'(0-) - 1": before - 1,
        "chi: v(0) - tan(pi w/2)/w": v.subs(s, 0) - sympy.tan(sympy.pi * w / 2) / w,
        "eta: v''(0) + w tan(pi w/2)": speed.diff(s).subs(s, 0) + w * sympy.tan(sympy.pi * w / 2),
    }
    return {name: sympy.simplify(expression) for name, expression in identities.items()}
