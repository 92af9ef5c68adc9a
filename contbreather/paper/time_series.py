"""Figs. 5 to 8: the exact breather beside simulations of small rings, with what becomes of them.

The paper's runs: N = 20 sites, smooth walls (21) with lambda of k = 0.8, damping mu = 0.005,
F = -a cos t. Each figure is drawn as printed and carries our verdict: which run is an attractor,
which a transient and for how long, and what m and damping it needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contbreather.breathers import Breather, symmetric
from contbreather.dynamics import (
    Run,
    Sample,
    SmoothOrbit,
    SmoothRun,
    localisation,
    periodic,
    simulate,
    simulate_smooth,
    smooth_orbit,
    sweep,
    verdict,
)
from contbreather.dynamics.conditions import PERIOD, whole
from contbreather.errors import NotConverged
from contbreather.plotting.canvas import BLUE, CYCLE, GREY, VERMILLION, new_figure, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[Any]

SITES = 20
RESTITUTION = 0.8
DAMPING = 0.005
HARDNESS = 6  # "for m > 5 the simulation results ceased to depend on the exact choice of m"
SHOWN = (0, 1, 10)
CENTRAL = (-2, -1, 0, 1, 2)
CIRCLES = 40  # in a period
BROAD = 3.0  # participation ratio beyond which a state is no breather
MISSED, REACHED = (
    0.6,
    0.93,
)  # |u| that site 0 always exceeds in a breather, and that others never do


@dataclass(frozen=True, eq=False)
class Curve:
    """One line or row of circles: u over t in periods, or v over u in a section."""

    name: str
    site: int
    t: Array
    u: Array
    style: str = "line"  # "line", "circles", "trace" or "points"


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes."""

    title: str
    curves: tuple[Curve, ...]
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
        """Panels below each other, as printed."""
        with style():
            figure, axes = new_figure(len(self.panels), height=3.9 * len(self.panels))
            for ax, letter, panel in zip(axes, "abcdef", self.panels, strict=False):
                _draw_panel(ax, panel)
                ax.set_title(f"({letter}) {panel.title}", loc="left", pad=3)
        return figure


def _draw_panel(ax: Axes, panel: Panel) -> None:
    for curve in panel.curves:
        if curve.style == "line":
            ax.plot(curve.t, curve.u, "-", color=VERMILLION, label=curve.name)
        elif curve.style == "circles":
            ax.plot(
                curve.t, curve.u, "o", color="black", markerfacecolor="none", markersize=2.6,
                markeredgewidth=0.5, label=curve.name,
            )  # fmt: skip
        elif curve.style == "points":
            ax.plot(curve.t, curve.u, ".", color=BLUE, markersize=0.9, label=curve.name)
        else:
            colour = CYCLE[abs(curve.site)]
            ax.plot(curve.t, curve.u, "-", color=colour, linewidth=0.25, rasterized=True)
    ax.set_xlabel(panel.labels[0])
    ax.set_ylabel(panel.labels[1])
    traces = [curve for curve in panel.curves if curve.style == "trace"]
    if traces:
        ax.set_yticks([2.2 * c.site for c in traces], [f"$n={c.site}$" for c in traces])
        ax.set_ylabel("")
        ax.margins(x=0.0)
    if panel.lost is not None:
        ax.axvline(panel.lost, color=GREY, linewidth=0.8, linestyle="--")
    if any(curve.style == "circles" for curve in panel.curves):
        ax.margins(x=0.01)


# --- what the figures have in common --------------------------------------------------------------


def _against(exact: Breather, run: Run | SmoothRun, word: str) -> tuple[Panel, ...]:
    """Panels of sites 0, 1 and 10: the exact line through the circles of a dense record."""
    assert run.record is not None
    times, sites = run.record.times, run.record.sites
    fine = np.linspace(times[0], times[-1], 1200)
    step = max(1, round(PERIOD / (times[1] - times[0]) / CIRCLES))
    panels = []
    for n in SHOWN:
        u = run.record.u[:, sites.index(n % run.sites)]
        panels.append(
            Panel(
                f"$u_{{{n}}}$",
                (
                    Curve("exact, infinite chain", n, fine / PERIOD, exact.displacement(n, fine)),
                    Curve(word, n, times[::step] / PERIOD, u[::step], "circles"),
                ),
                (r"$t/2\pi$", f"$u_{{{n}}}$"),
            )
        )
    return tuple(panels)


def _differences(exact: Breather, run: Run | SmoothRun) -> dict[int, float]:
    """Largest |simulated - exact| of each site shown, over one recorded period."""
    assert run.record is not None
    times = run.record.times
    return {
        n: float(np.abs(run.record.u[:, i] - exact.displacement(n, times)).max())
        for i, n in enumerate(SHOWN)
    }


def _after_a_shift(exact: Breather, run: SmoothRun) -> tuple[float, float]:
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


def _life(run: Run | SmoothRun) -> int | None:
    """Periods until site 0 misses a wall or another site comes to one: the breather's life."""
    if isinstance(run, Run):
        own = np.bincount(run.at_site(0)["period"], minlength=run.periods)
        others = run.impacts["period"][run.impacts["site"] != 0]
        broken = (own != 2) | (np.bincount(others, minlength=run.periods) > 0)
    else:
        assert run.record is not None
        u = run.record.u.reshape(run.periods, -1, len(run.record.sites))
        site, rest = u[:, :, run.record.sites.index(0)], np.delete(u, run.record.sites.index(0), 2)
        missed = (site.max(axis=1) < MISSED) | (site.min(axis=1) > -MISSED)
        broken = missed | (np.abs(rest).max(axis=(1, 2)) > REACHED)
    gone = np.flatnonzero(broken)
    return int(gone[0]) if gone.size else None


def _spread(run: SmoothRun) -> bool:
    """Whether the energy is all over the ring at the end."""
    c, (u, v) = run.conditions, run.strobe
    seen = localisation(u[-1], v[-1], run.times[-1], a=c.a, gamma=c.gamma, damping=c.damping)
    return float(seen.participation) > BROAD


def _smooth_multiplier(breather: Breather, m: int) -> float:
    """Largest multiplier over 2 pi of the smooth ring's own breather; NaN if there is none."""
    conditions = _conditions(breather.a, breather.gamma)
    try:
        problem, _ = smooth_orbit(breather.state(SITES), m=m, **conditions).solve()
    except NotConverged:
        return math.nan
    found: SmoothOrbit = _solution(problem)
    return found.largest


def _solution(problem: Any) -> Any:
    """What a solved problem's start is."""
    from contbreather.continuation import walk

    return next(walk(problem, "a", events=())).solution


# --- Fig. 5 ---------------------------------------------------------------------------------------


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
    transient = simulate_smooth((np.zeros(SITES), v), m=m, periods=400, **conditions)
    problem, _ = smooth_orbit(transient.final, m=m, **conditions).solve()
    orbit = _solution(problem)
    settled = simulate_smooth(orbit.state, m=m, periods=2, sample=Sample(SHOWN, 400), **conditions)
    gap, (left, shift) = _differences(exact, settled), _after_a_shift(exact, settled)
    rigid = periodic(exact.state(SITES), symmetric=True, **conditions).largest
    free = float(np.abs(exact.multipliers(sites=SITES)).max())
    numbers = {
        **{f"difference_{n}": gap[n] for n in SHOWN},
        "difference_0_shifted": left,
        "shift": shift,
        "smooth_multiplier": orbit.largest,
        "rigid_multiplier": rigid,
        "undamped_multiplier": free,
    }
    shown = (
        f"Exact breather of the infinite chain (lines) and the ring of {SITES} sites with smooth "
        f"walls, m = {m}, started as in the paper (circles, after its transient): a = {a}, "
        f"k = {RESTITUTION}, gamma = {gamma}, damping {DAMPING}."
    )
    findings = (
        f"Verdict: an attractor, with this damping: largest multiplier {orbit.largest:.4f} "
        f"(rigid walls: {rigid:.4f}; without damping {free:.4f}, unstable).",
        f"Largest differences: {gap[0]:.3f} in u_0 ({left:.3f} once shifted in time by "
        f"{-shift:.3f}: the soft wall holds the site for a while), {gap[1]:.4f} in u_1, "
        f"{gap[10]:.4f} in u_10.",
    )
    return TimeSeries(5, _against(exact, settled, f"m = {m}"), shown, findings, numbers)


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
        start, sample = exact.state(SITES), Sample(CENTRAL, 24)
        run = simulate_smooth(start, m=m, periods=periods, sample=sample, **conditions)
        lost = _life(run)
        rigid = periodic(start, symmetric=True, **conditions).largest
        life = _life(simulate(start, periods=600, **conditions))
        soft = _smooth_multiplier(exact, m)
        panels.append(_traces(run, f"$a = {a}$", lost))
        findings.append(_fate6(letter, a, m, (lost, soft), (life, rigid)))
        numbers |= {
            f"lost_{a}": math.nan if lost is None else float(lost),
            f"rigid_lost_{a}": math.nan if life is None else float(life),
            f"multiplier_{a}": soft,
            f"rigid_multiplier_{a}": rigid,
        }
    shown = (
        f"Five central sites of the ring of {SITES} with smooth walls (m = {m}), started on the "
        f"exact solution at gamma = {gamma}, k = {RESTITUTION}, damping {DAMPING}; dashed: the "
        "breather is lost, site 0 misses a wall or a neighbour comes to one."
    )
    verdict6 = "Verdict: transients, all three; a life grows with the logarithm of how exact the "
    verdict6 += "start is, its rate is the multiplier's."
    return TimeSeries(6, tuple(panels), shown, (*findings, verdict6), numbers)


def _traces(run: SmoothRun, title: str, lost: int | None) -> Panel:
    assert run.record is not None
    t = run.record.times / PERIOD
    curves = tuple(
        Curve(f"u_{n}", n, t, run.record.u[:, i] + 2.2 * n, "trace") for i, n in enumerate(CENTRAL)
    )
    return Panel(title, curves, (r"$t/2\pi$", "n"), None if lost is None else float(lost))


def _fate6(
    letter: str,
    a: float,
    m: int,
    smooth: tuple[int | None, float],
    rigid: tuple[int | None, float],
) -> str:
    (lost, soft), (life, hard) = smooth, rigid
    if math.isnan(soft):
        why = f"at m = {m} there is no breather to start on (its branch ends in a fold in m)"
    else:
        why = f"largest multiplier {soft:.4f}"
    gone = {None: "kept", 0: "lost at once"}.get(lost, f"lost after {lost} periods")
    rigid_life = "kept" if life is None else f"after {life} periods"
    return f"({letter}) a = {a}: {gone}, {why}; rigid walls: {rigid_life}, {hard:.4f}."


# --- Fig. 7 ---------------------------------------------------------------------------------------


def figure7(m: int = 20) -> TimeSeries:
    """Fig. 7: past the pitchfork, a = 0.82, gamma = 0.04, the breather that settles is asymmetric.

    Examples
    --------
    >>> found = figure7()
    >>> round(abs(found.numbers["mean_0"]), 3)
    0.028
    """
    gamma, m = 0.04, whole("m", m, 1)
    first, last = 0.7, 0.82
    exact, conditions = symmetric(last, gamma, RESTITUTION), _conditions(last, gamma)
    start = symmetric(first, gamma, RESTITUTION).state(SITES)
    values = np.linspace(first, last, 121)
    ramp = sweep(start, "a", values, periods=2, m=m, **conditions)
    held = simulate_smooth(ramp.final, m=m, periods=500, **conditions)
    settled = simulate_smooth(held.final, m=m, periods=2, sample=Sample(SHOWN, 200), **conditions)
    lost = _spread(settled)
    assert settled.record is not None
    mean = settled.record.u.mean(axis=0)
    rigid = simulate(exact.state(SITES), periods=3000, **conditions)
    own = periodic(rigid.final, **conditions)
    impacts = own.run(sample=Sample((0,), 400))
    assert impacts.record is not None
    phases = np.sort(impacts.impacts["phase"])
    alone = periodic(exact.state(SITES), symmetric=True, **conditions).largest
    numbers = {
        "mean_0": float(mean[0]),
        "mean_10": float(mean[2]),
        "rigid_mean_0": float(impacts.record.u.mean()),
        "phase_1": float(phases[0]),
        "phase_2": float(phases[1]),
        "rigid_multiplier": own.largest,
        "symmetric_multiplier": alone,
        "delocalised": float(lost),
    }
    shown = (
        f"Past the pitchfork (exactly at a = 0.777632 without damping): a = {last}, gamma = "
        f"{gamma}, k = {RESTITUTION}, damping {DAMPING}. Lines: exact symmetric breather, "
        f"unstable. Circles: ring of {SITES} with smooth walls, m = {m}, after a ramp of a from "
        f"{first} to {last} and 500 periods."
    )
    fate = "the ramp ends delocalised: the ring hits everywhere" if lost else (
        f"the asymmetric breather: mean of u_0 {mean[0]:.4f}, of u_10 {mean[2]:.4f}"
    )  # fmt: skip
    findings = (
        f"Verdict: {fate}; m = 6 is too soft (the neighbour comes close to its wall), m >= 20 is "
        "needed.",
        f"With rigid walls an attractor, largest multiplier {own.largest:.5f} (the symmetric "
        f"breather: {alone:.4f}), impact phases {phases[0]:.6f} and {phases[1]:.6f}, mean of u_0 "
        f"{numbers['rigid_mean_0']:.4f} or its opposite.",
    )
    return TimeSeries(7, _against(exact, settled, f"m = {m}"), shown, findings, numbers)


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
    long = simulate_smooth(start, m=m, periods=250, sample=sample, **conditions)
    lost = _life(long)
    first = max(0, (lost or 250) - 40)
    then, sample = (long.strobe.u[first], long.strobe.v[first]), Sample(SHOWN, CIRCLES)
    window = simulate_smooth(then, m=m, periods=6, sample=sample, **conditions)
    rigid_lost = _life(simulate(start, periods=400, **conditions))
    rigid = periodic(start, symmetric=True, **conditions).largest
    torus = verdict(
        symmetric(TORUS["a"], TORUS["gamma"], RESTITUTION).state(SITES),
        settle=8000, periods=3000, **TORUS,
    )  # fmt: skip
    numbers = {
        "lost": math.nan if lost is None else float(lost),
        "rigid_lost": math.nan if rigid_lost is None else float(rigid_lost),
        "rigid_multiplier": rigid,
        **{name: float(value) for name, value in torus.evidence.items()},
    }
    shown = (
        f"(a) to (c): a = {a}, gamma = {gamma}, k = {RESTITUTION}, damping {DAMPING}, beyond the "
        f"Neimark-Sacker line. Lines: exact breather, unstable. Circles: ring of {SITES} with "
        f"smooth walls, m = {m}, {first} periods after its start on the exact solution."
    )
    gone = "was kept for 250 periods" if lost is None else f"is lost after {lost} periods"
    findings = (
        f"Verdict: a transient; the breather {gone} (rigid walls: {rigid_lost}; multiplier "
        f"{rigid:.4f}).",
        f"(d) A genuine quasi-periodic breather, rigid walls, N = {SITES}, damping "
        f"{TORUS['damping']}, gamma = {TORUS['gamma']}, a = {TORUS['a']}: stroboscopic section of "
        f"site 0; {torus.reason}.",
    )
    u, v = torus.run.strobe
    section = Panel(
        "torus, strobe of site 0",
        (Curve("section", 0, u[:, 0], v[:, 0], "points"),),
        ("$u_0$", r"$\dot u_0$"),
    )
    panels = (*_against(exact, window, f"m = {m}"), section)
    return TimeSeries(8, panels, shown, findings, numbers)
