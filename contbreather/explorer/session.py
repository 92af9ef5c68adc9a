"""What an explorer does: what is seen, and what changes it. Pages only show it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from contbreather.breathers import zones
from contbreather.breathers.zones import Zones
from contbreather.checks import number, whole
from contbreather.continuation import Branch
from contbreather.errors import BadInput
from contbreather.explorer.background import Background, Progress
from contbreather.explorer.state import Chosen, State
from contbreather.explorer.work import Work, breather, point_of
from contbreather.plotting import plot, plot_motion, plot_zones, save_figure
from contbreather.runs import load, save

Listener = Callable[[State], object]
KEPT = 200  # zone diagrams that are remembered
DIGITS = 6  # of what is clicked at: a pixel has no more


class Session:
    """What an `Explorer` does, whoever shows it; its parameters are those of that."""

    def __init__(self, *curves: Branch, run: str | Path | None = None, k: float = 0.8) -> None:
        self.state = State(k=number("k", k, 0.0, 1.0, "a restitution between 0 and 1"))
        self.message = self.progress = ""
        self._listeners: list[Listener] = []
        self._changing = threading.RLock()
        self._long, self._quick = Background(), Background()
        self._planes: dict[tuple[float, str], Zones] = {}
        self._count = 0
        if run is not None:
            self._take("run", (f"{{}} = cb.load({str(run)!r})",), load(run))
        for branch in curves:
            self._take("given", ("{} = ...  # the curve that the explorer was given",), branch)

    # ------------------------------------------------------------------------------ who looks on

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Have every change said, in whatever thread it happens; the result ends that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def _say(self) -> None:
        for listener in tuple(self._listeners):
            listener(self.state)

    def _change(self, **values: Any) -> None:
        with self._changing:
            self.state = replace(self.state, **values)
        self._say()

    def tell(self, message: str) -> None:
        """Say a sentence."""
        self.message = message
        self._say()

    # --------------------------------------------------------------------------------- the zones

    def look_at(self, k: float, forcing: str | None = None) -> None:
        """Have the zone diagram of another restitution; the last one stays until it is there."""
        forcing = self.state.forcing if forcing is None else forcing
        self._change(k=number("k", k, 0.0, 1.0, "a restitution between 0 and 1"), forcing=forcing)
        wanted = self.state.k, forcing
        known = self._planes.get(wanted)
        if known is not None:
            self._change(plane=known)
            return

        def done(plane: Zones | None, cut: bool, trouble: str) -> None:
            if plane is not None:
                self._remember(wanted, plane)
            self._zones_are(plane, trouble)

        def job(progress: Progress) -> Zones:
            found = zones(k=wanted[0], forcing=forcing or None, progress=progress.points())
            _ = found.regions  # here, not where pages are drawn
            return found

        self._quick.begin(job, say=lambda _: None, done=done)

    def _remember(self, wanted: tuple[float, str], plane: Zones) -> None:
        self._planes[wanted] = plane
        while len(self._planes) > KEPT:
            del self._planes[next(iter(self._planes))]

    def _zones_are(self, plane: Zones | None, trouble: str) -> None:
        self.message = trouble or self.message
        self._change(plane=plane or self.state.plane)

    # ------------------------------------------------------------------------- what is looked at

    def choose(self, chosen: Chosen) -> None:
        """Look at an orbit or a point."""
        self.message = ""
        self._change(chosen=chosen)

    def choose_at(self, a: float, gamma: float) -> None:
        """Look at the breather at a place of the zone diagram."""
        a, gamma = (float(f"{value:.{DIGITS}g}") for value in (a, gamma))
        self.choose(breather(forcing=self.state.forcing, a=a, gamma=gamma, k=self.state.k))

    def choose_point(self, curve: str, index: int) -> None:
        """Look at a point of a curve."""
        branch = self.state.curve(curve)
        self.choose(point_of(curve, branch, min(max(index, 0), len(branch) - 1)))

    @property
    def chosen(self) -> Chosen:
        """What is looked at, or a sentence."""
        if self.state.chosen is None:
            raise BadInput("choose a breather first: click into a diagram, or type its parameters.")
        return self.state.chosen

    def watch(self, sites: tuple[int, ...], ring: int) -> None:
        """Draw the motion of these sites, and judge a ring of so many."""
        self._change(sites=sites, ring=whole("sites of the ring", ring, 3))

    def draw(self, **values: Any) -> None:
        """Draw other columns (`axes`), or leave out curves (`hidden`)."""
        self._change(**values)

    # ---------------------------------------------------------------------------------- long work

    def begin(self, work: Work) -> None:
        """Do it in the background.

        Raises
        ------
        BadInput
            If something is under way.
        """
        if self.busy:
            raise BadInput("something is under way; stop it, or wait for its end.")

        def say(how_far: str) -> None:
            self.progress = f"{work.title}: {how_far}"
            self._say()

        def done(value: Any, cut: bool, trouble: str) -> None:
            self.progress = ""
            if value is None:
                self.tell(trouble or f"{work.title}: stopped, nothing was done by then.")
                return
            note = "  # was stopped: what is seen is a piece of it" if cut else ""
            self.message = f"{work.title}: stopped; what was done is kept." if cut else ""
            self._take(work.name, (*work.setup, f"{{}} = {work.code}{note}"), value)

        self.message = ""
        say("begins")
        self._long.begin(work.job, say=say, done=done)

    def _take(self, name: str, lines: tuple[str, ...], value: Any) -> None:
        """One more result, under a name of its own; `{}` in its lines stands for that."""
        self._count += 1
        name = f"{name}{self._count}"
        *setup, last = lines
        with self._changing:
            self.state = self.state.with_result(name, (*setup, last.replace("{}", name, 1)), value)
        self._say()

    @property
    def busy(self) -> bool:
        """Whether long work is under way."""
        return bool(self.progress)

    def stop(self) -> None:
        """End the long work; what is done by then is kept."""
        self._long.stop()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all work has ended; whether it has."""
        return self._long.join(timeout) and self._quick.join(timeout)

    # ------------------------------------------------------------------------------- what is kept

    def script(self) -> str:
        """Python that computes and draws what is seen."""
        return self.state.script()

    def save(self, path: str | Path) -> Path:
        """Write all that is seen to one file: zones, curves, the simulation.

        Raises
        ------
        BadInput
            If there are none, or the file cannot be written.
        """
        state = self.state
        results: dict[str, Any] = {} if state.plane is None else {"zones": state.plane}
        results |= {one.code.translate(PLAIN): one.branch for one in state.curves}
        results |= {} if state.run is None else {state.run[0].translate(PLAIN): state.run[1]}
        if not results:
            raise BadInput("there is nothing to save yet: trace a branch first.")
        save(path, **results)
        return Path(path).absolute()

    def figure(self, what: str, suffix: str) -> bytes:
        """The zones, the branches or the simulation as a figure for a journal.

        Parameters
        ----------
        what : {'zones', 'branches', 'motion'}
        suffix : {'.pdf', '.svg', '.png'}

        Raises
        ------
        BadInput
            If there is no such thing yet.
        """
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{what}{suffix}"
            return save_figure(self._drawn(what), path).read_bytes()

    def _drawn(self, what: str) -> Any:
        state = self.state
        if what == "zones" and state.plane is not None:
            return plot_zones(state.plane)
        if what == "branches" and state.shown:
            x, y = state.columns
            return plot(*(one.branch for one in state.shown), x=x, y=y)
        if what == "motion" and state.run is not None:
            return plot_motion(state.run[1])
        raise BadInput(f"there is nothing to draw as {what} yet.")


PLAIN: Mapping[int, str | None] = str.maketrans({"[": "_", "]": None, "'": None, "/": "_"})
