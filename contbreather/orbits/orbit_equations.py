"""The equations of any periodic orbit with impacts, on any lattice.

Between impacts the lattice is linear. With impacts j = 1..m in a section T, which closes with the
sign e, at sites n_j, times t_j, and with impulses J_j,

    ``u_n(t) = a f_n(t) + c_n + sum over j of J_j h_nj(t - t_j)``,

h the answer to impulses that recur (`contbreather.lattice.response`), with e = +1 without its
static part, and c the static part: it balances the mean impulses N_s of the impacting sites. With
one of them and no springs it is the same everywhere, and sum J = 0. The equations:

    ``u_{n_j}(t_j) = wall_j``,  ``J_j = -(1 + k) u'_{n_j}(t_j-)``,  ``N_s = T ((K c)_s - a R_s)``,

K the stiffness of the lattice at rest between the impacting sites, and R what a mean of the drive
pulls at these with where they are held; f_n is then also what it displaces the others by.
Unknowns: t_1..t_m, J_1..J_m and, with e = +1, one offset for each impacting site; where a mode may
have a harmonic of the orbit for its frequency, its amplitude too, and the equation that drives it.
Symmetric, asymmetric, multi-site and period-n breathers, on every lattice, are all this; a lattice
enters by its response alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.conditions import Conditions, Walls, restitution_ratio
from contbreather.lattice.forcing import Forcing, Harmonic, even_harmonics
from contbreather.lattice.response import (
    HELD,
    ModalResponse,
    Resonant,
    Sites,
    UniformResponse,
    harmonics,
)
from contbreather.lattice.uneven import UnevenResponse
from contbreather.orbits.closure import forcing_at
from contbreather.orbits.section import Section, check_both_walls

FloatArray = NDArray[np.float64]
Params = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class OrbitEquations:
    """The equations of the module's docstring for one sequence of impacts.

    ``x = (t_1..t_m, J_1..J_m, c..., amplitudes...)``; ``params`` names a, gamma, k, damping and
    spring where they are not 0, and those of the forcing.
    """

    section: Section
    forcing: Forcing = field(default_factory=Harmonic)
    lattice: Any = field(default_factory=InfiniteChain)
    at: Walls = field(default_factory=Walls)
    resonant: Resonant = ()  # modes whose amplitudes, cosine and sine, are unknowns

    def __post_init__(self) -> None:
        if self.lattice.sites is not None:
            return
        check_both_walls(self.section, Conditions(1.0, 0.0, 0.0, lattice=self.lattice))
        if 0 in even_harmonics(self.forcing):
            raise BadInput(
                f"the forcing, {self.forcing.describe()}, has a mean: nothing holds an infinite "
                "chain against it; take a finite lattice, Ring(200) for instance."
            )

    # ------------------------------------------------------------------------ unknowns

    @cached_property
    def offsets(self) -> int:
        """Number of offsets: half a symmetric orbit has none."""
        return 0 if self.section.symmetric else len(self.section.hit)

    @cached_property
    def size(self) -> int:
        return 2 * self.section.count + self.offsets + 2 * len(self.resonant)

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Times, impulses, offsets, amplitudes of modes."""
        m, end = self.section.count, 2 * self.section.count + self.offsets
        return x[:m], x[m : 2 * m], x[2 * m : end], x[end:]

    def named(self, x: FloatArray) -> dict[str, Any]:
        times, impulses, offsets, amplitudes = self.split(x)
        values: dict[str, Any] = {f"t{i}": t for i, t in enumerate(times.tolist(), 1)}
        values |= {f"J{i}": J for i, J in enumerate(impulses.tolist(), 1)}
        names = self.section.offset_names(self.forcing.params)
        values |= dict(zip(names, offsets.tolist(), strict=False))
        return values | ({"modes": amplitudes} if amplitudes.size else {})

    @cached_property
    def sites(self) -> tuple[int, ...]:
        return tuple(site for site, _ in self.section.impacts)

    @cached_property
    def walls(self) -> FloatArray:
        return np.array([self.at.position(*impact) for impact in self.section.impacts])

    @cached_property
    def own(self) -> NDArray[np.int64]:
        """Index of the site of each impact among those that are hit."""
        return np.array([self.section.hit.index(site) for site in self.sites])

    def response(self, params: Params) -> Any:
        """Response of the lattice at these parameters."""
        held = tuple(float(params.get(name, 0.0)) for name in HELD)
        section, drive = self.section, forcing_at(self.forcing, params)
        return answers_of(
            self.lattice, drive, held, self.sites, section.turns, section.sign, self.resonant
        )

    # ------------------------------------------------------------------------ equations

    def residual(self, x: FloatArray, params: Params) -> FloatArray:
        """The equations: walls, reset laws, balance of mean impulses, modes in resonance."""
        at = self.terms(x, params)
        response, lost = at.response, self.losses(float(params["k"]))
        resets = at.f[1] + at.h[1] @ at.impulses + lost * at.impulses
        beyond = at.f[0] + at.h[0] @ at.impulses - self.walls
        if self.offsets:
            beyond = beyond + at.offsets[self.own]
        parts = [beyond, resets]  # the mean velocity at an impact is -q J/2
        if self.offsets:
            pull = self.section.period * (
                response.links() @ at.offsets - at.a * response.still()[1]
            )
            parts.append(np.bincount(self.own, at.impulses) - pull)
        if self.resonant:
            # impulses drive a mode by the sum of J m e exp(iwt)
            driven = at.impulses @ (self.masses * at.swing[0])
            parts.append(driven - response.gaps() @ at.amplitudes)
        return np.concatenate(parts)

    def jacobian(self, x: FloatArray, params: Params) -> FloatArray:
        at = self.terms(x, params)
        h, f, impulses, response = at.h, at.f, at.impulses, at.response
        m, r, i = self.section.count, self.offsets, np.arange(self.section.count)
        out = np.zeros((x.size, x.size))
        walls, resets, balance = slice(0, m), slice(m, 2 * m), slice(2 * m, 2 * m + r)
        bent = h[2].copy()
        bent.flat[:: m + 1] = 0.0  # an impact does not move against itself
        # h_ij is a function of t_i - t_j: a later t_j takes it back
        out[walls, walls] = -h[1] * impulses
        out[resets, walls] = -bent * impulses
        out[i, i] += f[1] + h[1] @ impulses  # the site itself moves on
        out[m + i, i] += f[2] + bent @ impulses
        out[walls, resets], out[resets, resets] = h[0], h[1]  # both are linear in J
        out[m + i, m + i] += self.losses(float(params["k"]))
        if r:
            out[i, 2 * m + self.own] = 1.0  # u moves with the offset of its site
            out[2 * m + self.own, m + i] = 1.0  # mean impulses add up
            out[balance, balance] = -self.section.period * response.links()
        if self.resonant:
            swing, modes = at.swing, slice(2 * m + r, None)
            out[walls, modes], out[resets, modes] = swing[:2]
            out[modes, walls] = (self.masses * swing[1] * impulses[:, None]).T
            out[modes, resets] = (self.masses * swing[0]).T
            out[modes, modes] = -response.gaps()
        return out

    def along(self, x: FloatArray, params: Params, way: Params) -> FloatArray:
        """Derivatives along a direction of the parameters, rates by name."""
        at = self.terms(x, params)
        beyond, resets, _ = self.moved(at, way)
        if "k" in way:
            share = self.shares  # d(q/2)/dk
            lost = share * at.impulses / (1.0 + float(params["k"]) * share) ** 2
            resets = resets - way["k"] * lost
        parts = [beyond, resets]
        response = at.response.varied(*way)
        if self.offsets:
            pull = way.get("a", 0.0) * response.still()[1]
            for name in way.keys() - {"a", "k", "damping"}:
                links = response.links(name) @ at.offsets if name in HELD else 0.0
                pull = pull + way[name] * (at.a * response.still(name)[1] - links)
            parts.append(self.section.period * pull)
        if self.resonant:
            gaps = sum(rate * response.gaps(name) for name, rate in way.items() if name in HELD)
            parts.append(np.dot(-gaps, at.amplitudes))
        return np.concatenate(parts)

    def terms(self, x: FloatArray, params: Params) -> Any:
        """Terms of the equations at one place."""
        x = np.asarray(x, dtype=float)
        return _place(self, x.tobytes(), tuple(params.items()))

    def moved(self, at: Any, way: Params) -> FloatArray:
        """Derivatives of displacement, velocity, acceleration at each impact along a direction of
        the parameters."""
        moved = np.asarray(way.get("a", 0.0) * at.forced[:3])
        if own := {name: rate for name, rate in way.items() if name not in ("a", "k")}:
            h, f = at.response.varied(*own).slopes_at_impacts(at.times, own)
            moved += at.a * f + h @ at.impulses
        return moved

    @cached_property
    def shares(self) -> FloatArray:
        """k of the site of each impact, in units of the parameter."""
        if self.lattice.sites is None:
            return np.ones(self.section.count)
        return np.asarray(self.lattice.restitutions[list(self.sites)])

    def losses(self, k: float) -> FloatArray:
        """Half of q, the loss at each impact."""
        own = k * self.shares
        return np.asarray(0.5 * ((1.0 - own) / (1.0 + own)))

    @cached_property
    def masses(self) -> FloatArray:
        """Mass of the site of each impact, in a column."""
        return np.asarray(self.lattice.masses[list(self.sites)][:, None])


class _Place:
    """Responses and forced motion at the impacts, at one set of unknowns and parameters."""

    def __init__(
        self, of: OrbitEquations, unknowns: bytes, given: tuple[tuple[str, float], ...]
    ) -> None:
        x, params = np.frombuffer(unknowns), dict(given)
        self.a = float(params["a"])
        restitution_ratio(float(params["k"]))
        if not (math.isfinite(self.a) and np.isfinite(x).all()):
            raise BadInput(f"a = {self.a}, x = {x}: the orbit needs finite numbers.")
        self.times, self.impulses, self.offsets, self.amplitudes = of.split(x)
        self.response = of.response(params)
        self.h, self.forced = self.response.at_impacts(self.times)
        self.f = self.a * self.forced  # with modes in resonance
        if of.resonant:
            self.swing = self.response.swing(of.sites, self.times)
            self.f = self.f + self.swing @ self.amplitudes


# kept by the unknowns' bits: Newton's method asks for equations and slopes at the same place
_place = lru_cache(maxsize=16)(_Place)
# kept: what they derive from the sequence serves a whole branch
_kept = lru_cache(maxsize=256)(OrbitEquations)


def equations_on(
    on: Conditions, section: Section, resonant: Resonant | None = None
) -> OrbitEquations:
    """The equations of orbits under these conditions, with the amplitudes of all modes that they
    may be in resonance with unless some are given."""
    if resonant is None:
        resonant = resonant_modes(on.lattice, section, on.gamma, on.spring)
    return _kept(section, on.forcing, on.lattice, on.walls, resonant)


# --- the response of a lattice, and modes in resonance --------------------------------------------


@lru_cache(maxsize=256)
def resonant_modes(lattice: Any, section: Section, gamma: float, spring: float) -> Resonant:
    """Modes of a finite lattice beyond half the lowest harmonic of an orbit, if its coupling can
    bring them to one: their amplitudes are unknowns."""
    if lattice.sites is None or not lattice.even:
        return ()
    lam, (first, step) = lattice.basis(section.hit).lam, harmonics(section.turns, section.sign)
    w = np.sqrt(gamma * lam + spring)
    nearest = first + step * np.maximum(0.0, np.round((w - first) / step))
    top = np.where(lam > 0.0, lattice.highest_gamma, 0.0) * lam
    within = (top > nearest * nearest) | (spring > 0.0)
    found = np.flatnonzero((w > 0.5 * first) & within)
    return tuple((int(i), float(nearest[i])) for i in found)


@lru_cache(maxsize=256)
def answers_of(
    lattice: Any,
    drive: Forcing,
    held: tuple[float, float, float],
    hits: Sites,
    turns: int,
    sign: int,
    resonant: Resonant = (),
) -> UniformResponse | ModalResponse:
    """The response of a lattice with these gamma, spring and damping: in closed form where it
    can be."""
    gamma, spring, damping = held
    more = damping or spring or resonant or 0 in even_harmonics(drive)
    chain = isinstance(lattice, InfiniteChain | Ring) and not more
    slow = 4.0 * turns * turns * gamma < 1.0  # no mode reaches the lowest harmonic
    local = sign > 0 or (turns == 1 and len({*hits}) == 1)
    kind: type[UniformResponse | ModalResponse] = ModalResponse
    if chain and (slow or lattice.sites is None) and local:
        kind = UniformResponse
    elif not (chain or lattice.even):
        kind = UnevenResponse
    return kind(lattice, drive, *held, hits, turns, sign, resonant)
