"""Lattices of oscillators: potentials at the sites and along the bonds of any finite lattice.

    m_n u_n'' + d_n d u_n' + s_n V'(u_n) + d/du_n (sum over bonds of w W(r)) = a_n F(t)

with r = u_j - u_i of a bond from site i to site j. A ring and a chain are gone around, or along, in
the order of their sites, a grid along its rows and columns; other bonds lead from the lower number
to the higher one. Ends that are fixed have bonds to the ground.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..checks import brief, check_call, numbers, real
from ..continuation.algebra.derivatives import IMAGINARY
from ..continuation.algebra.sparse import Pattern
from ..errors import BadInput
from ..flows.flow import STENCIL, Flow
from ..flows.functions import Params
from ..flows.jacobian import Coloured
from ..lattice.finite import Lattice, finite, stiffness_of
from ..lattice.formula import FUNCTIONS, read_formula
from ..storage.serialise import NotSerialisable, serialised, to_dict

Array = NDArray[np.float64]
Impacts = tuple[tuple[int, int], ...]  # sites and sides, +1 or -1, of one time

_STEP = 2e-3  # of differences of order 8, relative to 1 + |u|: rounding 1e-13, truncation 1e-15
_NUMBERS = ("damping", "walls", "k")  # or formulas in parameters
_VARIABLES = {"V": "u", "W": "r", "drive": "t"} | dict.fromkeys(_NUMBERS, "_")
SHARE = "share of the coupling"  # no name that a formula may have: 1 where it is not given


# --- functions of one variable ------------------------------------------------------------------


@dataclass(frozen=True)
class SmoothFunction:
    """A formula in one variable, a letter, or ``f(u, p)``, with its derivative.

    A formula is read as that of a forcing is, never executed, and differentiated by SymPy; all
    other letters in it are parameters. A function is differentiated by complex steps. What asks for
    a slope at a complex place differentiates it once more: its imaginary part is then that of
    differences, which are as analytic as the function.

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
            return
        check_call(str(self), self.given, self.variable)

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters of a formula; of a callable they are not known."""
        return () if callable(self.given) else _compiled(self.given, self.variable)[0]

    def __call__(self, u: Any, p: Params, order: int = 0) -> NDArray[Any]:
        if callable(self.given):
            return self.given(u, p)
        names, derivatives, _ = _compiled(self.given, self.variable)
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
def _compiled(text: str, variable: str) -> tuple[tuple[str, ...], list[Callable[..., Any]], bool]:
    """The parameters of a formula, functions of it and of its slope, and if that is linear."""
    import sympy  # dear to import

    letters = read_formula(text).letters
    symbols = {name: sympy.Symbol(name, real=True) for name in {*letters, variable}}
    # what was read holds numbers, names and functions alone
    least = lambda x, y: -sympy.Max(-x, -y)  # noqa: E731 - slopes of a power of Min divide by it
    words = {"max": sympy.Max, "Min": least, "min": least}
    formula = sympy.sympify(text, locals=words | symbols)
    names = sorted(str(symbol) for symbol in formula.free_symbols if str(symbol) != variable)
    if "t" in names or (names and variable not in (*letters, "t", "_")):
        how = "depends on t" if "t" in names else f"has no {variable} in it"
        raise BadInput(f"{brief(text)} {how}: a function of {variable} was expected.")
    arguments = [symbols[variable], *(symbols[name] for name in names)]
    steps = {"DiracDelta": np.zeros_like, "Heaviside": lambda x, y: np.heaviside(np.real(x), y)}
    modules = [{**FUNCTIONS, **steps}, "numpy"]
    # as it stands: what SymPy makes simpler divides by what may be 0, as forces of contact
    slope = sympy.diff(formula, symbols[variable])
    functions = [sympy.lambdify(arguments, f, modules, cse=True) for f in (formula, slope)]
    return tuple(names), functions, not slope.diff(symbols[variable]).has(symbols[variable])


# --- lattices -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Oscillators:
    """A lattice of oscillators, conservative or driven and damped: ``f(t, x, p)`` of its states
    ``x = (u, v)``, positions of all sites and then velocities.

    Parameters
    ----------
    V : str or callable, optional
        Potential of each site, a formula in ``u``, or ``V(u, p)``, which has to be analytic; none
        unless given. Other names in a formula are parameters; it is never executed.
    W : str or callable
        Potential of each bond, a formula in the difference ``r`` of its ends, or ``W(r, p)``.
    lattice : Ring or Lattice
        `Ring`, `OpenChain`, `Grid`, `Lattice.from_graph`: its bonds, and its rows of numbers for
        each site (masses, springs for the shares of V, dampings, drive).
    damping : float or str, optional
        The force ``-damping * v``: a number, or a formula in parameters.
    drive : str or callable, optional
        The force on each site, a formula in ``t`` of the period ``2*pi/omega``, or ``F(t, p)``.
    walls, k : float or str, optional
        Where the walls of each site are, at -walls and +walls, and the restitution of impacts,
        ``v -> -k v``: numbers, or formulas in parameters.
    masses, onsite : array_like, shape (N,), optional
        Mass, and share of V, of each site, in place of those of the lattice.
    couplings : array_like, optional
        Share of W of each bond, in the order of `bonds`, in place of the stiffness of the lattice.

    Attributes
    ----------
    bonds : sparse array, shape (bonds, N)
        One row for each, with -1 and +1 where it begins and ends; those to the ground come last.

    Raises
    ------
    BadInput
        For formulas that are none, rows that do not fit, the infinite chain.

    Examples
    --------
    >>> from contbreather.lattice import Ring
    >>> chain = Oscillators(V="u**2/2 + b*u**4/4", W="c*r**2/2", lattice=Ring(3))
    >>> chain.names
    ('b', 'c')
    >>> chain(0.0, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), {"b": 1.0, "c": 0.1}).round(12)
    array([ 0. ,  0. ,  0. , -2.2,  0.1,  0.1])
    """

    V: Any = None
    W: Any = None
    lattice: Any = None
    damping: Any = None
    drive: Any = None
    walls: Any = None
    k: Any = None
    masses: Any = None
    onsite: Any = None
    couplings: Any = None
    bonds: Any = field(init=False)

    def __post_init__(self) -> None:
        lattice = finite(self.lattice)
        bonds, stiffness = _bonds(lattice)
        object.__setattr__(self, "bonds", bonds)
        own = {"masses": lattice.masses, "onsite": lattice.springs, "couplings": stiffness}
        for name, values in own.items():
            given = getattr(self, name)
            row = np.asarray(values if given is None else numbers(name, given), dtype=float)
            if row.shape != np.shape(values):
                raise BadInput(f"{name} has shape {row.shape}; {np.shape(values)} was expected.")
            object.__setattr__(self, name, row)
        if not self.masses.min() > 0:
            raise BadInput(f"masses = {brief(self.masses.tolist())}: every mass must be positive.")
        if (self.walls is None) != (self.k is None):
            raise BadInput("walls= and k= go together: where the walls are, and their restitution")
        for name, variable in _VARIABLES.items():
            given = getattr(self, name)
            if np.ndim(given):
                raise BadInput(
                    f"{name} = {brief(given)}: one formula for all of {self.sites} sites was "
                    "expected; shares of it are a row, onsite= and couplings=, or of the lattice"
                )
            if name in _NUMBERS and np.isfinite(real(given)):
                given = repr(real(given)) if real(given) or name == "k" else None
            given = "0" if given is None and name in ("V", "W") else given
            value = None if given is None else SmoothFunction(given, variable)
            object.__setattr__(self, name, value)

    # --- what it is ---------------------------------------------------------------------------

    @property
    def sites(self) -> int:
        return int(self.lattice.sites)

    @property
    def dissipative(self) -> bool:
        """Tell whether it is driven or damped, and conserves nothing."""
        return not (self.drive is None and self.damping is None and self.walls is None)

    @cached_property
    def functions(self) -> dict[str, SmoothFunction]:
        """Its formulas, or functions, by name."""
        return {name: of for name in _VARIABLES if (of := getattr(self, name)) is not None}

    @cached_property
    def written(self) -> bool:
        """Tell whether all of these are formulas: of functions the parameters are not known."""
        return not any(callable(function.given) for function in self.functions.values())

    @property
    def analytic(self) -> bool:
        """Tell whether complex steps are exact, as of formulas, piece by piece where `abs` is."""
        return self.written

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parameters of its formulas."""
        return tuple(dict.fromkeys(name for of in self.functions.values() for name in of.names))

    @cached_property
    def bare(self) -> bool:
        """Tell whether V is harmonic, or nothing: frequencies change by the bonds alone."""
        return not callable(self.V.given) and _compiled(self.V.given, "u")[2]

    # --- forces -------------------------------------------------------------------------------

    def __call__(self, t: Any, x: Any, p: Params) -> NDArray[Any]:
        u, v = x[: self.sites], x[self.sites :]
        force = -self.gradient(u, p)
        if self.damping is not None:
            force = force - _beside(self.lattice.dampings, v) * self.damping(0.0, p) * v
        if self.drive is not None:
            force = force + _beside(self.lattice.drive, v) * self.drive(t, p)
        return np.concatenate([v, force / _beside(self.masses, v)])

    def gradient(self, u: Any, p: Params) -> NDArray[Any]:
        """Differentiate the potential energy in the positions, shape (N,) or (N, m)."""
        total = _beside(self.onsite, u) * self.V.slope(u, p)
        for (ends, back), weights in self.parts(p):
            r = ends @ u
            total = total + back @ (_beside(weights, r) * self.W.slope(r, p))
        return total

    @cached_property
    def jacobian(self) -> Coloured:
        """Its derivative in the states, as flows ask for it: by its pattern."""
        one, ends = sparse.eye_array(self.sites), abs(self.bonds)
        lost = one if self.damping is not None else None
        blocks: Any = [[None, one], [ends.T @ ends + one, lost]]
        return Coloured(Pattern(sparse.block_array(blocks)))

    def parts(self, p: Params) -> list[tuple[tuple[Any, Any], Any]]:
        """Bonds and their weights. Of a share s of the coupling s of each; where V leaves nothing
        nonlinear at 0, the rest holds each of both ends as if the other one were at rest."""
        share, (whole, *halves) = p.get(SHARE, 1.0), self._ends
        if SHARE not in p or not self.bare or self.walls:
            return [(whole, share * self.couplings)]
        two = np.diff(self.bonds.indptr) == 2  # those to the ground stay
        rest = np.where(two, 1.0 - share, 0.0) * self.couplings
        return [(whole, self.couplings - rest), *((half, rest) for half in halves)]

    @cached_property
    def _ends(self) -> list[tuple[Any, Any]]:
        """Ends of bonds, and of each the one and the other alone, each with its transpose."""
        ends = self.bonds
        return [(e, e.T.tocsr()) for e in (ends, ends.maximum(0), ends.minimum(0))]

    def run(self, times: tuple[float, float], x: Array, p: Params, **how: Any) -> Any:
        """Simulate from a state: what `scipy.integrate.solve_ivp` returns."""
        from scipy.integrate import solve_ivp

        how = {"method": "DOP853", "rtol": 1e-12, "dense_output": True, "args": (p,), **how}
        return solve_ivp(self, times, x, **how, atol=1e-13 * (abs(x).max() or 1.0))

    # --- energies -----------------------------------------------------------------------------

    def site_energies(self, x: Array, p: Params) -> Array:
        """Energy of each site at states (2N,) or (2N, m): half of a bond belongs to each end."""
        u, v = x[: self.sites], x[self.sites :]
        total = 0.5 * _beside(self.masses, v) * v * v + _beside(self.onsite, u) * self.V(u, p)
        for (ends, _), weights in self.parts(p):
            r, halves = ends @ u, weights / np.maximum(np.diff(ends.indptr), 1)
            total = total + abs(ends).T @ (_beside(halves, r) * self.W(r, p))
        return np.asarray(total)

    def energy(self, x: Array, p: Params) -> Any:
        """Energy of all of it at a state, or at states."""
        return self.site_energies(x, p).sum(axis=0)

    def frequencies(self, p: Params) -> Array:
        """Frequencies of small oscillations about rest, ascending; NaN of those that grow."""
        aside = 1j * IMAGINARY * np.eye(self.sites)
        stiffness, root = self.gradient(aside, p).imag / IMAGINARY, np.sqrt(self.masses)
        squares = np.linalg.eigvalsh(stiffness / np.multiply.outer(root, root))
        squares[abs(squares) < 1e-13 * max(1.0, abs(squares).max())] = 0.0
        return np.sqrt(np.where(squares < 0, np.nan, squares))

    def __repr__(self) -> str:
        return f"<Oscillators: V = {self.V}, W = {self.W}, {self.lattice.describe()}>"


# --- walls --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class WallDistance:
    """Distance of a site from a wall, on one side: +1 above, -1 below. Two of one wall are equal,
    by which a flow knows that it begins on the wall where the one before ended."""

    chain: Oscillators
    site: int
    side: int
    terminal, direction = True, -1.0  # as an event of a simulation

    @property
    def words(self) -> tuple[str, str]:
        """Name the site and its wall, as sentences say it where a branch ends."""
        return f"site {self.site}", "its upper wall" if self.side > 0 else "its lower wall"

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        return self.chain.walls(0.0, p) - self.side * x[self.site]


@dataclass(frozen=True, eq=False)
class Bounce:
    """The state after an impact of some sites: of the first one, and of others that are at their
    walls at once, or, to first order, a little sooner or later."""

    chain: Oscillators
    impacts: Impacts

    def __call__(self, t: Any, x: Any, p: Params) -> Any:
        chain, k, n = self.chain, self.chain.k(0.0, p), self.chain.sites
        after = np.array(x + 0.0 * k)
        for site, _ in self.impacts:
            after[n + site] = -k * x[n + site]
        if others := self.impacts[1:]:
            before, behind, wall = chain(t, x, p), chain(t, after, p), chain.walls(0.0, p)
            after = after + 0.0 * behind  # which may be complex
            for site, side in others:
                left = side * wall - x[site]
                after[site] = x[site] + (1 + k) * left
                late = left / x[n + site]
                after[n + site] -= late * (k * before[n + site] + behind[n + site])
        return after


def between_walls(chain: Oscillators, met: Sequence[Impacts]) -> tuple[Flow, ...]:
    """The flows that end by these impacts, one after the other; all other walls are watched."""
    ends, flows = [(n, side) for n in range(chain.sites) for side in (1, -1)], []
    for before, now in zip([met[-1], *met[:-1]], met, strict=True):
        near = (*now, *before[1:])  # met with another: it is there to begin with
        others = [end for end in ends if end not in near]
        watched = (Flow(chain, WallDistance(chain, *end), Bounce(chain, (end,))) for end in others)
        until = WallDistance(chain, *now[0])
        flows.append(Flow(chain, until, Bounce(chain, now), walls=tuple(watched)))
    return tuple(flows)


# --- its bonds ----------------------------------------------------------------------------------


def _beside(row: Any, x: Any) -> Any:
    """A number for each row of x, however many columns that has."""
    return row if np.ndim(x) == 1 else row[:, None]


def _bonds(lattice: Any) -> tuple[Any, Array]:
    """The bonds of a lattice, and their stiffness."""
    n = lattice.sites
    if isinstance(lattice, Lattice):
        matrix = stiffness_of(lattice)
        upper, ground = sparse.triu(matrix, 1).tocoo(), np.ravel(matrix.sum(axis=1))
        (first, second), weights = upper.coords, -upper.data
        ground[abs(ground) <= 1e-12 * abs(matrix).max()] = 0.0
        line = np.isin(second - first, (1, n - 1)).all()
        if shape := lattice.shape or ((1, n) if line else None):  # what closes a row or a column
            (row, column), (below, right) = (np.divmod(ends, shape[1]) for ends in (first, second))
            closing = (right - column > 1) | (below - row > 1)
            first, second = np.where(closing, second, first), np.where(closing, first, second)
    else:  # a ring: of two sites it has two bonds
        first, ground = np.arange(n if n > 1 else 0), np.zeros(n)
        second, weights = np.roll(first, -1), np.ones(first.size)
    sites, one = np.flatnonzero(ground), sparse.eye_array(n, format="csr")
    ties = one[sites]
    if sites.size > 1 and (abs(first - second) == 1).all():  # a chain: to its other end
        ties.data[-1] = -1.0
    ends = sparse.vstack([one[second] - one[first], ties], format="csr")
    return ends, np.append(weights, ground[sites])


def _to_dict(chain: Oscillators) -> dict[str, Any]:
    """By its formulas, its lattice and its rows of numbers; functions have none."""
    if not chain.written:
        raise NotSerialisable(chain)
    formulas = {name: function.given for name, function in chain.functions.items()}
    rows = {name: getattr(chain, name).tolist() for name in ("masses", "onsite", "couplings")}
    return {"lattice": to_dict(chain.lattice), **formulas, **rows}


serialised("oscillators", Oscillators, _to_dict)(Oscillators)
