"""What sympy derives by itself is what is written by hand."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from contbreather.lattice import Fourier, Harmonic, InfiniteChain, Ring, Symbolic
from contbreather.orbits.closure import Closure

CLOSURES = {
    "harmonic": (Closure(), {}),
    "two harmonics on a ring": (
        Closure(Fourier(cos={3: -2.7, 1: -1.0}), Ring(5)),
        {"c1": -1.1, "c3": -2.0},
    ),
    "formula": (Closure(Symbolic("-cos(t)/(1 + e*cos(2*t))", e=0.3), InfiniteChain()), {"e": 0.2}),
}
POINTS = [(0.68, -2.5, 0.5, 0.12, 0.4), (0.3, 0.7, 0.06, 0.2499, 0.99), (1.1, 2.0, 1.3, 0.0, 0.05)]


def derived(
    closure: Closure, point: tuple[float, ...], own: Mapping[str, float]
) -> dict[str, np.ndarray]:
    """(11), its Jacobian and its slopes in parameters, c for the first one of the forcing: chi and
    f are any functions with their values and slopes."""
    import sympy

    symbols = sympy.symbols("p phi a gamma k c", real=True)
    p, phi, a, gamma, k, c = symbols
    _, at, _, coupling, _ = point
    exact = sympy.Rational
    s, forcing, lattice = phi - exact(at), closure.forcing.at(**own), closure.lattice
    f, slope, bend = (exact(of(at)) for of in (forcing.f, forcing.df, forcing.d2f))
    f += s * slope + s**2 * bend / 2
    for name in [*own][:1]:
        f += c * sum(s**i * exact(forcing.f_param(name, at, i)) for i in (0, 1))
    chi = exact(lattice.chi(coupling)) + (gamma - exact(coupling)) * exact(lattice.dchi(coupling))
    q = (1 - k) / (1 + k)
    residual = sympy.Matrix([p * chi + a * f - 1, a * f.diff(phi) - p * q])
    found = {"": residual, "x": residual.jacobian([p, phi])}
    found |= {str(one): residual.diff(one) for one in (a, gamma, k, c)}
    here = dict(zip(symbols, map(exact, (*point, 0.0)), strict=True))
    return {name: np.array(one.subs(here).tolist(), dtype=float) for name, one in found.items()}


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize("which", CLOSURES)
def test_hand_written_closure_derivatives_are_those_sympy_derives(which, point):
    closure, own = CLOSURES[which]
    p, phi, a, gamma, k = point
    x, params = np.array([p, phi]), {"a": a, "gamma": gamma, "k": k, **own}
    wanted, close = derived(closure, point, own), {"rtol": 1e-14, "atol": 1e-14}
    np.testing.assert_allclose(closure.residual(x, params), wanted[""][:, 0], **close)
    np.testing.assert_allclose(closure.jacobian(x, params), wanted["x"], **close)
    names = {"a": "a", "gamma": "gamma", "k": "k", **dict.fromkeys([*own][:1], "c")}
    for name, symbol in names.items():
        found = closure.sensitivity(x, params, name)
        np.testing.assert_allclose(found, wanted[symbol][:, 0], **close)


def test_the_mode_between_impacts_is_free_antisymmetric_and_loses_two_p():
    """``v(s) = sin(w (pi/2 - s))/(w cos(pi w/2))`` per unit p, continued by ``v(s + pi) = -v(s)``:
    what must vanish if that is right."""
    import sympy

    s, w = sympy.symbols("s w", positive=True)
    v = sympy.sin(w * (sympy.pi / 2 - s)) / (w * sympy.cos(sympy.pi * w / 2))
    speed = v.diff(s)
    before, after = -speed.subs(s, sympy.pi), speed.subs(s, 0)  # on both sides of s = 0
    identities = {
        "free motion": speed.diff(s) + w**2 * v,
        "antisymmetry": v.subs(s, sympy.pi) + v.subs(s, 0),
        "the impact takes 2p": before - after - 2,
        "symmetric impact (7)": before - 1,
        "chi": v.subs(s, 0) - sympy.tan(sympy.pi * w / 2) / w,
        "eta": speed.diff(s).subs(s, 0) + w * sympy.tan(sympy.pi * w / 2),
    }
    left = {name: sympy.simplify(expression) for name, expression in identities.items()}
    assert {name: expression for name, expression in left.items() if expression != 0} == {}


def test_every_parameter_of_a_closure_has_a_sensitivity_that_finite_differences_confirm():
    for closure, own in CLOSURES.values():
        x = np.array([0.6, -2.0])
        params = {"a": 0.4, "gamma": 0.11, "k": 0.3, **own}
        for name in closure.params:
            h = 1e-6
            up = closure.residual(x, {**params, name: params[name] + h})
            down = closure.residual(x, {**params, name: params[name] - h})
            got = closure.sensitivity(x, params, name)
            np.testing.assert_allclose(got, (up - down) / (2 * h), atol=1e-8)


def test_a_harmonic_closure_has_no_parameter_of_its_own():
    assert Closure(Harmonic()).params == ("a", "gamma", "k")
