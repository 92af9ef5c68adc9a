"""Figs. 2 to 4: zones with the lines of the paper's rule, multipliers beside two bifurcations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from contbreather.checks import row
from contbreather.errors import partial_result
from contbreather.orbits.closed_form import symmetric
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.zone_diagram import Zones
from contbreather.orbits.zones import zones
from contbreather.paper import threshold as rule
from contbreather.paper.threshold import SITES, ThresholdLine
from contbreather.plotting import canvas
from contbreather.plotting.canvas import BLUE, GREY, SKY, VERMILLION, new_figure, style
from contbreather.plotting.multipliers import draw_multipliers, name_multipliers
from contbreather.plotting.zones import LINES, draw_panels, explain, names_of_meetings
from contbreather.stability.verdict import THRESHOLD

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Between the parameters of the two panels of a figure: name, gamma from, gamma to, a.
TRANSITIONS = (("Fig. 3", 0.09, 0.11, 0.2), ("Fig. 4", 0.05, 0.045, 0.8))


@dataclass(frozen=True, eq=False)
class Figure2:
    """Content of Fig. 2: for each k the exact zones and the lines of the paper's rule."""

    zones: tuple[Zones, ...]
    lines: tuple[ThresholdLine, ...]

    @property
    def caption(self) -> str:
        line = self.lines[0]
        return (
            "Existence (fold LP, grazing GR) and stability (pitchfork PF, Neimark-Sacker NS) of "
            "the symmetric breather, exact for the infinite chain. Dotted: the paper's rule, "
            f"largest multiplier over 2 pi beyond {line.threshold:g} on a ring of {line.sites} "
            "sites (its pitchfork line cannot be distinguished from the exact one). "
            "S and US: no multiplier, some multipliers of QS outside the unit circle (infinite "
            "chain). Arrows: from panel (a) to panel (b) of Figs. 3 and 4."
        )

    def rows(self) -> Iterator[dict[str, Any]]:
        """Points of the dotted lines, in order: k, curve, gamma, a, and the rule."""
        for line in self.lines:
            for gamma, a, angle in np.array((line.gamma, line.a, line.angle)).T.tolist():
                yield {"k": line.k, "curve": f"{line.kind}-rule", "gamma": gamma, "a": a,
                       "nu": angle, "sites": line.sites, "threshold": line.threshold}  # fmt: skip

    def draw(self) -> Figure:
        with style():
            figure, panels = new_figure(len(self.zones), height=1.6 + 5.8 * len(self.zones))
            draw_panels(self.zones, panels)
            for diagram, panel in zip(self.zones, panels, strict=True):
                for line in self.lines:  # the rule's pitchfork line lies under the exact one
                    if line.k == diagram.fixed[1] and line.kind == "NS":
                        name = f"NS by the paper's rule, N = {line.sites}"
                        look = {**LINES["NS"], "linestyle": (0, (1, 1.4)), "label": name}
                        panel.plot(line.gamma, line.a, **look)
            explain(panels, figure)
            pixel = canvas.lay_out(panels[0])
            for diagram, panel in zip(self.zones, panels, strict=True):
                words = names_of_meetings(diagram)
                for name, start, end, a in TRANSITIONS if diagram.fixed == ("k", 0.8) else ():
                    look = {"color": "black", "markersize": 3, "zorder": 5}
                    panel.plot(start, a, ".", **look)
                    panel.plot([start, end], [a, a], linewidth=0.8, **look)
                    panel.plot(end, a, "<" if end < start else ">", **look)
                    words.append((max(start, end), a, name))
                canvas.place_words(panel, pixel, ((*word, {}) for word in words))
        return figure


@partial_result()
def figure2(
    restitutions: Sequence[float] = (0.8, 0.4),
    *,
    sites: int = SITES,
    threshold: float = THRESHOLD,
    points: int = 100,
    progress: bool | None = None,
) -> Figure2:
    """Fig. 2 of the paper: (a) k = 0.8, (b) k = 0.4; ``.draw()`` gives the matplotlib figure.

    Parameters
    ----------
    restitutions : sequence of float
        One panel each.
    sites, threshold : int, float
        The paper's rule: N = 400 and 1.005.
    points : int
        On each line of the rule.
    progress : bool, optional
        As for `trace`.

    Examples
    --------
    >>> [(line.kind, line.sites) for line in figure2((0.4,), points=5).lines]
    [('NS', 400), ('PF', 400)]
    """
    restitutions = row("restitutions", restitutions, "restitution coefficients").tolist()
    exact = tuple(zones(k=k, progress=progress) for k in restitutions)
    on: Any = {"sites": sites, "threshold": threshold}
    lines = []
    for diagram, k in zip(exact, restitutions, strict=True):
        lines.append(rule.neimark_sacker_line(k, points=points, **on))
        for branch in diagram.curves["PF"]:
            gamma = branch["gamma"][branch["gamma"] > 0.0]
            lines.append(rule.pitchfork_line(k, gamma, **on))
    return Figure2(exact, tuple(lines))


# --- Figs. 3 and 4 --------------------------------------------------------------------------------


@dataclass(frozen=True)
class MultiplierFigure:
    """Two breathers, one on each side of a bifurcation, and the ring their multipliers are of."""

    number: int
    bifurcation: str
    breathers: tuple[Orbit, Orbit]
    sites: int = SITES
    threshold: float = THRESHOLD
    digits: int = 3

    @property
    def caption(self) -> str:
        before, after = self.breathers
        beyond = " and ".join(
            f"({letter})"
            for letter, breather in zip("ab", self.breathers, strict=True)
            if any(abs(mu) ** 2 - 1.0 >= self._top for mu in breather.stability().multipliers)
        )
        return (
            f"Multipliers around the {self.bifurcation}: a = {before.a:g}, k = {before.k:g}, "
            f"(a) gamma = {before.gamma:g}, (b) gamma = {after.gamma:g}. Above: all "
            f"{2 * self.sites} eigenvalues of the monodromy matrix (QS)^2 on a ring of "
            f"{self.sites} sites; bars: band of the infinite chain. Below: by how much their "
            "moduli exceed 1, against the angle of mu, the eigenvalues of QS. Dashed: the paper's "
            f"threshold {self.threshold:g}"
            + f"; arrow in {beyond}: the isolated multiplier of the infinite chain (exact), "
            "which is beyond the axis" * bool(beyond) + "."
        )

    @property
    def _top(self) -> float:
        return 2.4 * (self.threshold - 1.0)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Multipliers of QS, and their squares, largest first."""
        for panel, breather in zip("ab", self.breathers, strict=True):
            on = {"panel": panel, "a": breather.a, "gamma": breather.gamma, "k": breather.k}
            half = np.asarray(breather.multipliers(sites=self.sites, half=True), dtype=complex)
            for mu in half[np.argsort(-np.abs(half), kind="stable")].tolist():
                full = mu * mu
                yield on | {"half_re": mu.real, "half_im": mu.imag, "full_re": full.real,
                            "full_im": full.imag, "modulus": abs(full)}  # fmt: skip

    def draw(self) -> Figure:
        """The figure: panels (a) and (b) side by side, multipliers above, moduli below."""
        with style():
            figure, axes = new_figure(2, 2, height=9.8)
            found = []
            panels = zip("ab", self.breathers, axes[:2], axes[2:], strict=True)
            for letter, breather, above, below in panels:
                found.append((above, *draw_multipliers(above, breather, self.sites)))
                above.set_title(rf"({letter}) $\gamma$ = {breather.gamma:g}", loc="left", pad=3)
                self._moduli(below, breather)
            for right in (axes[1], axes[3]):
                right.set_ylabel("")
                right.tick_params(labelleft=False)
            for drawn in found:
                name_multipliers(*drawn, self.digits)
        return figure

    def _moduli(self, ax: Axes, breather: Orbit) -> None:
        """Excess of the moduli over one, against the angle in the half map: the band's ripple."""
        mu = np.asarray(breather.multipliers(sites=self.sites, half=True))
        mu, verdict = mu[mu.imag >= 0.0], breather.stability()
        excess = 1e3 * (np.abs(mu) ** 2 - 1.0)
        limit, top = 1e3 * (self.threshold - 1.0), 1e3 * self._top
        ax.set_ylim(-0.4 * top, top)
        ax.set_xlim(-0.03, 1.03)
        ax.set_xticks([0.0, 0.5, 1.0], ["0", "0.5", "1"])  # short, for the panels stand close
        ax.set_yticks([0.0, limit, 2.0 * limit])
        ax.axvspan(0.0, 2.0 * math.sqrt(breather.gamma), color=SKY, alpha=0.25, linewidth=0)
        ax.axhline(0.0, color=GREY, linewidth=0.5)
        ax.axhline(limit, color="black", linewidth=0.8, linestyle="--")
        for which, colour in ((excess <= limit, BLUE), (excess > limit, VERMILLION)):
            ax.plot(np.angle(mu[which]) / math.pi, excess[which], "o", color=colour, markersize=1.6)
        ax.set_xlabel(r"angle of $\mu$ over $\pi$")
        ax.set_ylabel(r"$10^3\,(|\mu^2| - 1)$")
        word = "stable" if verdict.stable else "unstable"
        ax.set_title(f"infinite chain: {word}", loc="left", pad=3, fontsize="small")
        for isolated in verdict.multipliers[verdict.multipliers.imag >= 0.0]:
            angle, height = np.angle(isolated) / math.pi, 1e3 * (abs(isolated) ** 2 - 1.0)
            if height < top:
                ax.plot(angle, height, "x", color="black", markersize=4)
                continue
            side, aligned = (6, "left") if angle < 0.5 else (-6, "right")
            ax.annotate(  # the number that an arrow beyond the axes points to
                f"{height:.1f}", (angle, top), (side, -9), textcoords="offset points",
                ha=aligned, va="center", fontsize="small",
            )  # fmt: skip
            ax.annotate(
                "", (angle, 0.99 * top), (angle, 0.8 * top),
                arrowprops={"arrowstyle": "-|>", "color": VERMILLION, "linewidth": 1.0,
                            "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7},
            )  # fmt: skip


def figure3() -> MultiplierFigure:
    """Fig. 3: through the Neimark-Sacker line, a = 0.2, k = 0.8, gamma = 0.09 and 0.11.

    Examples
    --------
    >>> [b.stability().unstable for b in figure3().breathers]
    [0, 2]
    """
    pair = (symmetric(0.2, 0.09, 0.8), symmetric(0.2, 0.11, 0.8))
    return MultiplierFigure(3, "Neimark-Sacker bifurcation", pair, digits=2)


def figure4() -> MultiplierFigure:
    """Fig. 4: through the pitchfork, a = 0.8, k = 0.8, gamma = 0.05 and 0.045.

    Examples
    --------
    >>> [b.stability().unstable for b in figure4().breathers]
    [0, 1]
    """
    pair = (symmetric(0.8, 0.05, 0.8), symmetric(0.8, 0.045, 0.8))
    return MultiplierFigure(4, "pitchfork bifurcation", pair)
