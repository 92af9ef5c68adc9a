"""
From a measurement to a diagram: cantilevers with stops
=======================================================

Nine cantilevers stand side by side on a shaker, coupled where they are clamped, the tip of each
between two stops. Their masses, springs and damping were measured, and so was the acceleration of
the base, with noise and with what a shaker adds of its own. In units of the gap and of the drive
they are a chain of the model. Its breather, and where that begins and ends, come back in
newtons and millimetres, and beside them what a sweep of the force sees.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import contbreather as cb
from contbreather.continuation import with_columns
from contbreather.plotting import new_figure, plot_diagram, save_figure, style

SITES, CENTRE, K = 9, 4, 0.8
HERTZ = 12.0
MILLI = 1e3  # of metres, newtons, seconds
GREY, BLUE, VERMILLION = "0.65", "#0072B2", "#D55E00"
ABOVE = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": 3, "frameon": False}
FORCE, SPEED = "force on a tip (mN)", "speed of impacts (mm/s)"


def recorded(rng: np.random.Generator) -> tuple[Any, Any]:
    """Say what an accelerometer on the base would in a second, in m/s^2."""
    t = np.arange(2000) / 2000
    w = 2 * np.pi * HERTZ * t
    clean = 2.3 * np.cos(w - 0.4) + 0.25 * np.cos(3 * w + 1.1) + 0.08 * np.sin(5 * w)
    return t, clean + 0.15 * rng.normal(size=t.size)


def measured(rng: np.random.Generator, amplitude: float) -> cb.Units:
    """Say what was found of the cantilevers, each a bit different from the next."""
    mass = 0.025 * (1 + 0.02 * rng.uniform(-1, 1, SITES))  # kg
    ground = 40.0 * (1 + 0.02 * rng.uniform(-1, 1, SITES))  # N/m
    damping = 2 * 0.005 * np.sqrt(ground * mass)  # N s/m, 0.5 per cent of critical
    force = mass * amplitude  # N, as seen from the base
    return cb.Units(
        mass=mass, ground=ground, damping=damping, force=force,
        stiffness=4.0, gap=1e-3, frequency=HERTZ,
    )  # fmt: skip


def swept(orbit: cb.Orbit, step: float) -> Iterator[tuple[float, Any]]:
    """Change the force slowly, until the breather is lost; at each force say how fast the last 20
    impacts were."""
    state, on = orbit.state(), dict(vars(orbit.conditions))
    while True:
        run = cb.simulate(state, periods=300, **on)
        own = run.at_site(CENTRE)
        if len(run.impacts) > len(own) or len(own) < 600:
            return
        yield on["a"], abs(own["before"][-20:])
        state, on["a"] = run.final, on["a"] + step


def main(folder: Path = Path()) -> list[Path]:
    """Draw the force, the diagram and the motion into a folder."""
    rng = np.random.default_rng(12)
    t, base = recorded(rng)
    amplitude = np.sqrt(2) * base.std()  # m/s^2
    drive = cb.Fourier.fit(t, -base / amplitude, harmonics=5, frequency=HERTZ)
    print(f"noise of {drive.residual * amplitude:.3f} m/s^2 is left of {amplitude:.3f}")
    units = measured(rng, amplitude)
    print(units.table())

    lattice = cb.OpenChain(SITES, **units.rows)
    on: dict[str, Any] = {"lattice": lattice, "site": CENTRE, "forcing": drive}
    on |= {"k": K, **units.parameters}
    breather = cb.symmetric(**on)
    # with damping a multiplier outside the unit circle is one too many
    events = [cb.neimark_sacker(threshold=1), cb.fold(), cb.pitchfork(), cb.grazing()]
    branch = cb.trace(breather, "a", within={"a": (0.01, 1.2)}, events=events)
    for point in branch.special:
        print(f"{point.label}: {MILLI * units.scale('a') * point['a']:.2f} mN")

    with style():
        figure, axes = new_figure(1, 3, width=17.5, height=6.5)
        draw_force(axes[0], units, t, base, drive)
        draw_sweeps(axes[1], units, rng, breather, cb.symmetric(**{**on, "a": 0.1}))
        draw_branch(axes[1], units, branch)
        draw_motion(axes[2], units, breather)
        return [save_figure(figure, folder / "measurement.png")]


def draw_force(ax: Any, units: cb.Units, t: Any, base: Any, drive: cb.Fourier) -> None:
    """Draw the force on a tip over a period, as it was measured and as it was fitted."""
    ours = np.linspace(0, 2 * np.pi, 400)
    fit = units.parameters["a"] * drive.d2f(ours)
    measured = -np.mean(units.mass) * base
    ax.plot(MILLI * (t % (1 / HERTZ)), MILLI * measured, ".", color=GREY, ms=1.5, label="measured")
    ax.plot(
        MILLI * units.scale("time") * ours, MILLI * units.scale("force") * fit, "k-",
        label="harmonics 1, 3, 5",
    )  # fmt: skip
    ax.set(xlabel="time in a period (ms)", ylabel=FORCE)
    ax.legend(**ABOVE)


def draw_sweeps(ax: Any, units: cb.Units, rng: np.random.Generator, *starts: cb.Orbit) -> None:
    """Draw the speeds of impacts in sweeps up and down, as a vibrometer has them."""
    newtons, speed = MILLI * units.scale("a"), MILLI * units.scale("velocity")
    for start in starts:
        for step in (0.01, -0.005):
            for a, own in swept(start, step):
                seen = speed * own + 0.4 * rng.normal(size=own.size)
                ax.plot(np.full(own.size, newtons * a), seen, ".", color=GREY, ms=1.5)


def draw_branch(ax: Any, units: cb.Units, branch: cb.Branch) -> None:
    """Draw the branch in millinewtons and millimetres per second."""
    columns = {
        FORCE: lambda point: MILLI * units.scale("a") * point["a"],
        SPEED: lambda point: MILLI * units.scale("velocity") * point.solution.incoming[0],
    }
    plot_diagram(with_columns(branch, **columns), x=FORCE, y=SPEED, ax=ax)


def draw_motion(ax: Any, units: cb.Units, breather: cb.Orbit) -> None:
    """Draw the tip that hits its stops, and its neighbours, over two periods."""
    t = np.linspace(0, 4 * np.pi, 801)
    for n, colour in ((CENTRE, "black"), (CENTRE + 1, BLUE), (CENTRE + 2, VERMILLION)):
        u = breather.displacement(n, t)
        ax.plot(
            MILLI * units.scale("time") * t, MILLI * units.scale("length") * u, color=colour,
            label=f"tip {n + 1}",
        )  # fmt: skip
    for stop in (-1, 1):
        ax.axhline(stop * MILLI * units.gap, color=GREY, lw=3)
    ax.set(xlabel="time (ms)", ylabel="displacement (mm)")
    ax.set_yticks([-1, -0.5, 0, 0.5, 1])
    ax.legend(**ABOVE)


if __name__ == "__main__":
    main()
