"""Multipliers in the complex plane: unit circle, arcs of the band, and what stands alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import check_kind, whole
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.point import Point
from contbreather.continuation.curve.problem import Problem
from contbreather.errors import BadInput
from contbreather.flows.conservative_events import signatures
from contbreather.flows.cycle_problem import Cycle
from contbreather.lattice.chain import Ring
from contbreather.orbits.orbit import Orbit
from contbreather.plotting import canvas
from contbreather.plotting.branches import MANY, value_of
from contbreather.plotting.canvas import BLUE, GREY, SKY, VERMILLION, Drawn
from contbreather.plotting.orbits import no_orbit, solution_of
from contbreather.simulation.periodic import PeriodicMotion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[Any]

FAR = 2.0  # from 0: what is farther out is shown at the edge of the figure
_ON_CIRCLE = 1 + 1e-9  # closer than that is on it, as for counts of cycles


def plot_multipliers(
    breather: Orbit | Cycle | PeriodicMotion | Point,
    *,
    sites: int | None = None,
    half: bool = False,
    digits: int = 4,
    ax: Axes | None = None,
) -> Drawn:
    """Draw the Floquet multipliers of a breather on a ring, of an orbit on its own lattice, of a
    motion that returns, or of a cycle of flows or of a map.

    The unit circle, the band of the infinite chain ``exp(+-2 i pi w)`` (``exp(+-i pi w)`` for the
    half map; on the circle ``exp(-damping pi)`` with damping), all 2N multipliers of the ring, and
    the values of those off the band: of the eight that are farthest from it. What is farther than 2
    from 0 is a triangle at the edge, so that the circle stays a circle one can read. Finite
    lattices other than rings have no band; there the circle of free modes is drawn, of what
    `periodic` or `cycle` found neither. The trivial multiplier of an autonomous cycle is left out.

    Parameters
    ----------
    breather : Orbit, simulation.PeriodicMotion, flows.Cycle, a cycle of a map, or a Point of these
        Of a conservative one pairs with the Krein signature -1 are open circles.
    sites : int, optional
        Length of the ring; that of the breather's own lattice, or 400 on the infinite chain.
    half : bool
        Those of the half map QS instead of (QS)^2: there +1 is a pitchfork and -1 a fold.
    digits : int
        Decimals of the labels.
    ax : matplotlib Axes; a new figure for a journal column unless given

    Raises
    ------
    BadInput
        For what has no multipliers: a branch, say, or an orbit whose impact vanishes (VI).

    Examples
    --------
    >>> import contbreather as cb
    >>> ax = plot_multipliers(cb.symmetric(0.8, 0.045, 0.8), half=True).axes
    >>> sorted(word.get_text() for word in ax.texts if word.get_text())
    ['0.6158', '1.0628']
    """
    whole("digits", digits, 0)
    with canvas.drawing(ax, height=8.5) as (drawn, axes):
        name_multipliers(axes, *draw_multipliers(axes, breather, sites, half), digits)
    return drawn


def draw_multipliers(
    axes: Axes, breather: Any, sites: int | None, half: bool = False
) -> tuple[Array, Array, list[int]]:
    """Draw all but the words, which come last, when all else has its place: the multipliers, where
    they are shown, and which are to be named."""
    orbit = solution_of(breather)
    if not hasattr(orbit, "multipliers") or isinstance(orbit, type | Branch | Problem):
        raise no_orbit(orbit, "an orbit or a cycle")
    paired = False
    if not isinstance(orbit, Orbit):
        _not_of_cycles(sites, half)
        mu = _own(orbit)
        mu = mu[~np.isnan(mu)]  # at VI only one is known, which is infinite
        if isinstance(orbit, Cycle) and orbit.paired:  # where pairs meet rounding moves them apart
            paired = True
            root = np.sqrt(orbit.indices**2 - 1)
            mu = np.concatenate([orbit.indices + root, orbit.indices - root])
        # of pairs those on the circle need no name
        waves, alone = np.empty((0, 0)), (np.abs(mu) > _ON_CIRCLE) | (not paired)
    else:
        ring = 400 if orbit.lattice.sites is None else None
        mu, waves, alone = with_band(orbit, ring if sites is None else sites, half)
    angle = np.linspace(-math.pi, math.pi, 361)
    axes.plot(np.cos(angle), np.sin(angle), color=GREY, linewidth=0.6, zorder=1)
    for part in waves:
        axes.plot(part.real, part.imag, color=SKY, linewidth=5.0, alpha=0.5, zorder=2,
                  solid_capstyle="butt")  # fmt: skip
    axes.axhline(0.0, color=GREY, linewidth=0.3, zorder=0)
    axes.axvline(0.0, color=GREY, linewidth=0.3, zorder=0)
    finite = np.where(np.isinf(mu), np.sign(mu.real) * 1e300, mu)
    size = np.abs(finite)  # those far out are shown at the edge, in their direction
    shown = np.where(size > FAR, finite / np.maximum(size, 1e-300) * FAR, mu)
    # with room for words outside the circle
    reach = max(1.6, 1.1 * float(np.abs(shown).max(initial=0.0)))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    squares = isinstance(orbit, Orbit | PeriodicMotion) and not half
    name = r"$\mu^2$" if squares else r"$\mu$"
    axes.set(xlabel=f"Re {name}", ylabel=f"Im {name}", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    _dots(axes, mu, shown, alone)
    on, signs = signatures(orbit) if paired else (np.empty(0), np.empty(0))
    if (index := on[signs < 0]).size:
        side = np.sqrt(1 - index**2) * np.array([[1], [-1]])
        axes.plot(np.tile(index, 2), side.ravel(), "o", color=BLUE, markerfacecolor="w",
                  markersize=4, zorder=4, label="Krein signature \N{MINUS SIGN}1")  # fmt: skip
        axes.legend(loc="lower right", frameon=False, handlelength=1.0)
    return mu, shown, _named(mu, alone & (mu.imag >= 0.0))


def name_multipliers(axes: Axes, mu: Array, shown: Array, named: list[int], digits: int) -> None:
    """Write values beside multipliers; in axes narrower than 150 points a pair takes two lines."""
    canvas.lay_out(axes)
    pixel = canvas.lay_out(axes)  # axes of equal scales come to rest slowly
    space = "\n" if axes.bbox.width / pixel < 150.0 else " "
    plain = canvas.text_colour(axes)
    canvas.place_words(axes, pixel, (
        (shown[i].real, shown[i].imag, _number(mu[i], digits, space),
         {"color": VERMILLION if abs(mu[i]) > _ON_CIRCLE else plain})
        for i in named
    ))  # fmt: skip


def _own(orbit: Any) -> Array:
    return np.asarray(orbit.others if isinstance(orbit, Cycle) else orbit.multipliers)


def _not_of_cycles(sites: int | None, half: bool) -> None:
    if sites is not None or half:
        raise BadInput(
            "sites= and half= are about lattices; a cycle of flows, or of a map, or a motion that "
            "returns, has its multipliers"
        )


def plot_spectrum(
    branch: Branch,
    *,
    x: str | None = None,
    sites: int | None = None,
    half: bool = False,
    ax: Axes | None = None,
) -> Drawn:
    """Draw the spectrum along a branch: of orbits the moduli of their multipliers, with the circle
    they cross, far outside by their logarithm; of other problems the real parts of the
    eigenvalues, with 0.

    Parameters
    ----------
    branch : Branch
        Of orbits or cycles, of flows or maps, or of anybody's equilibria.
    x : str, optional
        The free parameter unless given.
    sites : int, optional
        As for `plot_multipliers`; 40 on the infinite chain.
    half : bool
        Multipliers over half the period of symmetric orbits.
    ax : matplotlib Axes; a new figure for a journal column unless given

    Raises
    ------
    BadInput
        For what is not a branch, or a boundary, whose own equations are not those of the motion.

    Examples
    --------
    >>> import contbreather as cb, numpy as np
    >>> line = cb.Problem(lambda x, p: np.array([p["mu"] - x[0] ** 2]), {"x": 1.0}, {"mu": 1.0})
    >>> ax = plot_spectrum(cb.trace(line, "mu", within={"x": (-1, 1)})).axes
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('$\\\\mu$', 'Re of eigenvalues')
    """
    check_kind(branch, Branch, "a branch")
    if len(branch.curve.free) > 1:
        raise BadInput("a boundary has two parameters; take a branch in one of them")
    first = solution_of(branch[0])
    of_orbits = hasattr(first, "multipliers")
    if not isinstance(first, Orbit):
        _not_of_cycles(sites, half)
    elif first.lattice.sites is None and sites is None:
        sites = 40
    x = branch.free if x is None else x

    def spectrum(point: Point) -> Array:
        if isinstance(first, Orbit):
            return np.sort(np.abs(point.solution.multipliers(sites=sites, half=half)))
        if of_orbits:
            return np.abs(_own(point.solution))
        return np.sort(point.curve.spectrum(point.z).real)

    values = np.array([spectrum(point) for point in branch])
    with canvas.drawing(ax) as (drawn, axes):
        axes.plot(branch[x], values, ".", color=BLUE, markersize=1.6)
        if of_orbits and np.nanmax(values, initial=0.0) > 20.0:  # at VI there are none
            axes.set_yscale("symlog", linthresh=1.0)  # as it is within the circle
        axes.axhline(1.0 if of_orbits else 0.0, color=GREY, linewidth=0.6, zorder=0)
        for point in branch.special:
            axes.axvline(value_of(point, x), color=GREY, linewidth=0.5, linestyle=":", zorder=0)
        axes.set(xlabel=canvas.symbol(x), ylabel=r"$|\mu|$" if of_orbits else "Re of eigenvalues")
    return drawn


def band(orbit: Orbit, half: bool = False) -> Array:
    """Multipliers of plane waves, ``exp((-c/2 +- sqrt(c^2/4 - w^2)) T)`` with damping c, shape
    (2, n): both of a pair, from one edge of the band to the other. On a finite lattice that is no
    ring the circle that they lie on."""
    period, on = orbit.period / (2.0 if half else 1.0), orbit.conditions.scaled
    decay = 0.5 * on.damping
    if orbit.lattice.sites is not None and not isinstance(orbit.lattice, Ring):
        return math.exp(-decay * period) * np.exp(1j * np.linspace([0, 0], [np.pi, -np.pi], 721).T)
    theta = np.linspace(0.0, math.pi, 721)
    squares = on.spring + 4.0 * on.gamma * np.sin(0.5 * theta) ** 2
    root = np.sqrt(decay**2 - squares + 0j)
    return np.exp((-decay + np.multiply.outer([1.0, -1.0], root)) * period)


def with_band(
    orbit: Orbit, sites: int | None, half: bool
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Multipliers on its own lattice or on a ring, those of plane waves, and which are not theirs;
    refused where an impact vanishes, which has none."""
    from scipy.spatial import KDTree

    mu, waves = np.asarray(orbit.multipliers(sites=sites, half=half)), band(orbit, half)
    if np.isnan(mu).any():
        raise BadInput(orbit.stability(sites).describe())
    places = [np.stack([z.real, z.imag], axis=-1) for z in (waves.ravel(), mu)]
    gap, _ = KDTree(places[0]).query(places[1])
    ripple = max(0.01, 3.0 / (sites or orbit.lattice.sites or 1))  # of a ring
    return mu, waves, np.asarray(gap > ripple)


def _named(mu: Array, which: NDArray[np.bool_]) -> list[int]:
    """Multipliers to name: those farthest off the circle, of these the tightest place first."""
    off = np.abs(np.log(np.maximum(np.abs(mu), 1e-300)))
    return sorted(np.flatnonzero(which).tolist(), key=lambda i: off[i])[-MANY:]


def _dots(ax: Axes, mu: Array, shown: Array, alone: NDArray[np.bool_]) -> None:
    outside, far = np.abs(mu) > _ON_CIRCLE, np.abs(mu) > FAR
    for which, colour in ((~alone, BLUE), (alone & ~outside, BLUE), (alone & outside, VERMILLION)):
        near, size = shown[which & ~far], 2.6 if np.any(which & alone) else 1.6
        ax.plot(near.real, near.imag, "o", color=colour, markersize=size, zorder=3)
    for place in shown[far]:
        pointing = (3, 0, math.degrees(np.angle(place)) - 90.0)  # a triangle that points outwards
        ax.plot(place.real, place.imag, marker=pointing, color=VERMILLION, markersize=5, zorder=3)


def _number(mu: complex, digits: int, space: str) -> str:
    text = f"{mu.real:.{digits}f}"
    if mu.imag != 0.0:
        text += f"{space}\N{PLUS-MINUS SIGN} {abs(mu.imag):.{digits}f}i"
    return text.replace("-", "\N{MINUS SIGN}")
