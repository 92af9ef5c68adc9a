"""Representations of the motion between impacts: what each of them answers, and which there are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from contbreather.lattice.conditions import Conditions
from contbreather.orbits.section import Impact, Section
from contbreather.orbits.site_motion import SiteMotion

if TYPE_CHECKING:
    from contbreather.continuation.point import DefiningSystem, Point
    from contbreather.continuation.problem import Problem

FloatArray = NDArray[np.float64]
Impacts = Sequence[Impact]
Offsets = Sequence[float]


class Representation(Protocol):
    """How the flights of one orbit are evaluated, with the equations and events that belong to it.

    A representation supports some lattices and sections only: see `suits`; what it cannot do is
    None.
    """

    @property
    def conditions(self) -> Conditions: ...
    @property
    def section(self) -> Section: ...
    @property
    def impacts(self) -> tuple[Impact, ...]:
        """Those of a section, in its order."""

    @property
    def offsets(self) -> tuple[float, ...]:
        """Static displacement of each impacting site, where it is an unknown of its own."""

    @property
    def c(self) -> float:
        """By how much the lattice as a whole sits off centre."""

    @property
    def accelerations(self) -> FloatArray:
        """Of the site that hits, just before each impact."""

    @property
    def error(self) -> float:
        """Largest error of the equations of the orbit."""

    @property
    def map(self) -> Any:
        """What small perturbations become over a section; of a finite lattice it has all
        ``multipliers()``."""

    @staticmethod
    def suits(on: Conditions, section: Section) -> bool:
        """Whether orbits with such impacts can be evaluated like this."""

    @classmethod
    def through(
        cls, on: Conditions, impacts: Section, times: Any, impulses: Any, offsets: Offsets
    ) -> Representation:
        """The motion with these impacts, or the one that comes closest to them."""

    def problem(self, threshold: float) -> Problem: ...
    def guess(self) -> Problem:
        """The problem for what need not be a solution yet."""

    @property
    def motion(self) -> SiteMotion:
        """How its sites move."""

    def locus(self, of: Any, point: Point, nu: float | None = None, **more: Any) -> DefiningSystem:
        """Defining system of a multiplier on a circle, `OnCircle`; complex from an angle on."""

    def grazing_site(self, site: int) -> Any:
        """How the motion of a site is followed, `grazing.GrazingSite`."""

    def speed_slope(self, j: int) -> Any:
        """The derivative, as that of a `DefiningSystem`, of the velocity of the site before an
        impact; None where the equations do not hold with one of velocity 0."""

    def lifted(self) -> Problem:
        """The problem of orbits that leave this one where its symmetry or its period breaks."""

    def rewritten(
        self, section: Section, impacts: Impacts, offsets: Offsets
    ) -> Representation | None:
        """Rewrite the motion with other impacts from the same start; None if that cannot be."""

    def on(self, lattice: Any) -> Any:
        """The `Orbit` of another lattice by means of its own; None where that needs another."""


# the closed form costs least, exact modes, which suit any finite lattice, most
_KINDS = "closed_form.ClosedForm", "green_function.GreensFunction", "exact_modes.ExactModes"


def suitable(on: Conditions, section: Section) -> Iterator[type[Representation]]:
    """Those that suit an orbit, the cheapest first: each is fetched when those before do not, and
    none knows the others."""
    for path in _KINDS:
        module, _, name = path.partition(".")
        kind: type[Representation] = getattr(import_module(f"contbreather.orbits.{module}"), name)
        if kind.suits(on, section):
            yield kind
