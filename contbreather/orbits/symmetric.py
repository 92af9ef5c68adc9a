"""The symmetric breather as an orbit: its problem, and all of them at given parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from contbreather.checks import real
from contbreather.continuation import Event, Locus, Point, Problem
from contbreather.errors import BadInput
from contbreather.lattice import (
    Forcing,
    InfiniteChain,
    Lattice,
    Ring,
    finite,
    forcing_of,
    lattice_of,
)
from contbreather.lattice.conditions import Conditions, Walls, restitution_ratio
from contbreather.lattice.on_site_spring import spring_response
from contbreather.orbits import closed_slopes
from contbreather.orbits.branch_switching import lift
from contbreather.orbits.clearance import LIMIT
from contbreather.orbits.closed_form import HALF, SymmetricBreather
from contbreather.orbits.closure import Closure, roots, sprung
from contbreather.orbits.grazing import ALIKE, GrazingSite
from contbreather.orbits.green_function import asymmetric_problem
from contbreather.orbits.one_site import symmetric_orbits
from contbreather.orbits.orbit import Orbit, orbit_at, orbit_of, with_parameters
from contbreather.orbits.orbit_events import events_of, saddle_node
from contbreather.orbits.orbit_problem import on_ring, unstable_by
from contbreather.orbits.representation import Impacts, Offsets, Representation, representation
from contbreather.orbits.section import Section
from contbreather.orbits.site_motion import SiteMotion
from contbreather.parameters import NEEDED, NUMBERS, parameter
from contbreather.stability.verdict import THRESHOLD, check_threshold
from contbreather.storage.serialise import serialised

# An impact of p = 0 is none: there b has a pole, so the branch ends a hair before. With harmonic
# forcing that is at a = 1, where the far field grazes.
DOMAIN = {name: NUMBERS[name].domain for name in NEEDED} | {"p": (1e-14, math.inf)}


@representation(1)
@dataclass(frozen=True)
class ClosedForm(SymmetricBreather):
    """One site of the infinite chain or of a ring that hits its walls in turn."""

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        where: Any = InfiniteChain if on.spring else InfiniteChain | Ring
        plain = not on.damping and on.walls == Walls()
        return plain and section == HALF and isinstance(on.lattice, where)

    @classmethod
    def through(
        cls, on: Conditions, section: Section, times: Any, impulses: Any, offsets: Offsets
    ) -> ClosedForm:
        p, phi = -0.5 * float(impulses[0]), float(times[0])
        drive = spring_response(on.forcing, on.spring) if on.spring else on.forcing
        return cls(on.a, on.gamma, on.k, p, phi, drive, on.lattice)

    def weakly(self) -> SiteMotion:
        motion: SiteMotion = replace(self, gamma=ALIKE).motion
        return motion

    def locus(self, of: Any, point: Point, nu: float | None = None, **more: Any) -> Locus:
        return closed_slopes.locus(of, point, nu, **more)

    def crest(self, site: int) -> GrazingSite:
        return closed_slopes.crest(self, site)

    def speed_slope(self, j: int) -> None:
        """(11) has no root with p = 0."""

    def lifted(self) -> Problem:
        """That of asymmetric breathers, in which a pitchfork is a regular point."""
        return asymmetric_problem(Orbit(self).unfolded())

    def rewritten(self, section: Section, impacts: Impacts, offsets: Offsets) -> Representation:
        times, impulses = [one.time for one in impacts], [one.impulse for one in impacts]
        return orbit_of(self.conditions, section, times, impulses, offsets).representation

    def problem(self, threshold: float) -> Problem:
        return symmetric_problem(Orbit(self), threshold)

    def guess(self) -> Problem:
        return symmetric_problem(Orbit(self))

    def on(self, lattice: Any) -> Orbit | None:
        """The root of (11) nearest to this one."""
        if not isinstance(lattice, InfiniteChain | Ring):
            return None
        on = self.conditions
        found = symmetric_roots(
            on.a, on.gamma, on.k, forcing=on.forcing, lattice=lattice, spring=on.spring or None
        )
        return min(
            found,
            key=lambda b: math.hypot(b.p - self.p, math.remainder(b.phi - self.phi, 2.0 * math.pi)),
        )


def symmetric_problem(breather: Orbit, threshold: float = THRESHOLD) -> Problem:
    """The closure (11) with the breather as its start, and all its events.

    Columns: p, phi; a, gamma, k and the parameters of the forcing; ``unstable``, the number of
    multipliers of QS outside the circle, on a ring those over 2 pi beyond the threshold; computed
    when asked for.
    """
    forcing, lattice = breather.representation.forcing, breather.lattice
    closure = Closure(forcing, lattice)
    flight = breather.representation
    return Problem(
        closure.residual,
        {"p": flight.p, "phi": flight.phi},
        {"a": breather.a, "gamma": breather.gamma, "k": breather.k, **forcing.params},
        jacobian=closure.jacobian,
        sensitivity=closure.sensitivity,
        loops=closure.loops,
        events=events_on(lattice, threshold),
        record={"unstable": unstable_by(threshold)},
        domain=_domain(breather),
        interpret=partial(_interpreted, forcing, lattice),
        lifts={"PF": lift},
        wider=partial(_wider, threshold),
        label=f"symmetric breather{on_ring(lattice, threshold)}",
        serialised={
            "kind": "symmetric breather",
            "forcing": forcing,
            "lattice": lattice,
            "threshold": threshold,
        },
    )


@serialised("symmetric breather")
def _from_dict(
    *,
    forcing: Forcing,
    lattice: Lattice,
    threshold: float,
    start: Mapping[str, Any],
    params: Mapping[str, float],
) -> Problem:
    drive = forcing.at(**{name: params[name] for name in forcing.params})
    a, gamma, k = (params[name] for name in ("a", "gamma", "k"))
    breather = ClosedForm(a, gamma, k, start["p"], start["phi"], drive, lattice)
    return symmetric_problem(Orbit(breather), threshold)


def _interpreted(forcing: Forcing, lattice: Lattice, point: Point) -> Orbit:
    values, own = point.params, forcing.params
    driven = forcing.at(**{name: values[name] for name in own}) if own else forcing
    p, phi = float(point.z[0]), float(point.z[1])
    return Orbit(ClosedForm(values["a"], values["gamma"], values["k"], p, phi, driven, lattice))


def _wider(threshold: float, problem: Problem, names: tuple[str, ...]) -> Problem:
    """On the infinite chain with the spring, as one of 0; on a ring by its modes."""
    orbit = orbit_at(problem)
    if orbit.lattice.sites is not None or "spring" not in names:
        return with_parameters(threshold, problem, names)
    soft = Orbit(replace(orbit.representation, forcing=spring_response(orbit.forcing, 0.0)))
    return symmetric_problem(soft, threshold).having(*names)


def _domain(breather: Orbit) -> dict[str, tuple[float, float]]:
    """With springs as far as the band stays below the drive, along either parameter by itself."""
    if "spring" not in breather.representation.forcing.params:
        return DOMAIN
    gamma = NUMBERS["gamma"]
    stiffest = 1.0 - gamma.margin - 4.0 * breather.gamma
    return {
        **DOMAIN,
        "gamma": (0.0, gamma.domain[1] - 0.25 * breather.spring),
        "spring": (0.0, stiffest),
    }


def events_on(lattice: Lattice, threshold: float = THRESHOLD) -> tuple[Event, ...]:
    """All events of a symmetric breather; on a ring Neimark-Sacker by the paper's rule."""
    if isinstance(lattice, Ring):
        check_threshold(threshold)
    return (saddle_node(), *events_of(HALF, lattice, threshold))


def symmetric(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Forcing | str | None = None,
    lattice: Lattice | finite.Finite | None = None,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
    root: int | None = None,
) -> Orbit:
    """The symmetric breather of one impacting site, eqs. (11) to (13).

    Of several solutions the admissible one with the largest p. For `Harmonic` forcing that is the
    upper sign of (13), the only one that can be stable, wherever it keeps off the walls.

    Parameters
    ----------
    a : float
        Amplitude of the forcing, at least the fold (14).
    gamma : float
        Coupling in [0, 1/4).
    k : float
        Restitution coefficient in [0, 1].
    forcing : Forcing or str, optional
        `Harmonic` unless given.
    lattice : InfiniteChain, Ring or Lattice, optional
        `InfiniteChain` unless given.
    site : int
        The one that impacts.
    damping, spring : float, optional
        ``u'' + damping u' + spring u + ...``. On the infinite chain springs alone, with
        ``spring + 4 gamma < 1``.
    walls : (low, high) or dict of site and (low, high), optional
        -1 and 1 unless given, ``low = -high``; on finite lattices.
    root : int, optional
        Which solution of (11), by falling p from 1, admissible or not.

    Returns
    -------
    Orbit
        A solution of (11). Where none keeps off the walls between its impacts (to 1e-9, at the
        limit) it is that with the largest p, and its `admissibility` says what is in the way.

    Raises
    ------
    BadInput
        gamma, k or a outside its range, or no solution of that number.
    NoSolution
        a below the fold; the sentence names the smallest a.

    Examples
    --------
    >>> b = symmetric(a=0.5, gamma=0.12, k=0.4)
    >>> round(b.p, 12), round(b.phi, 12)
    (0.680056001966, -2.519293143359)
    """
    more: dict[str, Any] = {"site": site, "damping": damping, "spring": spring, "walls": walls}
    return rooted(symmetric_roots(a, gamma, k, forcing=forcing, lattice=lattice, **more), root)


def rooted(found: tuple[Orbit, ...], root: int | None) -> Orbit:
    """The solution of (11) with that number, counted from 1 by falling p; without one the first
    that is admissible, or the first of all where none is."""
    if root is None:
        own = found if len(found) > 1 else ()
        # on GR rounding must not decide which of two breathers it is
        return next((one for one in own if one.admissibility().margin > -LIMIT), found[0])
    if not (isinstance(root, int | np.integer) and 1 <= root <= len(found)):
        there = ", ".join(f"{i}: p = {one.p:.9g}" for i, one in enumerate(found, start=1))
        raise BadInput(f"root {root}: the solutions of (11) are {there}; choose one of them")
    return found[root - 1]


def symmetric_roots(
    a: float,
    gamma: float,
    k: float,
    *,
    forcing: Forcing | str | None = None,
    lattice: Lattice | finite.Finite | None = None,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
) -> tuple[Orbit, ...]:
    """All solutions of (11) with p > 0, by descending p; parameters and errors of `symmetric`.

    Examples
    --------
    >>> from contbreather.lattice import Fourier
    >>> two = Fourier.from_response(cos={1: 1.0, 3: 0.3})
    >>> len(symmetric_roots(0.3, 0.12, 0.7, forcing=two))
    4
    """
    drive = forcing_of(forcing)
    more = any(real(value) != 0.0 for value in (site, damping)) or walls is not None
    held_ring = isinstance(lattice, Ring) and (more or spring is not None)
    if isinstance(lattice, finite.Lattice) or held_ring:
        at = Walls.given(walls)
        spring = 0.0 if spring is None else spring
        on = Conditions(a, gamma, k, damping, spring, drive, at, lattice).checked()
        return symmetric_orbits(site, on)
    chain = lattice_of(lattice)
    if more:
        parameter("damping", damping)
        raise BadInput(
            f"site = {site!r}, damping = {damping!r}, walls = {walls!r}: on the infinite chain "
            "site 0 impacts, between walls at -1 and 1, without damping; take a ring or another "
            "finite lattice."
        )
    if spring is not None and chain.sites is None:
        drive = spring_response(drive, InfiniteChain(spring).spring)
    gamma, a = sprung(chain, drive).check(gamma), parameter("a", a)
    restitution_ratio(k)
    found = roots(a, gamma, float(k), drive, chain)
    if not all(math.isfinite(p) for p, _ in found):
        reach = 1.0 / drive.peak()
        raise BadInput(
            f"a = {a!r}: too large, p is beyond what a number can hold; on the infinite chain no "
            f"breather is admissible beyond a = {reach:.6g}, where the far field reaches the walls."
        )
    return tuple(Orbit(ClosedForm(a, gamma, float(k), p, phi, drive, chain)) for p, phi in found)
