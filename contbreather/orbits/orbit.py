"""One periodic orbit with impacts, whichever way its motion between them is evaluated.

What an orbit is, its impacts and the conditions it moves under (`ImpactSequence`), and what it
answers are said once. How a flight is evaluated is its representation, a value handed in: the
closed form of one symmetric impact, or impacts and the response of the lattice.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbreather.checks import check_kind, flag, number, numbers, row
from contbreather.errors import BadInput, NotConverged
from contbreather.lattice.chain import InfiniteChain, Ring, lattice_of
from contbreather.lattice.conditions import Conditions
from contbreather.lattice.finite import finite, whole_sites
from contbreather.orbits.clearance import Admissibility, clearance
from contbreather.orbits.section import ImpactSequence, Section, check_order
from contbreather.orbits.site_motion import SiteMotion
from contbreather.parameters import OPTIONAL
from contbreather.tables import HtmlRepr, Sheet

if TYPE_CHECKING:
    from contbreather.certified import Certificate
    from contbreather.continuation.curve.problem import Problem
    from contbreather.stability.verdict import Verdict

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, repr=False)
class Orbit(ImpactSequence, HtmlRepr):
    """A periodic orbit with impacts: what a point of its branch is physically.

    Built by `symmetric`, `asymmetric`, `shooting`, `multibreather`, or from values, `orbit_of`.

    Attributes
    ----------
    representation : ClosedForm or ByImpacts
        How its flights are evaluated.
    omega : float
        Frequency of the drive. Times are its phases, omega times the time, and velocities, p and
        impulses in d omega: in units of 1/omega the motion is that of the representation.
    given : dict
        Parameters in their own unit of time, as they were given; the others are converted.
    section : Section
        Which sites hit which walls, over which time, and how that closes.
    impacts : tuple of Impact
        Those of a section: site, wall, time and impulse.
    offsets : tuple of float
        Static displacement of the impacting sites, where it is an unknown of its own.

    Examples
    --------
    >>> from contbreather.orbits.constructors import symmetric
    >>> b = symmetric(a=0.5, gamma=0.12, k=0.4)
    >>> b.section
    Section(impacts=((0, 1),), turns=1, sign=-1)
    >>> round(b.p, 12), round(b.phi, 12)
    (0.680056001966, -2.519293143359)
    """

    representation: Any  # `ClosedForm` or `ByImpacts`, with what they know besides
    omega: float = 1.0
    given: Mapping[str, float] = field(default_factory=dict, compare=False)

    @cached_property
    def conditions(self) -> Conditions:  # type: ignore[override]
        """Parameters, forcing, walls and lattice; each is there by its own name, too."""
        on: Conditions = self.representation.conditions
        return on.at_frequency(self.omega, **self.given)

    # --------------------------------------------------------------------------------- motion

    @property
    def motion(self) -> SiteMotion:
        """Motion of its sites between the impacts."""
        return SiteMotion(self.representation)

    def displacement(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Displacement of site ``n`` at time ``t``.

        Parameters
        ----------
        n : int or array_like of int
            Site; on a ring modulo its number of sites. Site (i, j) of a grid has the number
            ``i columns + j``.
        t : float or array_like
            Any real times; n and t are broadcast against each other.

        Returns
        -------
        float or ndarray
        """
        return self._profile(n, t, 0)

    def velocity(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Velocity of site ``n`` at time ``t``; at an impact, the value just after it. A time
        within rounding of an impact counts as the impact."""
        return self._profile(n, t, 1)

    def acceleration(self, n: ArrayLike, t: ArrayLike) -> Any:
        """Second derivative of `displacement`."""
        return self._profile(n, t, 2)

    def _profile(self, n: ArrayLike, t: ArrayLike, order: int) -> Any:
        values = self.motion.states(whole_sites(n, lattice=self.lattice), numbers("t", t))[order]
        return float(values) if np.ndim(values) == 0 else values

    def state(self, sites: int | None = None, t: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Displacements and velocities of all sites at time ``t``, just after it at an impact.

        Parameters
        ----------
        sites : int, optional
            Those of a ring of so many sites: of the ring's own orbit (see `on`), a state that a
            simulation of the ring repeats exactly. Needed on the infinite chain only.
        t : float

        Returns
        -------
        u, v : ndarray, shape (sites,)
        """
        orbit = self._on_ring(sites)
        if orbit.lattice.sites is None:
            raise BadInput(
                "the infinite chain has no end: ask for state(sites=N), or take "
                "the orbit to a ring of N sites, orbit.on(Ring(N))."
            )
        time = number("t", t, -math.inf, math.inf, "a time")
        u, v, _ = orbit.motion.states(np.arange(orbit.lattice.sites), time)
        return u, v

    # ------------------------------------------------------------------ what it is asked about

    def on(self, lattice: Any) -> Orbit:
        """The orbit of another lattice with the same impacts and parameters, next to this one.

        Sites keep their numbers: 0, where a breather of the infinite chain impacts, is the end of
        an `OpenChain`. `symmetric` takes the site there.

        Raises
        ------
        NotConverged, NoSolution
            If there is none close by.
        BadInput
            If an impacting site is not on that lattice, or springs and damping cannot be.
        """
        if isinstance(lattice, type) or not hasattr(lattice, "sites"):
            raise BadInput(f"lattice = {lattice!r}: InfiniteChain() or Ring(20), say, is expected.")
        lattice = lattice_of(lattice) if isinstance(lattice, InfiniteChain) else finite(lattice)
        if lattice == self.lattice:
            return self
        # the representation's own way there, or else Newton's iteration from the same impacts
        own = self.representation.on(lattice)
        there = own and replace(self, representation=own.representation)
        orbit = there or self._guessed_on(lattice)
        if orbit.repeats and not self.repeats:
            raise NotConverged(
                f"no orbit of {self.describe()} is close by on the {lattice.describe()}: Newton's "
                "iteration ends at one whose second half repeats the first; follow its bifurcation "
                "there instead, switch(branch.first(...)).",
                residual=orbit.residual,
                last=orbit,
            )
        return orbit

    def _guessed_on(self, lattice: Any) -> Orbit:
        hit, on = self.section.hit, replace(self.conditions, lattice=lattice)
        # where they are no unknowns of their own all sites are off centre by the same
        offsets = self.offsets or (self.c,) * len(hit)
        if lattice.sites is not None:  # they belong to the sites from left to right
            there = sorted(zip((site % lattice.sites for site in hit), offsets, strict=True))
            offsets = tuple(c for _, c in there)
        section = self.section.on(lattice)
        return _settled(orbit_of(on, section, self.times, self.impulses, offsets).problem)

    def solved(self) -> Orbit:
        """The orbit that Newton's method finds from this one as a guess."""
        from contbreather.stability.verdict import THRESHOLD

        return _settled(self.driven(self.representation.guess(THRESHOLD)))

    def _on_ring(self, sites: int | None) -> Orbit:
        if sites is None:
            return self
        if isinstance(self.lattice, Ring) or self.lattice.sites is None:
            return self.on(Ring(sites))
        raise BadInput(
            f"sites = {sites}: the size of a ring, but this orbit lives on the "
            f"{self.lattice.describe()}; ask without it, or take the orbit there, "
            f"orbit.on(Ring({sites}))."
        )

    def admissibility(self) -> Admissibility:
        """Say if all sites keep off their walls except at the impacts named, and by how much."""
        return self._clearance

    @cached_property
    def _clearance(self) -> Admissibility:
        """Asked where a root is chosen, and by whoever has it."""
        return clearance(self.motion)

    def stability(self, sites: int | None = None, threshold: float | None = None) -> Verdict:
        """Is it stable? The verdict names the lattice it is about.

        Parameters
        ----------
        sites : int, optional
            Ask about a ring of that many sites, by the paper's rule: a multiplier over the period
            beyond `threshold`. Unless given, the question is about the orbit's own lattice; on the
            infinite chain the answer is the number of isolated multipliers outside the unit
            circle, without a threshold.
        threshold : float, optional
            The paper's 1.005 unless given; for finite lattices only.

        Examples
        --------
        >>> from contbreather.orbits.constructors import symmetric
        >>> b = symmetric(a=0.2, gamma=0.11, k=0.8)
        >>> b.stability().unstable, b.stability(sites=400).stable
        (2, False)
        """
        from contbreather.stability.verdict import Verdict, threshold_on, verdict

        orbit = self._on_ring(sites)
        modulus = threshold_on(orbit.lattice, threshold)
        # where an impact vanishes (19) has a pole, and no multiplier means anything
        if not orbit.impulses.all():
            beyond, name = modulus if orbit.lattice.sites else None, orbit.lattice.describe()
            return Verdict(name, orbit.period, beyond, math.nan, certain=False, map=None)
        answer = verdict(orbit.map, modulus)
        return answer if orbit.vanishing is None else answer.blank()

    def certify(self, *, within: float = 1e-8) -> Certificate:
        """Prove by interval arithmetic that an exact breather is within so much of this one in p
        and phi, that it keeps off all walls except at its impacts, and how many multipliers are
        outside the circle: `contbreather.certified.certify`, which takes branches, too.

        For symmetric breathers of the infinite chain; needs python-flint.

        Examples
        --------
        >>> from contbreather.orbits.constructors import symmetric
        >>> symmetric(a=0.5, gamma=0.08, k=0.8).certify()
        <Certificate: Proved: a breather exists, the only one within 0.3. It keeps off all walls \
except at its impacts. No isolated multiplier of the half map outside the unit circle.>
        """
        from contbreather.certified import certify

        return certify(self, within=within)

    def multipliers(self, sites: int | None = None, *, half: bool = False) -> ComplexArray:
        """The 2N Floquet multipliers over the period on a finite lattice.

        Parameters
        ----------
        sites : int, optional
            Those of the orbit on a ring of so many sites; of its own lattice unless given.
        half : bool
            Of a symmetric orbit those over half its period: +1 at a pitchfork, -1 at a fold, where
            the squares are both +1.

        Returns
        -------
        ndarray of complex, shape (2 N,)
            NaN where an impact vanishes, and with it the derivative of the motion.

        Examples
        --------
        >>> from contbreather.orbits.constructors import symmetric
        >>> b = symmetric(a=0.8, gamma=0.045, k=0.8)
        >>> round(float(abs(b.multipliers(sites=400)).max()), 6)
        1.129438
        """
        orbit = self._on_ring(sites)
        if orbit.lattice.sites is None:
            raise BadInput(
                "the infinite chain has a continuous spectrum; ask for multipliers(sites=N) on a "
                "ring of N, or for stability().multipliers, the isolated ones outside the circle."
            )
        if flag("half", half) and not orbit.symmetric:
            raise BadInput("this orbit is not known by half its period: it has no half map.")
        if self.vanishing is not None:  # (19) divides by the velocity before the impact
            return np.full(2 * orbit.lattice.sites, complex(math.nan, math.nan))
        mu: ComplexArray = orbit.map.multipliers()
        # u(t + T/2) = -u(t): the map over the period is the square of the half map
        return mu if half or not orbit.symmetric else mu * mu

    @property
    def problem(self) -> Problem:
        """The orbit as a start for `trace`: its equations with all its events."""
        from contbreather.stability.verdict import THRESHOLD

        return self.problem_beyond(THRESHOLD)

    def problem_beyond(self, threshold: float) -> Problem:
        """`problem`, with instability from a threshold on."""
        return self.driven(self.representation.problem(threshold))

    def driven(self, problem: Problem) -> Problem:
        """Equations in the time of the drive as those of this frequency."""
        of_orbits: Any = problem
        if self.omega != 1.0:
            of_orbits = of_orbits.at_frequency(self.omega, **self.conditions.params)
        return of_orbits

    def unfolded(self) -> Orbit:
        """The whole period of a symmetric orbit, as one that need not be symmetric."""
        return self._again(self.section.unfolded()) if self.section.symmetric else self

    def doubled(self) -> Orbit:
        """This orbit, run through twice.

        Examples
        --------
        >>> from contbreather.orbits.constructors import symmetric
        >>> two = symmetric(0.5, 0.05, 0.8).unfolded().doubled()
        >>> two.section.turns, len(two.impacts), two.residual < 1e-14
        (2, 4, True)
        """
        return self._again(self.section.doubled())

    def _again(self, longer: Section) -> Orbit:
        _, _, times, impulses = zip(*self.section.course(self.impacts, 2), strict=True)
        return orbit_of(self.conditions, longer, times, impulses, self.offsets)

    def table(self) -> Sheet:
        """Its parameters, and what there is of p, phi, times, impulses."""
        rows = {n: v for n, v in self.conditions.params.items() if v or n not in OPTIONAL}
        if self.symmetric and self.section.count == 1:  # p and phi of (11), |u_1| of (15)
            rows |= {"p": self.p, "phi": self.phi, "chi": self.chi}
            # on chain and ring those to either side of site 0 move alike
            alike = isinstance(self.lattice, InfiniteChain | Ring) and self.section.hit == (0,)
            beside = "max |u_1|" if alike else "max |u| of its neighbours"
            if self.motion.beside:  # a ring of 1 has none
                rows[beside] = self.admissibility().max_neighbour
        else:
            for i, impact in enumerate(self.impacts, start=1):
                rows |= {f"t{i}": impact.time, f"impulse {i}": impact.impulse}
            rows |= {"c": self.c} if self.c else {}
        return Sheet.of(rows.items(), digits=15)

    def __repr__(self) -> str:
        values = {**self.conditions.params, "t": ", ".join(f"{t:.8g}" for t in self.times)}
        shown = ", ".join(
            f"{name} = {value if isinstance(value, str) else f'{value:.10g}'}"
            for name, value in values.items()
        )
        margins = self.admissibility()
        # at a located grazing the margin is 0 but for rounding: no reason to refuse it
        mark = "" if margins.ok or abs(margins.margin) < 1e-9 else f"; {margins.reason}"
        return f"<Orbit of {self.describe()}; {shown}; residual {self.residual:.1e}{mark}>"


# the closed form costs less than the equations, which suit any finite lattice
_KINDS = "closed_form.ClosedForm", "by_impacts.ByImpacts"


def suitable(on: Conditions, section: Section) -> Iterator[Any]:
    """Representations that suit an orbit, the cheapest first; none knows the others."""
    for path in _KINDS:
        module, _, name = path.partition(".")
        kind = getattr(import_module(f"contbreather.orbits.{module}"), name)
        if kind.suits(on, section):
            yield kind


def orbit_of(
    on: Conditions, section: Section, times: Any, impulses: Any, offsets: Sequence[float] = ()
) -> Orbit:
    """The orbit with these impacts, or a guess at it: ``orbit_of(...).solved()`` is one.

    Parameters
    ----------
    on : Conditions
    section : Section
    times, impulses : sequence of float
        One of each for every impact; an impulse at the wall +1 is negative.
    offsets : sequence of float, optional
        Static displacement of each impacting site; 0 unless given.

    Raises
    ------
    BadInput
        For impacts that cannot be under these conditions.

    Examples
    --------
    >>> from contbreather.orbits import orbit_of
    >>> guess = orbit_of(Conditions(0.5, 0.12, 0.4), Section(((0, 1), (0, -1))), [-2.5, 0.7],
    ...                  [-1.4, 1.4])
    >>> round(guess.solved().p, 10)
    0.680056002
    """
    check_kind(on, Conditions, "Conditions")
    check_kind(section, Section, "a Section of impacts")
    section = section.placed(on.lattice)
    times, impulses = (
        row(name, value, "one for each impact")
        for name, value in (("times", times), ("impulses", impulses))
    )
    offsets = tuple(np.ravel(numbers("offsets", offsets)).tolist())
    while True:
        for kind in suitable(on.scaled, section):
            motion = kind.through(on.scaled, section, times, impulses, offsets)
            return Orbit(motion, on.omega, on.params)
        if not section.symmetric:
            break
        # u(t + T/2) = -u(t): the other wall half a period later, with the opposite impulse
        times = np.concatenate([times, times + section.length])
        impulses, section = np.concatenate([impulses, -impulses]), section.unfolded()
    raise BadInput(
        f"damping = {on.damping}, spring = {on.spring}, walls = "
        f"{dict(on.walls.own) or on.walls.of_all}: orbits of the {on.lattice.describe()} have "
        "walls at -1 and 1 and no damping, and springs only where, in equal flights, "
        "one site hits its walls in turn; take a finite lattice, Ring(200) for instance."
    )


def _settled(problem: Problem) -> Orbit:
    solved, solution = problem.solve(tolerance=1e-11)
    orbit = orbit_at(solved)
    in_order(orbit, solution.iterations)  # not all that solves the equations is an orbit
    return orbit


def in_order(orbit: Orbit, iterations: int | None = None) -> None:
    """`NotConverged` where impacts are out of order, or come to a wall from outside."""
    try:
        check_order(orbit.section, orbit.times)
        for impact, velocity in zip(orbit.impacts, orbit.incoming.tolist(), strict=True):
            if velocity * impact.wall <= 0.0:  # from inside they have the same sign
                raise BadInput(
                    f"at t = {impact.time:.9g} site {impact.site} comes to its wall from outside, "
                    f"with the velocity {velocity * impact.wall:.6g}."
                )
    except BadInput as error:
        raise NotConverged(
            f"Newton's iteration ends at impact times {orbit.times.round(9).tolist()}, which is no "
            f"orbit of {orbit.describe()}: {error} Start closer to it.",
            residual=orbit.residual,
            iterations=iterations,
            last=orbit,
        ) from error


def orbit_at(problem: Problem) -> Orbit:
    """The orbit that a problem of orbits starts from."""
    from contbreather.continuation.curve.curve import Curve
    from contbreather.continuation.curve.point import Point

    curve = Curve(problem, ())
    orbit: Orbit = Point(curve, curve.start).solution
    return orbit
