"""Fig. 2: zones of existence and stability, the exact lines beside those of the paper's rule."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from contbreather.checks import row
from contbreather.continuation import trace
from contbreather.errors import partial_result
from contbreather.orbits import neimark_sacker as exact_event
from contbreather.orbits import symmetric
from contbreather.orbits.zone_diagram import Zones
from contbreather.orbits.zones import zones
from contbreather.paper import threshold as rule
from contbreather.paper.threshold import ThresholdLine
from contbreather.plotting.canvas import new_figure, style
from contbreather.plotting.labels import place_words
from contbreather.plotting.zones import LINES, draw_panels, explain, names_of_meetings
from contbreather.stability.verdict import THRESHOLD

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RESTITUTIONS = (0.8, 0.4)
# Between the parameters of the two panels of a figure: name, gamma from, gamma to, a.
TRANSITIONS = (("Fig. 3", 0.09, 0.11, 0.2), ("Fig. 4", 0.05, 0.045, 0.8))


@dataclass(frozen=True, eq=False)
class Figure2:
    """What Fig. 2 shows: for each k the exact zones and the lines of the paper's rule."""

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
            for gamma, a, angle in zip(line.gamma, line.a, line.angle, strict=True):
                yield {
                    "k": line.k,
                    "curve": f"{line.kind}-rule",
                    "gamma": float(gamma),
                    "a": float(a),
                    "nu": float(angle),
                    "sites": line.sites,
                    "threshold": line.threshold,
                }

    def draw(self) -> Figure:
        """The figure, one panel for each k."""
        with style():
            height = 1.6 + 5.8 * len(self.zones)
            figure, panels = new_figure(len(self.zones), height=height)
            draw_panels(self.zones, panels)
            for diagram, panel in zip(self.zones, panels, strict=True):
                self._rule(panel, diagram.fixed[1])
            explain(panels, figure)
            for diagram, panel in zip(self.zones, panels, strict=True):
                words = names_of_meetings(diagram)
                if diagram.fixed == ("k", 0.8):
                    words += [_arrow(panel, *transition) for transition in TRANSITIONS]
                place_words(panel, words, fontsize="small")
        return figure

    def _rule(self, ax: Axes, k: float) -> None:
        """The rule's Neimark-Sacker line; its pitchfork line lies under the exact one."""
        for line in self.lines:
            if line.k == k and line.kind == "NS":
                name = f"NS by the paper's rule, N = {line.sites}"
                look = {**LINES[line.kind], "linestyle": (0, (1, 1.4)), "label": name}
                ax.plot(line.gamma, line.a, **look)


def _arrow(ax: Axes, name: str, start: float, end: float, a: float) -> tuple[float, float, str]:
    """From one panel of a figure to the other; its name is still to be placed."""
    ax.plot(start, a, ".", color="black", markersize=3, zorder=5)
    ax.plot([start, end], [a, a], color="black", linewidth=0.8, zorder=5)
    head = "<" if end < start else ">"
    ax.plot(end, a, head, color="black", markersize=3, zorder=5)
    return max(start, end), a, name


@partial_result()
def figure2(
    restitutions: Sequence[float] = RESTITUTIONS,
    *,
    sites: int = rule.SITES,
    threshold: float = THRESHOLD,
    points: int = 100,
    progress: bool | None = None,
) -> Figure2:
    """Fig. 2 of the paper: (a) k = 0.8, (b) k = 0.4.

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

    Returns
    -------
    Figure2
        ``.draw()`` gives the matplotlib figure.

    Examples
    --------
    >>> [(line.kind, line.sites) for line in figure2((0.4,), points=5).lines]
    [('NS', 400), ('PF', 400)]
    """
    restitutions = row("restitutions", restitutions, "restitution coefficients").tolist()
    exact = tuple(zones(k=k, progress=progress) for k in restitutions)
    lines = []
    for diagram in exact:
        k = diagram.fixed[1]
        lines.append(rule.neimark_sacker_line(k, sites=sites, threshold=threshold, points=points))
        for branch in diagram.curves["PF"]:
            gamma = branch["gamma"][branch["gamma"] > 0.0]
            lines.append(rule.pitchfork_line(k, gamma, sites=sites, threshold=threshold))
    return Figure2(exact, tuple(lines))


@partial_result()
def chain_lengths(
    a: float = 0.2,
    k: float = 0.8,
    sites: Sequence[int] = (200, 400, 800),
    *,
    threshold: float = THRESHOLD,
) -> dict[str, float]:
    """The Neimark-Sacker coupling by the paper's rule for several rings, and the exact one.

    Returns
    -------
    dict
        ``{"200": gamma, ..., "rule, N to infinity": gamma, "exact": gamma}``. The rule's own limit
        is the point at which the isolated pair of the infinite chain passes the threshold, not the
        point at which it comes out.

    Examples
    --------
    >>> {name: round(gamma, 5) for name, gamma in chain_lengths(sites=(200, 400)).items()}
    {'200': 0.08241, '400': 0.09155, 'rule, N to infinity': 0.09761, 'exact': 0.09697}
    """
    gammas = {str(n): rule.neimark_sacker(a, k, sites=n, threshold=threshold).gamma for n in sites}
    limit = rule.neimark_sacker(a, k, sites=None, threshold=threshold).gamma
    start = symmetric(a, 0.5 * min(gammas.values(), default=limit), k)
    branch = trace(
        start, "gamma", within={"gamma": (0.0, 0.24)}, towards="up",
        events=[exact_event()], progress=False,
    )  # fmt: skip
    return {**gammas, "rule, N to infinity": limit, "exact": branch.first("NS")["gamma"]}
