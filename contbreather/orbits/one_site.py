"""Symmetric breathers of one impacting site on any finite lattice, in closed form.

Impulses ``-2p, +2p`` half a period apart make each mode answer with a state that recurs with the
opposite sign, ``(1 + M) x = -M (0, kick)``, M its flight over half a period. Its sum over the
modes at the impacting site gives chi and, with damping, the excess delta of the velocity before
the impact, and the closure (11) is what it is on the chain:

    ``p chi = 1 - a f(phi)``, ``p (q + 2 delta) = a f'(phi)``,

f being the forced motion of that site.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contbreather.errors import BadInput, NoSolution
from contbreather.lattice.conditions import Conditions, restitution_ratio
from contbreather.lattice.forcing import Forcing, Fourier
from contbreather.lattice.modal_flow import propagator
from contbreather.orbits.closure import general_roots
from contbreather.orbits.exact_modes import ExactModes
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.section import Section, check_walls
from contbreather.orbits.shooting_equations import SectionFlight

FloatArray = NDArray[np.float64]

RESONANT = 1e-12  # 2 + trace of a mode that is its own mirror image after half a period


class Resonance(BadInput):
    """A mode of the lattice follows the impacts without bound."""


def symmetric_orbits(site: int, on: Conditions) -> tuple[Orbit, ...]:
    """All symmetric orbits of one impacting site, by descending p.

    Raises
    ------
    BadInput
        In resonance: a mode whose frequency is an odd whole number, without damping.
    NoSolution
        If the forcing is too weak for any.

    Examples
    --------
    >>> from contbreather.lattice import Ring
    >>> orbit = symmetric_orbits(0, Conditions(0.5, 0.12, 0.4, lattice=Ring(20)))[0]
    >>> round(orbit.p, 9), round(orbit.phi, 9)
    (0.680056002, -2.519293143)
    """
    section = Section(((site, 1),), sign=-1).placed(on.lattice)
    (site, _) = section.impacts[0]
    check_walls(section, on)
    width = on.walls.position(site, 1)  # everything scales with it
    q, r, chi, loss, forced = _closure(section, on)
    roots = [] if forced is None else general_roots(on.a / width, chi, loss, forced)
    if not roots:
        weak = "is too weak to bring it to its walls; take a larger a."
        raise NoSolution(
            f"no symmetric orbit of site {site} on the {on.lattice.describe()} at a = {on.a!r} "
            f"(gamma = {on.gamma}, k = {on.k}, damping = {on.damping}, spring = {on.spring}): the "
            f"forcing {'does not move it.' if forced is None else weak}"
        )
    # J = -2p times the state of a unit impulse
    return tuple(
        Orbit(ExactModes(section, np.array([phi]), -2.0 * p * q, -2.0 * p * r, on))
        for p, phi in sorted(((width * p, phi) for p, phi in roots), reverse=True)
    )


def family_of(orbit: Orbit) -> str:
    """``"upper"`` before a fold of the closure, ``"lower"`` behind it, as of `SymmetricBreather`.

    Examples
    --------
    >>> from contbreather.lattice import Ring
    >>> on = Conditions(0.5, 0.12, 0.4, damping=0.01, lattice=Ring(6))
    >>> [family_of(orbit) for orbit in symmetric_orbits(0, on)]
    ['upper', 'lower']
    """
    if not isinstance(orbit.representation, ExactModes):
        family: str = orbit.representation.family
        return family
    *_, chi, loss, forced = _closure(orbit.section, orbit.conditions)
    assert forced is not None
    phi = orbit.times[0]
    turn = chi * forced.d2f(phi) + loss * forced.df(phi)  # det of the closure, over -a
    return "upper" if turn >= 0.0 else "lower"


def _closure(
    section: Section, on: Conditions
) -> tuple[FloatArray, FloatArray, float, float, Forcing | None]:
    """State of each mode before a unit impulse, chi, q + 2 delta and f of the closure; no f where
    nothing moves the site."""
    still = np.zeros(on.lattice.basis(section.hit).lam.size)
    rest = ExactModes(section, np.zeros(1), still, still, on)  # in its forced motion alone
    (q, r), e, (site, _) = _answer(rest), rest.shapes[0], section.impacts[0]
    # per unit p, J = -2p; without damping r is -1/2 before and 1/2 after a unit impulse
    chi, excess = -2.0 * float(e.dot(q)), float(e.dot(r)) + 0.5
    series = rest.forced.harmonics(site)
    moved = any(A or B for _, A, B in series)
    cos, sin = {m: A for m, A, _ in series}, {m: B for m, _, B in series}
    forced = Fourier.from_response(cos, sin) if moved else None
    return q, r, chi, restitution_ratio(on.k) + 2.0 * excess, forced


def _answer(rest: SectionFlight) -> tuple[FloatArray, FloatArray]:
    """State of each mode just before a unit impulse that recurs with alternating sign."""
    fly = propagator(rest.z, rest.section.length, rest.conditions.damping)
    kick = rest.kicks[0]
    # (1 + M) x = -M (0, kick), by Cramer; det(1 + M) = 1 + trace + det
    after = fly.reach * kick, fly.swing * kick
    det = (1.0 + fly.cosine) * (1.0 + fly.swing) + fly.reach * fly.pull
    if (abs(det) < RESONANT).any():
        w = float(np.sqrt(rest.z[abs(det).argmin()]))
        raise Resonance(
            f"a mode of the {rest.conditions.lattice.describe()} with the frequency {w:.9g} is in "
            "resonance with the orbit: change gamma or spring, or give it damping."
        )
    q = -((1.0 + fly.swing) * after[0] - fly.reach * after[1]) / det
    r = -(fly.pull * after[0] + (1.0 + fly.cosine) * after[1]) / det
    return q, r
