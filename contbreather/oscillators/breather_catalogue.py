"""A catalogue of breathers: one code of each class of codes that symmetries make alike."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import networkx as nx
import numpy as np
from scipy import sparse

from ..checks import check_kind, whole
from ..errors import NoSolution, partial_result
from ..orbits.multibreathers import exchanges_of_sites
from ..tables import HtmlRepr, Sheet
from .anticontinuum import coded
from .breather_constructors import CouplingEnds, breather
from .breather_problem import BreatherProblem
from .oscillator_lattice import Oscillators
from .potentials import Params

Code = tuple[tuple[int, Any], ...]


@dataclass(frozen=True)
class CodedBreather(HtmlRepr):
    """One entry of the catalogue: a code, and what becomes of it.

    Attributes
    ----------
    code : dict
        One representative of all codes that are alike.
    copies : int
        How many those are.
    share : float
        The share of the coupling that it reaches, 1 where it exists.
    ended : str
        The sentence that says what ends it; empty where it exists.
    breather : BreatherProblem or None
    """

    code: Mapping[int, Any]
    copies: int
    share: float
    ended: str
    breather: BreatherProblem | None

    @property
    def exists(self) -> bool:
        """True where it lives at the coupling that was asked for."""
        return self.breather is not None

    @property
    def unstable(self) -> int | None:
        """How many multipliers of it are outside of the unit circle."""
        return None if self.breather is None else self.breather.solution.unstable

    def table(self) -> Sheet:
        """Its code, how far it goes, and what ends it."""
        code = ", ".join(f"{site}: {value}" for site, value in self.code.items())
        rows: list[tuple[str, Any]] = [("code", code), ("codes alike", self.copies)]
        rows += [("share of the coupling", self.share), ("unstable", self.unstable)]
        return Sheet.of([*rows, ("ends with", self.ended or None)])


def breathers(
    chain: Oscillators,
    *,
    omega: float,
    sites: int | Iterable[int] = 2,
    params: Params | None = None,
    **how: Any,
) -> tuple[CodedBreather, ...]:
    """Breathers of all codes of some sites, one for each class of codes that a symmetry of the
    lattice, or a shift by half of the period, maps into each other.

    Parameters
    ----------
    chain, omega, params
        As for `breather`.
    sites : int or iterable of int
        How many sites are coded at most; or which.
    **how
        What else `breather` takes.

    Returns
    -------
    tuple of CodedBreather

    Examples
    --------
    >>> import contbreather as cb
    >>> chain = cb.Oscillators(V="u**2/2 + u**4/4", W="c*r**2/2", lattice=cb.Ring(5))
    >>> for entry in breathers(chain, omega=1.5, sites=2, params={"c": 0.03}):
    ...     print(entry.code, entry.copies, entry.exists, entry.unstable)
    {0: 1} 10 True 0
    {0: 1, 1: 1} 10 True 0
    {0: 1, 1: -1} 10 True 1
    {0: 1, 2: 1} 10 True 1
    {0: 1, 2: -1} 10 True 0
    """
    check_kind(chain, Oscillators, "a lattice of oscillators, Oscillators(V=, W=, lattice=)")
    catalogue: list[CodedBreather] = []
    how |= {"omega": omega, "params": params}
    with partial_result(lambda: tuple(catalogue)):
        for code, copies in _classes(chain, sites, {**(params or {}), "omega": omega}):
            entry = partial(CodedBreather, dict(code), copies)
            try:
                catalogue.append(entry(1.0, "", breather(chain, dict(code), **how)))
            except NoSolution as error:
                share = error.share if isinstance(error, CouplingEnds) else 0.0
                catalogue.append(entry(share, str(error), None))
    return tuple(catalogue)


def _classes(chain: Oscillators, sites: Any, params: Params) -> Iterator[tuple[Code, int]]:
    """Codes up to symmetries, with the size of each class, in their order."""
    values = ("high",) if chain.dissipative else (1, -1)
    if isinstance(sites, Iterable):
        groups = [tuple(sorted(coded(chain, [*sites])))]
    else:
        counts = range(1, min(whole("sites", sites, 1), chain.sites) + 1)
        groups = [g for n in counts for g in itertools.combinations(range(chain.sites), n)]
    codes: list[Code] = [
        tuple(zip(group, signs, strict=True))
        for group in groups
        for signs in itertools.product(values, repeat=len(group))
    ]
    alike, exchanges = nx.Graph(), _exchanges(chain, params)
    alike.add_nodes_from(codes)
    for code in codes:
        # half a period later, and at other sites
        later = tuple((n, value if isinstance(value, str) else -value) for n, value in code)
        moved = (tuple(sorted((to[n], value) for n, value in code)) for to in exchanges)
        alike.add_edges_from((code, image) for image in (later, *moved) if image in alike)
    order = {code: i for i, code in enumerate(codes)}
    for images in nx.connected_components(alike):
        yield min(images, key=order.__getitem__), len(images)


def _exchanges(chain: Oscillators, params: Params) -> list[Mapping[int, int]]:
    """Exchanges of sites that leave the lattice as it is; of bonds that tell their ends apart none
    is looked for."""
    r = np.linspace(0.1, 1.0, 5)
    pull, push = chain.W.slope(r, params), chain.W.slope(-r, params)
    if abs(pull + push).max() > 1e-12 * abs(pull).max():
        return []
    ends, lattice = abs(chain.bonds.ends), chain.lattice
    joined = ends.T @ sparse.diags_array(chain.couplings) @ ends
    own = chain.masses, chain.onsite, lattice.dampings, lattice.drive
    return [*exchanges_of_sites(joined.toarray(), own)]
