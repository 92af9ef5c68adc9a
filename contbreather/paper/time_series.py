"""Figs. 5 to 8: the exact breather beside simulations of small rings, with what becomes of them.

The paper's runs: N = 20 sites, smooth walls (21) with lambda of k = 0.8, damping mu = 0.005,
F = -a cos t. Each figure is drawn as printed and carries our verdict: which run is an attractor,
which a transient and for how long, and what m and damping it needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.orbits.closed_form import symmetric
from contbreather.orbits.constructors import asymmetric
from contbreather.orbits.orbit import Orbit
from contbreather.paper import lifetimes
from contbreather.paper.lifetimes import DAMPING, SITES, keywords_of, life, lives, on_ring
from contbreather.plotting.canvas import BLUE, CYCLE, VERMILLION, legend_above, new_figure, style
from contbreather.plotting.orbits import PERIODS as TIME
from contbreather.simulation.classify import BROAD, classify
from contbreather.simulation.integrator import Sample
from contbreather.simulation.measures import localised
from contbreather.simulation.periodic import periodic
from contbreather.simulation.simulate import completed, simulate, simulate_smooth
from contbreather.simulation.states import PERIOD
from contbreather.simulation.sweep import sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESTITUTION = 0.8
HARDNESS = 6  # "for m > 5 the simulation results ceased to depend on the exact choice of m"
SHOWN = (0, 1, 10)
CENTRAL = (-2, -1, 0, 1, 2)
CIRCLES = 32  # in a period
APART = 2.2  # between the lines of two sites in one panel
LOOKS: dict[str, dict[str, Any]] = {
    "line": {"color": VERMILLION},
    "dashed": {"linestyle": "--", "color": BLUE, "linewidth": 0.9},
    "circles": {"linestyle": "", "marker": "o", "color": "black", "markerfacecolor": "none",
                "markersize": 2.6, "markeredgewidth": 0.5},
    "points": {"linestyle": "", "marker": ".", "color": BLUE, "markersize": 0.9, "label": None},
    "trace": {"linewidth": 0.25, "rasterized": True, "label": None},  # in the colour of its site
}  # fmt: skip


class SampledCurve(NamedTuple):
    """Line or row of circles: u over t in periods, or v over u in a section."""

    name: str
    site: int
    t: NDArray[Any]
    u: NDArray[Any]
    style: str = "line"  # one of `LOOKS`


class Panel(NamedTuple):
    """Curves of one style in one pair of axes; a mark says where the breather is lost."""

    title: str
    curves: tuple[SampledCurve, ...]
    labels: tuple[str, str] = (TIME, "$u$")
    lost: float | None = None


@dataclass(frozen=True, eq=False)
class TimeSeries:
    """A figure of Section IV.

    Attributes
    ----------
    number : int
    panels : tuple of Panel
    caption : str
        What is drawn, and what we find.
    numbers : dict
        What we find, measured when the figure was made.
    """

    number: int
    panels: tuple[Panel, ...]
    caption: str
    numbers: dict[str, float] = field(default_factory=dict)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Points drawn: panel, curve, site, and the two coordinates."""
        for letter, panel in zip("abcdef", self.panels, strict=False):
            for name, site, times, values, _ in panel.curves:
                for t, u in zip(times.tolist(), values.tolist(), strict=True):
                    yield {"panel": letter, "curve": name, "site": site, "t": t, "u": u}

    def draw(self) -> Figure:
        """Panels below each other, as printed; lines over one stretch of time share its axis."""
        spans = [
            (panel.labels[0], *panel.curves[0].t[[0, -1]], panel.curves[0].style)
            for panel in self.panels
        ]
        shared = [upper == lower and lower[-1] == "line" for upper, lower in pairwise(spans)]
        shared.append(False)
        with style():
            figure, axes = new_figure(
                len(self.panels), height=sum(2.9 if above else 3.9 for above in shared)
            )
            for ax, letter, panel, above in zip(axes, "abcdef", self.panels, shared, strict=False):
                _draw(ax, panel)
                ax.set_title(f"({letter}) {panel.title}".rstrip(), loc="left", pad=3)
                ax.set(xlabel="" if above else panel.labels[0], ylabel=panel.labels[1])
                ax.tick_params(labelbottom=not above)
            if axes[0].get_legend_handles_labels()[0]:
                legend_above(axes[0], handletextpad=0.4, columnspacing=1.0)
            figure.align_ylabels()
        return figure


def _draw(ax: Any, panel: Panel) -> None:
    for name, site, t, u, look in panel.curves:
        own = {"label": name, "color": CYCLE[abs(site) % len(CYCLE)]}
        ax.plot(t, u, **{**own, **LOOKS[look]})
    ax.locator_params(axis="x", nbins=7)
    looks = {curve.style for curve in panel.curves}
    if "trace" in looks:
        sites = [curve.site for curve in panel.curves]
        ax.set_yticks([APART * n for n in sites], [f"${n}$" for n in sites])
    if looks & {"trace", "circles"}:
        ax.margins(x=0.0 if "trace" in looks else 0.01)
    if panel.lost:
        ax.axvline(panel.lost, color="black", linewidth=0.8, linestyle="--")


# --- runs, beside exact breathers -----------------------------------------------------------------


def _run(start: Any, m: int | None = None, **on: Any) -> Any:
    """A run to its end, between smooth walls of that hardness or rigid ones."""
    return completed(simulate(start, **on) if m is None else simulate_smooth(start, m=m, **on))


def _against(orbits: dict[str, Orbit], run: Any, m: int) -> tuple[Panel, ...]:
    """Panels of sites 0, 1 and 10: lines of exact breathers through circles of a dense record."""
    times, gap = run.record.times, run.record.times[1] - run.record.times[0]
    fine = np.linspace(times[0], times[-1] + gap, 1200)
    step = max(1, round(PERIOD / gap / CIRCLES))
    panels = []
    for n in SHOWN:
        u = run.record.u[:, run.record.sites.index(n % run.sites)]
        lines = [
            SampledCurve(name, n, fine / PERIOD, orbit.displacement(n, fine), look)
            for look, (name, orbit) in zip(("line", "dashed"), orbits.items(), strict=False)
        ]
        ring = SampledCurve(f"ring, $m = {m}$", n, times[::step] / PERIOD, u[::step], "circles")
        panels.append(Panel("", (*lines, ring), (TIME, f"$u_{{{n}}}$")))
    return tuple(panels)


# --- the figures ----------------------------------------------------------------------------------


def figure5(m: int = HARDNESS) -> TimeSeries:
    """Fig. 5: the breather at a = 0.1, gamma = 0.08 as an attractor of the smooth, damped ring.

    Examples
    --------
    >>> found = figure5()
    >>> round(found.numbers["difference_0"], 3), round(found.numbers["difference_1"], 4)
    (0.098, 0.0104)
    """
    a, gamma, m = 0.1, 0.08, whole("m", m, 1)
    exact, settling = symmetric(a, gamma, RESTITUTION), 400
    on = keywords_of(exact)
    v = np.zeros(SITES)
    v[0] = 3.0  # the start of the paper; all else zero
    final = _run((np.zeros(SITES), v), m, periods=settling, **on).final
    orbit = periodic(final, m=m, symmetric=True, **on)
    circles, settled = (
        _run(state, m, periods=2, sample=Sample(SHOWN, n), **on)
        for state, n in ((final, CIRCLES), (orbit.state, 400))
    )
    t, gaps = settled.record.times, {}
    for n, u in zip(SHOWN, settled.record.u.T, strict=True):
        gaps[f"difference_{n}"] = float(np.abs(u - exact.displacement(n, t)).max())
    numbers = {
        **gaps,
        "away": float(np.abs(np.subtract(final, orbit.state)).max()),
        "smooth_multiplier": orbit.largest,
        "rigid_multiplier": on_ring(exact).largest,
        "undamped_multiplier": float(np.abs(exact.multipliers(sites=SITES)).max()),
    }
    caption = (
        f"Exact breather of the infinite chain (lines) and the ring of {SITES} sites with smooth "
        f"walls, m = {m}, {settling} periods after the paper's start (circles): a = {a}, "
        f"k = {RESTITUTION}, gamma = {gamma}, damping {DAMPING}. Verdict: an attractor, with this "
        "damping: largest multiplier {smooth_multiplier:.4f} (rigid walls: "
        "{rigid_multiplier:.4f}; without damping {undamped_multiplier:.4f}, unstable). The circles "
        "are within {away:.1g} of the ring's own periodic motion. That motion differs from the "
        "exact one by {difference_0:.3f} in u_0, for the soft wall holds the site for a while, "
        "{difference_1:.4f} in u_1, {difference_10:.4f} in u_10."
    ).format(**numbers)
    return TimeSeries(5, _against({"exact": exact}, circles, m), caption, numbers)


def figure6(m: int = HARDNESS) -> TimeSeries:
    """Fig. 6: three breathers at gamma = 0.104, started on the exact solution; all are lost.

    Examples
    --------
    >>> found = figure6()
    >>> [round(found.numbers[f"rigid_multiplier_{a}"], 4) for a in (0.1, 0.7)]
    [1.0325, 1.0393]
    """
    gamma, m = 0.104, whole("m", m, 1)
    panels: list[Panel] = []
    numbers: dict[str, float] = {}
    caption = (
        f"Five central sites of the ring of {SITES} with smooth walls (m = {m}), started on the "
        f"exact solution at gamma = {gamma}, k = {RESTITUTION}, damping {DAMPING}; dashed: the "
        "breather is lost, site 0 misses a wall or a neighbour comes to one. Verdict: transients, "
        "all three; on long rings (a) and (c) are attractors, for no wave comes round. A life "
        "grows with the logarithm of how exact the start is; what counts is the largest multiplier."
    )
    for letter, (a, periods) in zip("abc", {0.1: 600, 0.2: 160, 0.7: 160}.items(), strict=True):
        exact = symmetric(a, gamma, RESTITUTION)
        record = {"sample": Sample(CENTRAL, 24), "periods": periods}
        run = _run(exact.state(SITES), m, **record, **keywords_of(exact))
        stats = lives(exact, m, life(run))
        t, lost = run.record.times / PERIOD, stats["lost"]
        curves = tuple(
            SampledCurve(f"u_{n}", n, t, u + APART * n, "trace")
            for n, u in zip(CENTRAL, run.record.u.T, strict=True)
        )
        mark = None if math.isnan(lost) else lost
        panels.append(Panel(f"$a = {a}$: {lifetimes.gone(lost)}", curves, (TIME, "site $n$"), mark))
        caption += f" ({letter}) a = {a}: {lifetimes.lives_in_words(stats, m)}"
        numbers |= {f"{name}_{a}": value for name, value in stats.items()}
    return TimeSeries(6, tuple(panels), caption, numbers)


def figure7(m: int = 20) -> TimeSeries:
    """Fig. 7: past the pitchfork, a = 0.82, gamma = 0.04, the breather that settles is asymmetric.

    Examples
    --------
    >>> found = figure7()
    >>> round(abs(found.numbers["mean_0"]), 3)
    0.028
    """
    low, a, gamma, m = 0.7, 0.82, 0.04, whole("m", m, 1)
    exact = symmetric(a, gamma, RESTITUTION)
    on = keywords_of(exact)
    start, values = symmetric(low, gamma, RESTITUTION).state(SITES), np.linspace(low, a, 121)
    ramp = completed(sweep(start, "a", values, periods=2, m=m, **on))
    rested = _run(ramp.final, m, periods=500, **on).final
    settled = _run(rested, m, periods=2, sample=Sample(SHOWN, 8 * CIRCLES), **on)
    mean = settled.record.u.mean(axis=0).tolist()
    closed = periodic(_run(exact.state(SITES), periods=3000, **on).final, **on)
    first, second = np.sort(completed(closed.run()).impacts["phase"]).tolist()
    # of the two images the one that the ring has come to
    arm = asymmetric(a, gamma, RESTITUTION, arm=1 if mean[0] > 0.0 else -1)
    (u, v), t, conditions = settled.final, settled.end, settled.conditions
    everywhere = float(localised(u, v, t, conditions).participation) > BROAD
    numbers = {
        "mean_0": mean[0],
        "mean_10": mean[2],
        "exact_c": abs(arm.c),
        "phase_1": first,
        "phase_2": second,
        "rigid_multiplier": closed.largest,
        "symmetric_multiplier": on_ring(exact).largest,
        "delocalised": float(everywhere),
    }
    fate = f"the asymmetric breather: mean of u_0 {mean[0]:.4f}, of u_10 {mean[2]:.4f}"
    if everywhere:
        fate = "this ramp ends delocalised, impacts are everywhere"
    caption = (
        f"Past the pitchfork: a = {a}, gamma = {gamma}, k = {RESTITUTION}. Lines: exact symmetric "
        "breather, unstable. Dashed: exact asymmetric one, without damping (mean of u_0 "
        f"{{exact_c:.4f}} or its opposite). Circles: ring of {SITES} with smooth walls, m = {m}, "
        f"damping {DAMPING}, after a ramp of a from {low} and 500 periods. Verdict: {fate}. "
        "With rigid walls an attractor, largest multiplier {rigid_multiplier:.5f} (the symmetric "
        "breather: {symmetric_multiplier:.4f}), impact phases {phase_1:.6f} and {phase_2:.6f}."
    ).format(**numbers)
    lines = {"exact": exact} | ({} if everywhere else {"asymmetric": arm})
    return TimeSeries(7, _against(lines, settled, m), caption, numbers)


def figure8(m: int = HARDNESS) -> TimeSeries:
    """Fig. 8: beyond Neimark-Sacker, a = 0.15, gamma = 0.104: a transient; and a genuine torus.

    Examples
    --------
    >>> found = figure8()
    >>> round(found.numbers["rotation"], 5)
    0.3916
    """
    a, gamma, m = 0.15, 0.104, whole("m", m, 1)
    exact = symmetric(a, gamma, RESTITUTION)
    on = keywords_of(exact)
    long = _run(exact.state(SITES), m, periods=250, sample=Sample(CENTRAL, 24), **on)
    lost = life(long)
    first = max(0, (lost or 250) - 40)
    there = long.strobe.u[first], long.strobe.v[first]
    window = _run(there, m, periods=6, sample=Sample(SHOWN, CIRCLES // 2), **on)
    stats = lives(exact, m, lost)
    wandering = symmetric(a, 0.106, RESTITUTION)  # where, with more damping, a torus attracts
    damping = 0.02
    torus = classify(
        wandering.state(SITES), settle=8000, periods=3000, **keywords_of(wandering, damping)
    )
    evidence = {name: float(value) for name, value in torus.evidence.items()}
    zero = max(abs(evidence["exponent"]), evidence["exponent_error"])
    caption = (
        f"(a) to (c): a = {a}, gamma = {gamma}, k = {RESTITUTION}, damping {DAMPING}, beyond the "
        f"Neimark-Sacker line. Lines: exact breather, unstable. Circles: ring of {SITES} with "
        f"smooth walls, m = {m}, {first} periods after its start on the exact solution. "
        f"Verdict: a transient, {lifetimes.lives_in_words(stats, m)} (d) A genuine quasi-periodic "
        f"breather, rigid walls, N = {SITES}, damping {damping}, gamma = {wandering.gamma}, "
        f"a = {a}: stroboscopic section of site 0, rotation number {evidence['rotation']:.8f}, "
        f"largest Lyapunov exponent zero to {zero:.0e}."
    )
    u, v = torus.run.strobe
    dots = (SampledCurve("section", 0, u[:, 0], v[:, 0], "points"),)
    section = Panel(f"rigid walls, damping {damping}: a torus", dots, ("$u_0$", r"$\dot u_0$"))
    panels = (*_against({"exact": exact}, window, m), section)
    return TimeSeries(8, panels, caption, {**stats, **evidence})
