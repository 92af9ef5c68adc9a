"""Finite lattices: any network of linear springs, given by its stiffness matrix.

``m_n (u_n'' + damping u_n' + spring u_n) + gamma sum over j of L_nj u_j = m_n d_n F(t)``

`L` is symmetric positive semidefinite, `m` are the masses, `d` the pattern of the drive (1 on every
site: the whole lattice is shaken). Spring and damping are per unit mass, so that the normal modes
``L v = lam M v`` do not depend on any parameter: mode j has ``w^2 = gamma lam_j + spring``.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import brief, flag, one_of, whole
from contbreather.errors import BadInput
from contbreather.one_thread import one_thread
from contbreather.parameters import parameter

if TYPE_CHECKING:
    from scipy import sparse

FloatArray = NDArray[np.float64]

ALIKE = 1e-9  # eigenvalues closer than this, relative to the largest, are one eigenspace
MOST = 10_000  # sites of a lattice whose modes are those of a dense matrix
UNSEEN = 1e-10  # a mode this small at every impacting site is not seen by them
# parameters of which each site may have its own value, and the rows of a lattice that say so
PER_SITE = {"k": "restitutions", "damping": "dampings", "spring": "springs"}
ROWS = ("masses", "drive", *PER_SITE.values())
PACE = "pace"  # the direction in which gamma and spring grow by twice themselves, damping by itself
NODES = ("mass", "drive", "restitution", "damping", "spring")  # the same of a node of a graph
# lam, shapes ``(N or 1, K)`` and shares in the drive of the modes that it excites
DrivenModes = tuple[FloatArray, FloatArray, FloatArray]
ALL_ALIKE: DrivenModes = np.zeros(1), np.ones((1, 1)), np.ones(1)  # no bond is stretched


class Finite(Protocol):
    """Lattice with finitely many sites, as flights and impacts ask about it."""

    def __hash__(self) -> int: ...
    @property
    def sites(self) -> int: ...
    @property
    def masses(self) -> FloatArray: ...
    @property
    def drive(self) -> FloatArray:
        """Strength of the forcing at each site."""

    @property
    def springs(self) -> FloatArray:
        """The spring of each site in units of the parameter; damping and k likewise."""

    @property
    def dampings(self) -> FloatArray: ...
    @property
    def restitutions(self) -> FloatArray: ...
    @property
    def even(self) -> bool:
        """True where springs and dampings are the same everywhere, so that modes decouple."""

    @property
    def driven_modes(self) -> DrivenModes: ...
    @property
    def highest_gamma(self) -> float: ...
    def basis(self, hit: tuple[int, ...]) -> Basis: ...
    def beside(self, n: int) -> tuple[int, ...]:
        """The sites coupled to site n."""

    def describe(self) -> str: ...


class NormalModes(NamedTuple):
    """Normal modes of a matrix that impacts at some sites excite, orthonormal over the masses."""

    lam: FloatArray  # ``w^2 = gamma lam + spring``
    unseen: FloatArray  # the same of the modes that vanish at all those sites
    shapes: FloatArray  # (N, K)

    def at(self, n: ArrayLike) -> FloatArray:
        """Value of each mode at the sites n, shape ``(..., K)``."""
        return np.asarray(self.shapes[whole_sites(n, len(self.shapes))])

    def to_sites(self, modes: FloatArray) -> FloatArray:
        """Amplitudes of modes ``(..., K)`` as values at all sites ``(..., N)``."""
        return np.asarray(modes @ self.shapes.T)


@dataclass(frozen=True, eq=False, repr=False)
class Lattice:
    """A lattice by its stiffness matrix, to be multiplied by gamma.

    Parameters
    ----------
    stiffness : array_like or scipy.sparse array, shape (N, N)
        Symmetric, positive semidefinite; row sums are zero unless sites are tied to the ground.
    masses : array_like, shape (N,), optional
        Positive; 1 unless given.
    drive : array_like, shape (N,), optional
        How strongly each site feels the forcing; 1 unless given.
    springs, dampings, restitutions : array_like, shape (N,), optional
        Spring, damping and k of each site in units of these parameters; 1 unless given.
    name : str
        Shown in tables.

    Raises
    ------
    BadInput
        For a matrix that is not square, symmetric, finite or semidefinite, masses that are not
        positive, lengths that do not fit.

    Examples
    --------
    >>> pair = Lattice([[1.0, -1.0], [-1.0, 1.0]])
    >>> pair.spectrum[0].round(12) + 0.0
    array([0., 2.])
    """

    stiffness: Any
    masses: Any = None
    drive: Any = None
    springs: Any = field(default=None, kw_only=True)
    dampings: Any = field(default=None, kw_only=True)
    restitutions: Any = field(default=None, kw_only=True)
    name: str = field(default="lattice", kw_only=True)

    def __post_init__(self) -> None:
        matrix = _matrix(self.stiffness)
        object.__setattr__(self, "stiffness", matrix)
        for name in ROWS:
            values = _row(name, getattr(self, name), len(matrix))
            n = int(values.argmin())
            if name == "masses" and values[n] <= 0.0:
                raise BadInput(f"masses[{n}] = {values[n]:g}: every mass must be positive.")
            if name not in ("masses", "drive") and values[n] < 0.0:
                raise BadInput(f"{name}[{n}] = {values[n]:g}: none may be negative.")
            object.__setattr__(self, name, values)
        lowest, highest = float(self.spectrum[0][0]), float(self.spectrum[0][-1])
        if lowest < -ALIKE * max(highest, 1.0):
            raise BadInput(
                f"the stiffness matrix has the eigenvalue {lowest:.6g}: it must be positive "
                "semidefinite, or the lattice at rest flies apart; check its signs (a bond adds "
                "+1 to the diagonal and -1 beside it)."
            )

    @classmethod
    def from_graph(cls, graph: Any, *, weight: str = "weight", **more: Any) -> Lattice:
        """The lattice whose bonds are the edges of a networkx graph, with their weights (1 where
        an edge has none); sites are numbered in the order of ``graph.nodes``, and have its
        attributes `NODES`, 1 where a node has none.

        Examples
        --------
        >>> import networkx as nx
        >>> Lattice.from_graph(nx.star_graph(3)).stiffness[0]
        array([ 3., -1., -1., -1.])
        """
        import networkx as nx

        if not isinstance(graph, nx.Graph) or graph.is_directed() or not len(graph):
            raise BadInput(
                f"graph = {graph!r}: an undirected networkx graph with at least one node is "
                "expected."
            )
        for one, other, bond in graph.edges(data=weight, default=1.0):
            if np.asarray(bond).dtype.kind not in "biuf":
                raise BadInput(
                    f"the weights {weight!r} of the edges must be numbers, their stiffnesses; "
                    f"that from {one!r} to {other!r} is {brief(bond)}."
                )
        matrix = nx.laplacian_matrix(graph, weight=weight).toarray()
        attributes = {
            name: [graph.nodes[n].get(kind, 1.0) for n in graph]
            for name, kind in zip(ROWS, NODES, strict=True)
        }
        return cls(matrix, **{"name": "graph", **attributes, **more})

    # ------------------------------------------------------------------------ what it is

    @property
    def sites(self) -> int:
        return len(self.stiffness)

    @cached_property
    def _key(self) -> Hashable:
        return tuple(getattr(self, name).tobytes() for name in ("stiffness", *ROWS))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Lattice) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def __repr__(self) -> str:
        return f"<{self.describe()}>"

    def describe(self) -> str:
        rows = ((name, getattr(self, name)) for name in ROWS)
        parts = [f"{self.name}, {self.sites} site{'s' * (self.sites > 1)}"]
        parts += [f"{name} {_shortly(row)}" for name, row in rows if (row != 1.0).any()]
        return ", ".join(parts)

    @cached_property
    @one_thread
    def spectrum(self) -> tuple[FloatArray, FloatArray]:
        """Eigenvalues ``lam``, ascending, and the modes as columns, mass-orthonormal."""
        from scipy import linalg  # dear to import, and needed by finite lattices alone

        root = np.sqrt(self.masses)
        # y = M^1/2 v turns L v = lam M v into a symmetric problem, with orthonormal y
        lam, vectors = linalg.eigh(self.stiffness / np.multiply.outer(root, root))
        # a body that moves as a whole has the frequency 0, not one of rounding
        lam[abs(lam) < 1e-13 * max(float(lam[-1]), 1.0)] = 0.0
        return lam, vectors / root[:, None]

    @cached_property
    def even(self) -> bool:
        return bool((self.springs == 1.0).all() and (self.dampings == 1.0).all())

    highest_gamma = math.inf

    @cached_property
    def driven_modes(self) -> DrivenModes:
        # row sums of a lattice that nothing ties to the ground are 0, but for rounding
        loose = abs(self.stiffness.sum(axis=1)).max() <= 1e-12 * abs(self.stiffness).max()
        if loose and (self.drive == 1.0).all():
            return ALL_ALIKE
        lam, shapes = self.spectrum
        share = (self.drive * self.masses) @ shapes
        moved = abs(share) > UNSEEN * max(float(abs(share).max()), UNSEEN)
        return lam[moved], shapes[:, moved], share[moved]

    @cached_property
    def _bonds(self) -> NDArray[np.bool_]:
        return np.asarray((self.stiffness != 0.0) & ~np.eye(self.sites, dtype=bool))

    def beside(self, n: int) -> tuple[int, ...]:
        return tuple(np.flatnonzero(self._bonds[n]).tolist())

    @cached_property
    def shape(self) -> tuple[int, int] | None:
        """Rows and columns where its bonds are those of a `Grid`, open or periodic in either way,
        whoever made it; None where they are not."""
        i, j = np.nonzero(np.triu(self._bonds))
        # the second shortest bond leads to the next row or, closed, from end to end of a row
        for columns in np.add(np.unique(j - i)[1:2], [[0], [1]]).ravel().tolist():
            rows, rest = divmod(self.sites, columns)
            (r, c), (below, right) = np.divmod(i, columns), np.divmod(j, columns)
            across, down = (r == below) * (right - c), (c == right) * (below - r)
            next_to = (across == 1) | (down == 1)
            closing = (across == columns - 1) | (down == rows - 1)
            every = np.count_nonzero(next_to) == rows * (columns - 1) + (rows - 1) * columns
            if not rest and rows > 1 and every and (next_to | closing).all():
                return rows, columns
        return None

    def basis(self, hit: tuple[int, ...]) -> NormalModes:
        """The modes that impacts at the sites `hit` can excite.

        Of an eigenspace of any dimension these are as many as its values at those sites have
        independent directions; the others vanish there and never learn of an impact.
        """
        alone = [n for n in set(hit) if self.sites > 1 and not self._bonds[n].any()]
        if alone:
            raise BadInput(
                f"site {alone[0]} of this lattice has no bond to any other: alone it is a single "
                "oscillator, lattice Ring(1); take another site or join the parts."
            )
        return _seen(self, tuple(sorted(set(hit))))


@lru_cache(maxsize=64)
def _seen(lattice: Lattice, hit: tuple[int, ...]) -> NormalModes:
    lam, vectors = lattice.spectrum
    apart = np.flatnonzero(np.diff(lam) > ALIKE * max(float(lam[-1]), 1.0)) + 1
    values, shapes, unseen = [], [], []
    for space in np.split(np.arange(lam.size), apart):
        modes = vectors[:, space]
        # right singular vectors: combinations that show at these sites, and those that vanish there
        _, sizes, turned = np.linalg.svd(modes[list(hit)])
        seen = int(np.count_nonzero(sizes > UNSEEN))
        values += [lam[space].mean()] * seen
        unseen += [lam[space].mean()] * (space.size - seen)
        shape = modes @ turned[:seen].T
        there = shape[list(hit)]
        # of the sites that are hit the one that moves most, the first of those but for rounding,
        # moves upwards: orbits in files are told by their modes, whatever their sign elsewhere
        top = (abs(there) > 0.999 * abs(there).max(axis=0)).argmax(axis=0)
        shapes.append(shape * np.sign(there[top, np.arange(seen)]))
    return NormalModes(np.array(values), np.array(unseen), np.hstack(shapes))


def _matrix(stiffness: Any) -> FloatArray:
    """The stiffness as a dense matrix, or what is wrong with it."""
    if hasattr(stiffness, "toarray"):
        _count("sites", max(stiffness.shape))
        stiffness = stiffness.toarray()
    try:
        matrix = np.array(stiffness, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadInput(f"the stiffness is not a matrix of numbers: {error}.") from error
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
        raise BadInput(
            f"the stiffness has shape {matrix.shape}; a square matrix is expected, of a graph "
            "Lattice.from_graph(graph)."
        )
    if not np.isfinite(matrix).all():
        i, j = np.argwhere(~np.isfinite(matrix))[0]
        raise BadInput(f"stiffness[{i}, {j}] = {matrix[i, j]} is not finite.")
    off = abs(matrix - matrix.T)
    if off.max() > 1e-12 * abs(matrix).max():
        i, j = np.unravel_index(int(off.argmax()), off.shape)
        raise BadInput(
            f"stiffness[{i}, {j}] = {matrix[i, j]:g} but stiffness[{j}, {i}] = {matrix[j, i]:g}: "
            "a spring pulls both ends alike, so the matrix must be symmetric."
        )
    matrix = 0.5 * (matrix + matrix.T) + 0.0  # one zero, not two: lattices are known by their bits
    matrix.setflags(write=False)
    return matrix


def _shortly(row: FloatArray) -> str:
    """List all values, or how some differ from the rest, which is shorter; of many the first."""
    values, counts = np.unique(row, return_counts=True)
    usual = f"{values[counts.argmax()]:.3g}"
    if values.size == 1:
        return usual
    own = [f"{row[n]:.3g} at site {n}" for n in np.flatnonzero(row != values[counts.argmax()])]
    each = [f"{value:.3g}" for value in row]
    whole = min(" ".join(each), f"{usual} but {' and '.join(own)}", key=len)
    return whole if len(whole) <= 40 else " ".join(each[:4]) + " ..."


def _row(name: str, values: Any, sites: int) -> FloatArray:
    """One number for each site; ones unless given."""
    try:
        row = np.ones(sites) if values is None else np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadInput(f"{name} = {values!r}: one number for each site is expected.") from error
    if row.shape != (sites,):
        raise BadInput(
            f"{name} = {brief(values)} has shape {row.shape}; a number, or one for each of {sites} "
            "sites, is expected."
        )
    if not np.isfinite(row).all():
        raise BadInput(f"{name} = {row.tolist()}: finite numbers are expected.")
    row.setflags(write=False)
    return row


def per_site(lattice: Any, values: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Take k, damping and spring apart where they are given for each site: the lattice with their
    proportions, and their means.

    Examples
    --------
    >>> chain, means = per_site(OpenChain(2), {"spring": [0.1, 0.3]})
    >>> chain.springs, means
    (array([0.5, 1.5]), {'spring': 0.2})
    """
    for name, given in values.items():
        if type(given) is float or isinstance(given, str) or not np.ndim(given):
            continue
        if getattr(lattice, "sites", None) is None:
            raise BadInput(
                f"{name} = {brief(given)}: one number for each site is for finite lattices, "
                "lattice=Ring(20) or OpenChain(9); the infinite chain has one for all."
            )
        row = _row(name, given, lattice.sites)
        mean = float(np.mean([parameter(name, value) for value in row.tolist()]))
        alike = not np.ptp(row)
        if not alike:
            lattice = by_matrix(lattice)
        if isinstance(lattice, Lattice):
            shares: dict[str, Any] = {PER_SITE[name]: None if alike else row / mean}
            lattice = replace(lattice, **shares)
        values = {**values, name: float(row[0]) if alike else mean}
    return lattice, values


def by_matrix(lattice: Finite) -> Lattice:
    """A finite lattice, rings too, as one by its matrix."""
    if isinstance(lattice, Lattice):
        return lattice
    return Lattice(stiffness_of(lattice), name=lattice.describe().partition(" of")[0])


def whole_sites(n: ArrayLike, count: float = math.inf, lattice: Any = None) -> NDArray[np.int64]:
    """Numbers of sites, of a lattice of so many, or a sentence."""
    if isinstance(n, tuple) and len(n) == 2 and (shape := getattr(lattice, "shape", None)):
        raise BadInput(
            f"n = {n}: site (i, j) of this grid has the number {shape[1]} i + j; two sites are a "
            f"list, {[*n]}."
        )
    try:
        sites = np.asarray(n)
    except ValueError:  # rows of different lengths
        sites = np.array(math.nan)
    if sites.dtype.kind not in "iu":
        raise BadInput(f"n = {n!r}: sites are whole numbers.")
    if count < math.inf and ((sites < 0) | (sites >= count)).any():
        raise BadInput(f"n = {n!r}: sites of this lattice are 0 to {count - 1}.")
    return sites.astype(np.int64)


def highest_k(lattice: Any) -> float:
    """Largest k of a lattice: there the hardest of its sites loses nothing."""
    return 1.0 if lattice.sites is None else 1.0 / max(1.0, float(lattice.restitutions.max()))


def finite(lattice: Any) -> Finite:
    """A finite lattice as it was given; anything else is refused."""
    known = getattr(lattice, "sites", None) is not None and hasattr(lattice, "basis")
    if isinstance(lattice, type) or not known:
        raise BadInput(
            f"lattice = {lattice!r}: a finite one is expected, Ring(20), OpenChain(9), Grid(5, 5), "
            "Lattice(stiffness) or Lattice.from_graph(graph)."
        )
    checked: Finite = lattice
    return checked


# --- rings --------------------------------------------------------------------------------------


class PlaneWaves(NamedTuple):
    """`NormalModes` of a ring.

    Mode j is ``sqrt(weight) cos(2 pi order (n - origin)/N)``, or the sine. Impacts of one site
    alone see its even modes only, half of all.
    """

    sites: int
    origin: int
    order: NDArray[np.int64]  # (K,)
    sine: NDArray[np.bool_]  # (K,)
    weight: FloatArray  # (K,)
    lam: FloatArray  # (K,)
    unseen: FloatArray

    def at(self, n: ArrayLike) -> FloatArray:
        apart = (np.asarray(n)[..., None] - self.origin) * self.order % self.sites
        angle = 2.0 * np.pi / self.sites * apart
        return np.asarray(np.sqrt(self.weight) * np.where(self.sine, np.sin(angle), np.cos(angle)))

    def to_sites(self, modes: FloatArray) -> FloatArray:
        # irfft gives the sum of weight Re(spectrum exp(i m x)): all orders twice but 0 and N/2
        scaled = modes / np.sqrt(self.weight)
        half = self.sites // 2 + 1
        spectrum = np.zeros((*modes.shape[:-1], half), dtype=complex)
        spectrum[..., self.order[~self.sine]] = scaled[..., ~self.sine]
        spectrum[..., self.order[self.sine]] -= 1j * scaled[..., self.sine]
        return np.roll(np.fft.irfft(spectrum, self.sites), self.origin, axis=-1)


Basis = NormalModes | PlaneWaves


@lru_cache(maxsize=128)
def plane_waves(sites: int, hit: tuple[int, ...]) -> PlaneWaves:
    """The modes of a ring that impacts at the sites ``hit`` can excite."""
    cosines, sines = np.arange(sites // 2 + 1), np.arange(1, (sites + 1) // 2)
    order, rest = cosines, sines  # of one site alone the sines vanish there
    if len(set(hit)) > 1:
        order, rest = np.concatenate([cosines, sines]), sines[:0]
    alone = (order == 0) | (2 * order == sites)
    return PlaneWaves(
        sites,
        hit[0],
        order,
        np.arange(order.size) >= cosines.size,
        np.where(alone, 1.0, 2.0) / sites,
        4.0 * np.sin(np.pi * order / sites) ** 2,  # 2 - 2 cos theta
        4.0 * np.sin(np.pi * rest / sites) ** 2,
    )


@lru_cache(maxsize=16)
def stiffness_of(lattice: Finite) -> sparse.csr_array:
    """The stiffness matrix of any finite lattice, rings too, by its entries that are not zero."""
    from scipy import sparse

    if isinstance(lattice, Lattice):
        return sparse.csr_array(np.asarray(lattice.stiffness, dtype=float))
    n = np.arange(lattice.sites)
    return _joined(n, (n, np.roll(n, -1)))


def _joined(sites: Any, *bonds: tuple[Any, Any]) -> sparse.csr_array:
    """The stiffness of bonds between sites; of two between the same ones entries add up."""
    from scipy import sparse

    n, other = (np.concatenate([*map(np.ravel, ends)]) for ends in zip(*bonds, strict=True))
    rows, columns = np.concatenate([n, other, n, other]), np.concatenate([n, other, other, n])
    entries = np.repeat([1.0, -1.0], 2 * n.size)
    return sparse.csr_array((entries, (rows, columns)), shape=(sites.size, sites.size))


# --- the usual ones -----------------------------------------------------------------------------


def OpenChain(sites: int, *, ends: str = "free", **more: Any) -> Lattice:
    """A chain with two ends, ``"free"`` or ``"fixed"`` (tied to the ground by one more bond each).

    Examples
    --------
    >>> OpenChain(3).stiffness[0]
    array([ 1., -1.,  0.])
    >>> OpenChain(3, ends="fixed").stiffness[0]
    array([ 2., -1.,  0.])
    """
    n = np.arange(_count("sites", sites))
    matrix = _joined(n, (n[:-1], n[1:])).toarray()
    if one_of("ends", ends, ("free", "fixed")) == "fixed":
        matrix[0, 0] += 1.0
        matrix[-1, -1] += 1.0
    return Lattice(matrix, **{"name": f"open chain with {ends} ends", **more})


def Grid(rows: int, columns: int, *, periodic: bool = False, **more: Any) -> Lattice:
    """A rectangle of sites, each coupled to its nearest neighbours; site (i, j) has the number
    ``i columns + j``. With `periodic` it is closed to a torus.

    Examples
    --------
    >>> grid = Grid(3, 4)
    >>> grid.beside(0), grid.beside(5)
    ((1, 4), (1, 4, 6, 9))
    """
    size = _count("rows", rows), _count("columns", columns)
    n = np.arange(_count("rows x columns", size[0] * size[1])).reshape(size)
    if flag("periodic", periodic):  # a bond of a site to itself is none: its entries cancel
        kind, bonds = "torus", [(n, np.roll(n, -1, axis)) for axis in (0, 1)]
    else:
        kind, bonds = "grid", [(n[:-1], n[1:]), (n[:, :-1], n[:, 1:])]
    return Lattice(_joined(n, *bonds), **{"name": f"{kind} of {size[0]} x {size[1]}", **more})


def _count(name: str, value: Any) -> int:
    count = whole(name, value, 1)
    if count > MOST:
        raise BadInput(
            f"{name} = {count}: a lattice by its matrix has at most {MOST} sites; only rings, "
            "Ring(N), are larger."
        )
    return count
