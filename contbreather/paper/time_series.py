"""Figs. 5 to 8: the exact breather beside simulations of small rings, with what becomes of them.

The paper's runs: N = 20 sites, smooth walls (21) with lambda of k = 0.8, damping mu = 0.005,
F = -a cos t. Each figure is drawn as printed and carries our verdict: which run is an attractor,
which a transient and for how long, and what m and damping it needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import whole
from contbreather.continuation.trace import trace
from contbreather.orbits.asymmetric_breather import asymmetric_problem
from contbreather.orbits.closed_form import symmetric
from contbreather.orbits.green_function import ACROSS
from contbreather.orbits.orbit import Orbit, orbit_at, orbit_of
from contbreather.orbits.orbit_events import pitchfork
from contbreather.paper.lifetimes import delocalised, gone, life, lives, lives_in_words
from contbreather.plotting.canvas import BLUE, CYCLE, VERMILLION, new_figure, style
from contbreather.simulation.classify import classify
from contbreather.simulation.integrator import Sample
from contbreather.simulation.periodic import PeriodicMotion, periodic
from contbreather.simulation.simulate import (
    SimulationRun,
    SmoothRun,
    completed,
    simulate,
    simulate_smooth,
)
from contbreather.simulation.states import PERIOD, State
from contbreather.simulation.sweep import sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[Any]

SITES = 20
LONG = 120  # sites; a wave that goes round such a ring is damped away
RESTITUTION = 0.8
DAMPING = 0.005
RINGS: dict[str, Any] = {"damping": DAMPING, "sites": SITES, "long": LONG}
HARDNESS = 6  # "for m > 5 the simulation results ceased to depend on the exact choice of m"
SHOWN = (0, 1, 10)
CENTRAL = (-2, -1, 0, 1, 2)
CIRCLES = 32  # in a period


@dataclass(frozen=True, eq=False)
class SampledCurve:
    """One line or row of circles: u over t in periods, or v over u in a section."""

    name: str
    site: int
    t: Array
    u: Array
    style: str = "line"  # one of `LOOKS`


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes."""

    title: str
    curves: tuple[SampledCurve, ...]
    labels: tuple[str, str] = (r"$t/2\pi$", "$u$")
    lost: float | None = None  # where a mark says that the breather is lost


@dataclass(frozen=True, eq=False)
class TimeSeries:
    """A figure of Section IV.

    Attributes
    ----------
    number : int
    panels : tuple of Panel
    shown : str
        What is drawn.
    findings : tuple of str
        What we find, with numbers measured when the figure was made.
    numbers : dict
        The same numbers by name.
    """

    number: int
    panels: tuple[Panel, ...]
    shown: str
    findings: tuple[str, ...]
    numbers: dict[str, float] = field(default_factory=dict)

    @property
    def caption(self) -> str:
        return " ".join((self.shown, *self.findings))

    def rows(self) -> Iterator[dict[str, Any]]:
        """All points drawn: panel, curve, site, and the two coordinates."""
        for letter, panel in zip("abcdef", self.panels, strict=False):
            for curve in panel.curves:
                for t, u in zip(curve.t.tolist(), curve.u.tolist(), strict=True):
                    yield {
                        "panel": letter, "curve": curve.name, "site": curve.site, "t": t, "u": u
                    }  # fmt: skip

    def draw(self) -> Figure:
        """Panels below each other, as printed; those of one time axis share it."""
        ticks = [_same_axis(*pair) for pair in pairwise(self.panels)] + [False]
        height = sum(2.9 if shared else 3.9 for shared in ticks)
        with style():
            figure, axes = new_figure(len(self.panels), height=height)
            for ax, letter, panel, shared in zip(axes, "abcdef", self.panels, ticks, strict=False):
                _draw_panel(ax, panel)
                ax.set_title(f"({letter}) {panel.title}".rstrip(), loc="left", pad=3)
                if shared:
                    ax.set_xlabel("")
                    ax.tick_params(labelbottom=False)
            if axes[0].get_legend_handles_labels()[0]:
                axes[0].legend(  # over the panel, where no data are
                    loc="lower right", bbox_to_anchor=(1.015, 0.965), ncols=3, frameon=False,
                    handlelength=1.3, handletextpad=0.4, columnspacing=1.0,
                )  # fmt: skip
            figure.align_ylabels()
        return figure


def _same_axis(panel: Panel, below: Panel) -> bool:
    """Whether two panels show the same stretch of time, in time series drawn as lines."""
    upper, lower = panel.curves[0], below.curves[0]
    same = panel.labels[0] == below.labels[0] and upper.style == lower.style == "line"
    return same and upper.t[[0, -1]].tolist() == lower.t[[0, -1]].tolist()


LOOKS: dict[str, dict[str, Any]] = {
    "line": {"color": VERMILLION},
    "dashed": {"linestyle": "--", "color": BLUE, "linewidth": 0.9},
    "circles": {"linestyle": "", "marker": "o", "color": "black", "markerfacecolor": "none",
                "markersize": 2.6, "markeredgewidth": 0.5},
    "points": {"linestyle": "", "marker": ".", "color": BLUE, "markersize": 0.9, "label": None},
    "trace": {"linewidth": 0.25, "rasterized": True, "label": None},  # in the colour of its site
}  # fmt: skip


def _draw_panel(ax: Axes, panel: Panel) -> None:
    for curve in panel.curves:
        colour = CYCLE[abs(curve.site) % len(CYCLE)]
        ax.plot(curve.t, curve.u, **{"label": curve.name, "color": colour, **LOOKS[curve.style]})
    ax.set_xlabel(panel.labels[0])
    ax.set_ylabel(panel.labels[1])
    ax.locator_params(axis="x", nbins=7)
    traces = [curve for curve in panel.curves if curve.style == "trace"]
    if traces:
        ax.set_yticks([2.2 * c.site for c in traces], [f"${c.site}$" for c in traces])
        ax.margins(x=0.0)
    if panel.lost:
        ax.axvline(panel.lost, color="black", linewidth=0.8, linestyle="--")
    if any(curve.style == "circles" for curve in panel.curves):
        ax.margins(x=0.01)


# --- what the figures have in common --------------------------------------------------------------


def _against(exact: Orbit, run: SimulationRun | SmoothRun, word: str) -> tuple[Panel, ...]:
    """Panels of sites 0, 1 and 10: the exact line through the circles of a dense record."""
    assert run.record is not None
    times, sites = run.record.times, run.record.sites
    gap = times[1] - times[0]
    fine = np.linspace(times[0], times[-1] + gap, 1200)
    step = max(1, round(PERIOD / gap / CIRCLES))
    panels = []
    for n in SHOWN:
        u = run.record.u[:, sites.index(n % run.sites)]
        line = SampledCurve("exact", n, fine / PERIOD, exact.displacement(n, fine))
        circles = SampledCurve(word, n, times[::step] / PERIOD, u[::step], "circles")
        panels.append(Panel("", (line, circles), (r"$t/2\pi$", f"$u_{{{n}}}$")))
    return tuple(panels)


def _differences(exact: Orbit, run: SimulationRun | SmoothRun) -> dict[int, float]:
    """Largest |simulated - exact| of each site shown, over one recorded period."""
    assert run.record is not None
    times = run.record.times
    return {
        n: float(np.abs(run.record.u[:, i] - exact.displacement(n, times)).max())
        for i, n in enumerate(SHOWN)
    }


def _after_a_shift(exact: Orbit, run: SmoothRun) -> tuple[float, float]:
    """The difference in u_0 that is left after the best time shift, and that shift."""
    from scipy.optimize import minimize_scalar

    assert run.record is not None
    times, u = run.record.times, run.record.u[:, 0]

    def left(shift: float) -> float:
        moved = np.interp(times - shift, times, u, period=PERIOD)
        return float(np.abs(moved - exact.displacement(0, times)).max())

    shifts = np.linspace(-0.4, 0.4, 81)
    start = shifts[int(np.argmin([left(s) for s in shifts]))]
    best: Any = minimize_scalar(left, bounds=(start - 0.02, start + 0.02), method="bounded")
    return float(best.fun), float(best.x)


def _conditions(a: float, gamma: float, damping: float = DAMPING) -> dict[str, Any]:
    return {"a": a, "gamma": gamma, "k": RESTITUTION, "damping": damping}


def _run(start: Any, m: int | None = None, **on: Any) -> Any:
    """A run to its end, between smooth walls of that hardness or rigid ones."""
    return completed(simulate(start, **on) if m is None else simulate_smooth(start, m=m, **on))


# --- Fig. 5 ---------------------------------------------------------------------------------------

SETTLING = 400  # periods after which the start of the paper has become the breather


def figure5(m: int = HARDNESS) -> TimeSeries:
    """Fig. 5: the breather at a = 0.1, gamma = 0.08 as an attractor of the smooth, damped ring.

    Examples
    --------
    >>> found = figure5()
    >>> round(found.numbers["difference_0"], 3), round(found.numbers["difference_1"], 4)
    (0.098, 0.0104)
    """
    a, gamma, m = 0.1, 0.08, whole("m", m, 1)
    conditions, exact = _conditions(a, gamma), symmetric(a, gamma, RESTITUTION)
    v = np.zeros(SITES)
    v[0] = 3.0  # the start of the paper; all else zero
    transient = _run((np.zeros(SITES), v), m, periods=SETTLING, **conditions)
    orbit = periodic(transient.final, m=m, symmetric=True, **conditions)
    away = float(np.abs(np.subtract(transient.final, orbit.state)).max())
    circles, settled = (
        _run(state, m, periods=2, sample=Sample(SHOWN, n), **conditions)
        for state, n in ((transient.final, CIRCLES), (orbit.state, 400))
    )
    gap, (left, shift) = _differences(exact, settled), _after_a_shift(exact, settled)
    rigid = periodic(exact.state(SITES), symmetric=True, **conditions).largest
    free = float(np.abs(exact.multipliers(sites=SITES)).max())
    numbers = {
        **{f"difference_{n}": gap[n] for n in SHOWN},
        "difference_0_shifted": left,
        "shift": shift,
        "away": away,
        "smooth_multiplier": orbit.largest,
        "rigid_multiplier": rigid,
        "undamped_multiplier": free,
    }
    shown = (
        f"Exact breather of the infinite chain (lines) and the ring of {SITES} sites with smooth "
        f"walls, m = {m}, {SETTLING} periods after the paper's start (circles): a = {a}, "
        f"k = {RESTITUTION}, gamma = {gamma}, damping {DAMPING}."
    )
    findings = (
        f"Verdict: an attractor, with this damping: largest multiplier {orbit.largest:.4f} "
        f"(rigid walls: {rigid:.4f}; without damping {free:.4f}, unstable). The circles are within "
        f"{away:.1g} of the ring's own periodic motion.",
        f"That motion differs from the exact one by {gap[0]:.3f} in u_0 ({left:.3f} once shifted "
        f"in time by {-shift:.3f}: the soft wall holds the site for a while), {gap[1]:.4f} in u_1, "
        f"{gap[10]:.4f} in u_10.",
    )
    return TimeSeries(5, _against(exact, circles, f"ring, $m = {m}$"), shown, findings, numbers)


# --- Fig. 6 ---------------------------------------------------------------------------------------

RUNS6 = ((0.1, 600), (0.2, 160), (0.7, 160))  # amplitude, periods shown


def figure6(m: int = HARDNESS) -> TimeSeries:
    """Fig. 6: three breathers at gamma = 0.104, started on the exact solution; all are lost.

    Examples
    --------
    >>> from contbreather.paper import time_series
    >>> [a for a, _ in time_series.RUNS6]
    [0.1, 0.2, 0.7]
    """
    gamma, m = 0.104, whole("m", m, 1)
    panels, findings = [], []
    numbers: dict[str, float] = {}
    for letter, (a, periods) in zip("abc", RUNS6, strict=True):
        exact, conditions = symmetric(a, gamma, RESTITUTION), _conditions(a, gamma)
        sample = Sample(CENTRAL, 24)
        run = _run(exact.state(SITES), m, periods=periods, sample=sample, **conditions)
        stats = lives(exact, m, life(run), **RINGS)
        panels.append(_traces(run, f"$a = {a}$: {gone(stats['lost'])}", stats["lost"]))
        findings.append(f"({letter}) a = {a}: {lives_in_words(stats, m, LONG)}")
        numbers |= {f"{name}_{a}": value for name, value in stats.items()}
    shown = (
        f"Five central sites of the ring of {SITES} with smooth walls (m = {m}), started on the "
        f"exact solution at gamma = {gamma}, k = {RESTITUTION}, damping {DAMPING}; dashed: the "
        "breather is lost, site 0 misses a wall or a neighbour comes to one."
    )
    verdict6 = (
        "Verdict: transients, all three; on long rings (a) and (c) are attractors, for no wave "
        "comes round. A life grows with the logarithm of how exact the start is; what counts is "
        "the growth in a period, simulated beside the multiplier."
    )
    return TimeSeries(6, tuple(panels), shown, (verdict6, *findings), numbers)


def _traces(run: SmoothRun, title: str, lost: float) -> Panel:
    assert run.record is not None
    t = run.record.times / PERIOD
    curves = tuple(
        SampledCurve(f"u_{n}", n, t, run.record.u[:, i] + 2.2 * n, "trace")
        for i, n in enumerate(CENTRAL)
    )
    return Panel(title, curves, (r"$t/2\pi$", "site $n$"), None if math.isnan(lost) else lost)


# --- Fig. 7 ---------------------------------------------------------------------------------------


RAMP = (0.7, 0.82)  # amplitudes, the second that of the figure
HARD_ENOUGH = 20
GENTLE = 15  # a hardness at which that ramp loses what a gentler one keeps


def figure7(m: int = HARD_ENOUGH) -> TimeSeries:
    """Fig. 7: past the pitchfork, a = 0.82, gamma = 0.04, the breather that settles is asymmetric.

    Examples
    --------
    >>> found = figure7()
    >>> round(abs(found.numbers["mean_0"]), 3)
    0.028
    """
    a, gamma, m = RAMP[1], 0.04, whole("m", m, 1)
    exact, conditions = symmetric(a, gamma, RESTITUTION), _conditions(a, gamma)
    fork = trace(exact, "a", events=[pitchfork()], progress=False).first("PF")
    settled = _ramped(m, gamma)
    lost, other = delocalised(settled), HARD_ENOUGH if m == HARDNESS else HARDNESS
    assert settled.record is not None
    mean = settled.record.u.mean(axis=0)
    rigid = _run(exact.state(SITES), periods=3000, **conditions)
    closed = periodic(rigid.final, **conditions)
    phases, rigid_mean = _impacts_and_mean(closed)
    alone = periodic(exact.state(SITES), symmetric=True, **conditions).largest
    lopsided, gentle = _asymmetric(phases, rigid_mean, exact), _gently(GENTLE, gamma).largest
    numbers = {
        "mean_0": float(mean[0]),
        "mean_10": float(mean[2]),
        "rigid_mean_0": rigid_mean,
        "exact_c": lopsided.c,
        "phase_1": phases[0],
        "phase_2": phases[1],
        "rigid_multiplier": closed.largest,
        "symmetric_multiplier": alone,
        f"multiplier_{GENTLE}": gentle,
        "delocalised": float(lost),
        f"delocalised_{other}": float(delocalised(_ramped(other, gamma))),
    }
    shown = (
        f"Past the pitchfork (exactly at a = {fork['a']:.6f} without damping): a = {a}, "
        f"gamma = {gamma}, k = {RESTITUTION}. Lines: exact symmetric breather, unstable. Dashed: "
        f"exact asymmetric one. Circles: ring of {SITES} with smooth walls, m = {m}, damping "
        f"{DAMPING}, after a ramp of a from {RAMP[0]} and 500 periods."
    )
    fate = "this ramp ends delocalised, impacts are everywhere" if lost else (
        f"the asymmetric breather: mean of u_0 {mean[0]:.4f}, of u_10 {mean[2]:.4f}"
    )  # fmt: skip
    end = "ends delocalised" if numbers[f"delocalised_{other}"] else "keeps its breather"
    findings = (
        f"Verdict: {fate}; with m = {other} this ramp {end}. Not only m decides, but the ramp: "
        f"with m = {GENTLE} one of 61 steps of 6 periods comes to an asymmetric breather with the "
        f"largest multiplier {gentle:.4f}{', an attractor' if gentle < 1.0 else ''}.",
        f"With rigid walls an attractor, largest multiplier {closed.largest:.5f} (the symmetric "
        f"breather: {alone:.4f}), impact phases {phases[0]:.6f} and {phases[1]:.6f}, mean of u_0 "
        f"{rigid_mean:.4f} or its opposite; exactly, without damping, {lopsided.c:.4f}.",
    )
    panels = _against(exact, settled, f"ring, $m = {m}$")
    if not lost:
        panels = tuple(_with_arm(panel, lopsided, float(mean[0])) for panel in panels)
    return TimeSeries(7, panels, shown, findings, numbers)


@lru_cache(maxsize=4)  # the figure of another m asks for the same ones
def _ramped(m: int, gamma: float) -> SmoothRun:
    """The ring of Fig. 7: two periods after a slow ramp in a and 500 periods of rest."""
    conditions = _conditions(RAMP[1], gamma)
    held = _run(_up(m, gamma, 121, 2), m, periods=500, **conditions)
    return _run(held.final, m, periods=2, sample=Sample(SHOWN, 8 * CIRCLES), **conditions)


@lru_cache(maxsize=1)
def _gently(m: int, gamma: float) -> PeriodicMotion:
    """The asymmetric breather of the smooth ring next to the end of a slower ramp."""
    return periodic(_up(m, gamma, 61, 6), m=m, **_conditions(RAMP[1], gamma))


def _up(m: int, gamma: float, steps: int, periods: int) -> State:
    """The end of a ramp in a, from the symmetric breather before the pitchfork."""
    start, on = symmetric(RAMP[0], gamma, RESTITUTION), _conditions(RAMP[1], gamma)
    values = np.linspace(*RAMP, steps)
    return completed(sweep(start.state(SITES), "a", values, periods=periods, m=m, **on)).final


def _impacts_and_mean(motion: PeriodicMotion) -> tuple[tuple[float, float], float]:
    """Both impact phases of a motion in order, and the mean of u_0."""
    run = completed(motion.run(sample=Sample((0,), 400)))
    assert run.record is not None
    first, second = np.sort(run.impacts["phase"]).tolist()
    return (first, second), float(run.record.u.mean())


def _asymmetric(phases: tuple[float, float], mean: float, near: Orbit) -> Orbit:
    """The exact asymmetric breather of the infinite chain next to a simulated one."""
    times, impulses = (phases[1] - PERIOD, phases[0]), (-2.0 * near.p, 2.0 * near.p)
    guess = orbit_of(near.conditions, ACROSS, times, impulses, (mean,))
    return orbit_at(asymmetric_problem(guess).solve()[0])


def _with_arm(panel: Panel, arm: Orbit, mean: float) -> Panel:
    """A panel with the exact asymmetric breather, that of the two images the ring has come to."""
    line = panel.curves[0]
    t, sign = PERIOD * line.t, math.copysign(1.0, mean * arm.c)
    u = sign * arm.displacement(line.site, t if sign > 0.0 else t + math.pi)
    dashed = SampledCurve("asymmetric", line.site, line.t, u, "dashed")
    return replace(panel, curves=(line, dashed, *panel.curves[1:]))


# --- Fig. 8 ---------------------------------------------------------------------------------------

TORUS: dict[str, Any] = {"a": 0.15, "gamma": 0.106, "k": RESTITUTION, "damping": 0.02}


def figure8(m: int = HARDNESS) -> TimeSeries:
    """Fig. 8: beyond Neimark-Sacker, a = 0.15, gamma = 0.104: a transient; and a genuine torus.

    Examples
    --------
    >>> found = figure8()
    >>> round(found.numbers["rotation"], 5)
    0.3916
    """
    a, gamma, m = 0.15, 0.104, whole("m", m, 1)
    exact, conditions = symmetric(a, gamma, RESTITUTION), _conditions(a, gamma)
    start = exact.state(SITES)
    sample = Sample(CENTRAL, 24)
    long = _run(start, m, periods=250, sample=sample, **conditions)
    lost = life(long)
    first = max(0, (lost or 250) - 40)
    then, sample = (long.strobe.u[first], long.strobe.v[first]), Sample(SHOWN, CIRCLES // 2)
    window = _run(then, m, periods=6, sample=sample, **conditions)
    stats = lives(exact, m, lost, **RINGS)
    torus = classify(
        symmetric(TORUS["a"], TORUS["gamma"], RESTITUTION).state(SITES),
        settle=8000, periods=3000, **TORUS,
    )  # fmt: skip
    evidence = {name: float(value) for name, value in torus.evidence.items()}
    shown = (
        f"(a) to (c): a = {a}, gamma = {gamma}, k = {RESTITUTION}, damping {DAMPING}, beyond the "
        f"Neimark-Sacker line. Lines: exact breather, unstable. Circles: ring of {SITES} with "
        f"smooth walls, m = {m}, {first} periods after its start on the exact solution."
    )
    findings = (
        f"Verdict: a transient, {lives_in_words(stats, m, LONG)}",
        f"(d) A genuine quasi-periodic breather, rigid walls, N = {SITES}, damping "
        f"{TORUS['damping']}, gamma = {TORUS['gamma']}, a = {TORUS['a']}: stroboscopic section of "
        f"site 0, rotation number {evidence['rotation']:.8f}, largest Lyapunov exponent zero to "
        f"{max(abs(evidence['exponent']), evidence['exponent_error']):.0e}.",
    )
    u, v = torus.run.strobe
    section = Panel(
        f"rigid walls, damping {TORUS['damping']}: a torus",
        (SampledCurve("section", 0, u[:, 0], v[:, 0], "points"),),
        ("$u_0$", r"$\dot u_0$"),
    )
    panels = (*_against(exact, window, f"ring, $m = {m}$"), section)
    return TimeSeries(8, panels, shown, findings, {**stats, **evidence})
