"""Multipliers in the complex plane: unit circle, arcs of the band, and what stands alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import kind_of, whole
from contbreather.errors import BadInput
from contbreather.orbits import Orbit
from contbreather.plotting.canvas import BLUE, GREY, SKY, VERMILLION, Drawn, drawing
from contbreather.plotting.labels import Labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[Any]

NARROW = 150.0  # points: in axes narrower than that a pair takes two lines
ALONE = 3.0  # times 1/sites: off the band by more, a multiplier does not belong to it


def plot_multipliers(
    breather: Orbit,
    *,
    sites: int | None = None,
    half: bool = False,
    digits: int = 4,
    ax: Axes | None = None,
) -> Drawn:
    """Draw the Floquet multipliers of a breather on a ring, or of an orbit on its own lattice.

    The unit circle, on it the band of the infinite chain ``exp(+-2 i pi w)`` (``exp(+-i pi w)`` for
    the half map), all 2N multipliers of the ring, and a label at each one off the band.

    Parameters
    ----------
    breather : Orbit
    sites : int, optional
        Length of the ring; that of the breather's own lattice, or 400 on the infinite chain.
    half : bool
        Those of the half map QS instead of (QS)^2: there +1 is a pitchfork and -1 a fold.
    digits : int
        Decimals of the labels.
    ax : matplotlib Axes, optional
        A new figure of the width of a journal column unless given.

    Returns
    -------
    Drawn
        The artists, with their ``axes`` and ``figure``.

    Examples
    --------
    >>> import contbreather as cb
    >>> ax = plot_multipliers(cb.symmetric(0.8, 0.045, 0.8), half=True).axes
    >>> sorted(word.get_text() for word in ax.texts if word.get_text())
    ['0.6158', '1.0628']
    """
    if not hasattr(breather, "multipliers") or isinstance(breather, type):
        raise BadInput(f"a breather was expected, got {kind_of(breather)}")
    whole("digits", digits, 0)
    own = breather.lattice.sites
    if sites is None and own is None:
        sites = 400
    mu = np.asarray(breather.multipliers(sites=sites, half=half))
    spring = float(getattr(breather, "spring", 0.0))
    edge = math.sqrt(4.0 * breather.gamma + spring) * (1.0 if half else 2.0)
    alone = off_the_band(mu, edge, sites or own or 1)
    with drawing(ax, height=8.5) as drawn:
        axes = drawn.axes
        _circle_and_band(axes, edge)
        _dots(axes, mu, alone)
        _frame(axes, mu, half)
        labels = Labels(axes)
        labels.avoid(*_circle())
        narrow = axes.bbox.width / labels.pixel < NARROW
        for one in mu[alone]:
            labels.avoid(one.real, one.imag)
            labels.announce(one.real, one.imag)
        named = mu[alone & (mu.imag >= 0.0)]
        for one in named[np.argsort(np.abs(np.abs(named) - 1.0))]:  # the tightest place first
            colour = VERMILLION if abs(one) > 1.0 else "black"
            text = _number(one, digits, "\n" if narrow else " ")
            labels.place(one.real, one.imag, text, fontsize="small", color=colour)
    return drawn


def _dots(ax: Axes, mu: Array, alone: NDArray[np.bool_]) -> None:
    outside = np.abs(mu) > 1.0
    for which, colour in ((~alone, BLUE), (alone & ~outside, BLUE), (alone & outside, VERMILLION)):
        ax.plot(mu[which].real, mu[which].imag, "o", color=colour, markersize=1.6, zorder=3)


def _circle(low: float = -math.pi, high: float = math.pi) -> tuple[Array, Array]:
    angle = np.linspace(low, high, 361)
    return np.cos(angle), np.sin(angle)


def _circle_and_band(ax: Axes, edge: float) -> None:
    ax.plot(*_circle(), color=GREY, linewidth=0.6, zorder=1)
    for sign in (-1.0, 1.0):
        band = _circle(0.0, sign * math.pi * edge)
        ax.plot(*band, color=SKY, linewidth=5.0, alpha=0.5, zorder=2, solid_capstyle="butt")
    ax.axhline(0.0, color=GREY, linewidth=0.3, zorder=0)
    ax.axvline(0.0, color=GREY, linewidth=0.3, zorder=0)


def off_the_band(mu: Array, edge: float, sites: int) -> NDArray[np.bool_]:
    """Multipliers that stand off the arcs of the band by more than a ring's ripple."""
    angle = np.minimum(np.abs(np.angle(mu)), math.pi * edge)
    nearest = np.exp(1j * angle)
    upper = mu.real + 1j * np.abs(mu.imag)
    return np.asarray(np.abs(upper - nearest) > max(0.01, ALONE / sites))


def _frame(ax: Axes, mu: Array, half: bool) -> None:
    reach = 1.1 * max(1.15, float(np.abs(mu).max()))
    name, ticks = r"$\mu$" if half else r"$\mu^2$", [-1, 0, 1]
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xticks=ticks, yticks=ticks)
    ax.set(xlabel=f"Re {name}", ylabel=f"Im {name}")


def _number(mu: complex, digits: int, space: str) -> str:
    text = f"{mu.real:.{digits}f}"
    if mu.imag != 0.0:
        text += f"{space}\N{PLUS-MINUS SIGN} {abs(mu.imag):.{digits}f}i"
    return text.replace("-", "\N{MINUS SIGN}")
