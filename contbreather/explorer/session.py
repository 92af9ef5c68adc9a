"""What an explorer does: what is seen, and what changes it. Pages only show it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from contbreather.checks import check_kind
from contbreather.continuation.curve.branch import Branch
from contbreather.errors import BadInput
from contbreather.explorer.jobs import Computation, Job, JobThread, OnLattice, Progress, arguments
from contbreather.explorer.state import Chosen, PageState, point_of, result_leaves, small
from contbreather.files import writable
from contbreather.lattice.chain import Ring
from contbreather.lattice.formula import as_formula, forcing_of
from contbreather.lattice.parse import as_typed
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.start_search import breather_at
from contbreather.orbits.zone_diagram import Zones
from contbreather.orbits.zones import zones
from contbreather.parameters import HEAVIEST, NEEDED, NUMBERS, OPTIONAL, parameter
from contbreather.plotting.canvas import save_figure
from contbreather.plotting.orbits import chosen_sites
from contbreather.plotting.pictures import plot
from contbreather.plotting.runs import plot_motion
from contbreather.plotting.zones import plot_zones
from contbreather.progress import PATIENCE
from contbreather.runs import load, save
from contbreather.simulation.simulate import SimulationRun

Listener = Callable[[PageState], object]
Plane = tuple[str, float, str, str]  # what is fixed, at which value; forcing; what it is of
UNDONE = ("curves", "listed", "hidden", "axes", "run", "outcome", "lines")  # of a state


class Session:
    """Explorer without a page; parameters as there."""

    def __init__(
        self, *curves: Branch, run: str | Path | None = None, k: float = NUMBERS["k"].first
    ) -> None:
        self.state = PageState(fixed=("k", parameter("k", k)))
        self.message = self.progress = self.drawing = ""
        self._listeners: list[Listener] = []
        self._changing = threading.RLock()
        self._long, self._quick = JobThread(), JobThread()
        self._planes: dict[Plane, Zones] = {}
        self._models: dict[str, dict[str, Any]] = {"": {}}  # by `zones_of`, as `zones` takes them
        self._before: list[tuple[str, PageState]] = []  # what `undo` says, and goes back to
        self.lattices: dict[str, OnLattice] = {}  # by what is typed for them
        self._count = 0
        if run is not None:
            self._take("run", (f"{{}} = cb.load({str(run)!r})",), load(run))
            if not (self.state.curves or self.state.run or self.state.plane):
                self.message = (
                    f"{run} has nothing that is drawn here: no curves, no zones, and no run "
                    "between rigid walls with a record of sites, simulate(..., sample=...)."
                )
        for branch in curves:
            for _, part in result_leaves("", branch):
                kinds = Branch, Zones, SimulationRun
                check_kind(part, kinds, "a branch", "a file is given by its name, run=")
            self._take("given", ("{} = ...  # the curve that the explorer was given",), branch)

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Have every change said, in whatever thread it happens; the result ends that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    @property
    def shared(self) -> bool:
        return len(self._listeners) > 1

    def _say(self) -> None:
        for listener in tuple(self._listeners):
            listener(self.state)

    def _become(self, step: Callable[[PageState], PageState], undone: str = "") -> None:
        """Show something else; `undo` goes back from there where it has something to say."""
        with self._changing:
            if undone:
                self._before.append((undone, self.state))
            self.state = step(self.state)
        self._say()

    def change(self, **values: Any) -> None:
        """Show other columns (`axes`), say."""
        self._become(lambda state: replace(state, **values))

    def tick(self, codes: Iterable[str]) -> None:
        self._become(lambda state: state.ticked(codes))

    def tell(self, message: str) -> None:
        self.message = message
        self._say()

    def look_at(self, value: float, forcing: str | None = None, *, fixed: str = "") -> None:
        """Compute the zone diagram at another value of what is `fixed`; the last one stays till
        then."""
        forcing = self.state.forcing if forcing is None else forcing
        name = fixed or self.state.fixed[0]
        if name not in NEEDED:
            raise BadInput(f"{name!r} is fixed in no plane of zones: one of {', '.join(NEEDED)} is")
        # at another frequency, or of another lattice, `zones` says what is too large
        wide = name == "gamma" and self.state.zones_of
        now = name, parameter(name, value, **({"high": HEAVIEST} if wide else {}))
        # not as a page opens, with what is to be said of its file
        if self.state.plane or (now, forcing) != (self.state.fixed, self.state.forcing):
            self.message = ""
        with self._changing:  # what arrives meanwhile is not taken for what is wanted now
            self.drawing = ""  # of another one
            self.change(fixed=now, forcing=forcing)
            if self._wanted in self._planes:
                self._show_plane()
                return
            self.change(awaited=self.state.title)
            self._compute(self._wanted)

    @property
    def _wanted(self) -> Plane:
        state = self.state
        return *state.fixed, state.forcing, state.zones_of

    def _show_plane(self) -> None:
        self.change(plane=self._planes[self._wanted], awaited="")

    def _compute(self, wanted: Plane) -> None:
        name, value, forcing, of = wanted
        on: dict[str, Any] = {name: value, **self._models[of]}
        began = time.monotonic()

        def say(how_far: str) -> None:
            past = time.monotonic() - began
            if past < PATIENCE:  # most are there before it could be read
                return
            with self._changing:
                if self._wanted != wanted:
                    raise KeyboardInterrupt  # nobody waits for what is slow
                self.drawing = f"zones at {self.state.title}: {how_far}, {past:.0f} s"
            self._say()

        def job(progress: Progress) -> Zones:
            plane: Zones = zones(**on, forcing=forcing or None, progress=progress)
            _ = plane.regions  # here, not where pages are drawn
            return plane

        def done(plane: Zones | None, cut: bool, trouble: str) -> None:
            self.drawing = ""
            with self._changing:
                self._arrived(wanted, plane, cut, trouble)

        self._quick.begin(job, say=say, done=done)

    def _arrived(self, wanted: Plane, plane: Zones | None, cut: bool, trouble: str) -> None:
        if plane is not None and not cut:
            self._planes[wanted] = plane
        # what was wanted in between may have been computed before: then nothing else comes
        if self._wanted in self._planes:
            self._show_plane()
        elif plane is not None and not cut:
            self.change(plane=plane)
        elif self._wanted == wanted and not self._quick.waiting:  # it does not end for another one
            last = self.state.plane
            if cut:
                trouble = f"zones at {self.state.title}: stopped; what was done is kept."
                self.change(plane=plane or last, awaited="")
            else:  # what is drawn stays
                self.change(**({"fixed": last.fixed} if last else {}), awaited="")
            self.tell(f"no zones: {trouble}" if trouble and not cut else trouble)

    def choose(self, chosen: Chosen) -> None:
        self.message = ""
        self.change(chosen=chosen, listed=chosen.curve or self.state.listed)

    def choose_typed(self, **typed: Any) -> None:
        """Look at the breather with these parameters, and compute zones of its lattice."""
        chosen = self._breather(**typed)
        more = {name: value for name, value in typed.items() if name not in (*NEEDED, "forcing")}
        before = self._wanted
        self.change(conditions=tuple(more.items()), zones_of=self._zones_of(**more))
        self.choose(chosen)
        name = self.state.fixed[0]
        if (name, typed[name], typed["forcing"], self.state.zones_of) != before:
            self.look_at(typed[name], typed["forcing"])

    def choose_at(self, **place: float) -> None:
        """Look at the breather at a place of the zone diagram, by the two parameters of that, on
        the lattice that is set."""
        state = self.state
        pair = [name for name in NEEDED if name != state.fixed[0]]
        if {*place} != {*pair}:
            wanted, got = " and ".join(pair), " and ".join(place)
            raise BadInput(f"at {state.title} a place has {wanted}; {got} were given")
        # a pixel has no more digits
        params = {name: float(f"{value:.6g}") for name, value in place.items()}
        params |= [state.fixed]
        values: dict[str, Any] = {"forcing": state.forcing, **dict(state.conditions)}
        values |= {name: params[name] for name in NEEDED}
        chosen = self._breather(**values)
        self.choose(chosen)
        plane = self._planes.get(self._wanted)
        if plane and (words := plane.beyond_grazing(*(params[name] for name in plane.pair))):
            self.tell(f"{chosen.title}; beyond GR {words}")

    def _zones_of(self, lattice: str = "", root: int | None = None, **typed: Any) -> str:
        """Code of what zones are wanted of: what is set, but on the infinite chain, where they have
        no springs, that alone."""
        own = typed if lattice else {"omega": typed.get("omega")}
        if not lattice and own["omega"] in (None, "", 1.0):
            return ""
        # in one order, and without zeros: what vanishes is not there
        conditions = {name: own[name] for name in sorted(own) if own[name]}
        params, code = arguments(self.lattices[lattice], **conditions)
        self._models[code] = params
        return code

    def _breather(self, *, lattice: str = "", **values: Any) -> Chosen:
        on = self.lattices.get(lattice) or OnLattice.typed(lattice)
        params, words = arguments(on, **values)
        orbit = breather_at(**params)
        self.lattices[lattice] = on
        typed = (*values.items(), ("lattice", lattice))
        made = "symmetric(" if orbit.symmetric else "orbits.start_search.breather_at("
        return Chosen(f"cb.{made}{words})", orbit, typed=typed)

    def lattice_of(self, chosen: Chosen) -> str:
        """Text to type for its lattice: of one that a curve brought, its description."""
        lattice = chosen.orbit.lattice
        if lattice.sites is None:
            return ""
        ring = isinstance(lattice, Ring)
        name = f"ring:{lattice.sites}" if ring else str(lattice.describe())
        name += f" of {chosen.curve}" * (name in self.lattices)  # another one that is called so
        typed = (text for text, on in self.lattices.items() if on.lattice == lattice)
        text = next(typed, name)
        self.lattices.setdefault(text, OnLattice(lattice, f"{chosen.code}.lattice"))
        return text

    def lives_on(self, chosen: Chosen) -> dict[str, Any]:
        """Values to type for it besides its parameters in the planes of zones."""
        orbit = chosen.orbit
        losses = {name: getattr(orbit, name) for name in OPTIONAL}
        entries = {
            "forcing": self._drive_of(orbit),
            **{
                n: value if value != NUMBERS[n].default or n in chosen.free else None
                for n, value in losses.items()
            },
            "site": orbit.section.hit[0],
            "walls": as_typed(orbit.walls),
            "root": None,
            **{name: value for name, value in chosen.typed if name not in NEEDED},
        }
        return {**entries, "lattice": entries.get("lattice") or self.lattice_of(chosen)}

    def _drive_of(self, orbit: Orbit) -> str:
        """Formula to type for its drive: what is typed, where that is the same."""
        typed = self.state.forcing
        return typed if forcing_of(typed or None) == orbit.forcing else as_formula(orbit.forcing)

    def choose_point(self, curve: str, index: int) -> None:
        """Look at a point of a curve, and have zones of what it lives on."""
        branch = self.state.curves[curve]
        chosen = point_of(curve, branch, min(max(index, 0), len(branch) - 1))
        if chosen.orbit is not None:
            on = self.lives_on(chosen)
            forcing, of = on.pop("forcing"), self._zones_of(**on)
            if (forcing, of) != (self.state.forcing, self.state.zones_of):
                self.change(conditions=tuple(on.items()), zones_of=of)
                self.look_at(self.state.fixed[1], forcing)
        self.choose(chosen)

    @property
    def chosen(self) -> Chosen:
        if self.state.chosen is None:
            raise BadInput("choose a breather first: click into a diagram, or type its parameters.")
        return self.state.chosen

    def watch(self, sites: Sequence[int], ring: int) -> None:
        shown = tuple(chosen_sites(sites)) if sites else ()  # around the impact
        self.change(sites=shown, ring=small(Ring(ring)).sites)

    def begin(self, computation: Computation) -> None:
        """Do it in the background, unless something is under way."""

        outcome = ""

        def job(progress: Progress) -> Any:
            nonlocal outcome
            value = computation.job(progress)
            outcome = computation.outcome(value)
            return value

        def taken(value: Any, cut: bool) -> None:
            note = "  # was stopped: what is seen is a piece of it" if cut else ""
            if cut:
                self.message = f"{computation.title}: stopped; what was done is kept."
            lines = (*computation.setup, f"{{}} = {computation.code}{note}")
            self._take(computation.name, lines, value, outcome)

        self._run(computation.title, job, taken)

    def _run(self, title: str, job: Job, taken: Callable[[Any, bool], object]) -> None:
        if self.busy:
            raise BadInput("something is under way; stop it, or wait for its end.")

        began = time.monotonic()

        def say(how_far: str) -> None:
            self.progress = f"{title}: {how_far}, {time.monotonic() - began:.0f} s"
            self._say()

        def done(value: Any, cut: bool, trouble: str) -> None:
            self.progress = ""
            if value is None:
                self.tell(trouble or f"{title}: stopped, nothing was done by then.")
            else:
                self.message = f"{title}: done in {time.monotonic() - began:.1f} s."
                taken(value, cut)

        self.message = ""
        say("under way")
        self._long.begin(job, say=say, done=done)

    def _take(self, name: str, lines: tuple[str, ...], value: Any, outcome: str = "") -> None:
        """Add a result under a name of its own; `{}` in its lines stands for that."""
        self._count += 1
        name = f"{name}{self._count}"
        *setup, last = lines
        lines = (*setup, last.replace("{}", name, 1))
        undone = f"{name} is taken back."
        self._become(lambda state: state.with_result(name, lines, value, outcome), undone)

    def remove(self, code: str) -> None:
        """Take a curve away, by the name that the script has for it."""
        self._become(lambda state: state.without(code), f"{code} is back.")

    @property
    def undoes(self) -> bool:
        return bool(self._before)

    def undo(self) -> None:
        """Take back the last result, or bring back what was removed last."""
        if not self._before:
            raise BadInput("there is nothing to take back.")
        with self._changing:
            self.message, before = self._before.pop()
            state = replace(self.state, **{name: getattr(before, name) for name in UNDONE})
            chosen = state.chosen
            gone = chosen is not None and chosen.curve not in ("", *state.curves)
            # of a curve that is gone no point can be made: what was looked at before it came
            self.state = replace(state, chosen=before.chosen) if gone else state
        self._say()

    @property
    def busy(self) -> bool:
        return bool(self.progress)

    @property
    def stoppable(self) -> bool:
        return self.busy or bool(self.drawing)

    def stop(self) -> None:
        (self._long if self.busy else self._quick).stop()

    def wait(self, timeout: float | None = None) -> bool:
        return self._long.join(timeout) and self._quick.join(timeout)

    def script(self) -> str:
        return self.state.script()

    def save(self, path: str | Path) -> Path:
        """Write all that is seen to one file: zones, curves, the simulation."""
        state = self.state
        results: dict[str, Any] = {} if state.plane is None else {"zones": state.plane}
        results |= {code.translate(PLAIN): branch for code, branch in state.curves.items()}
        results |= {} if state.run is None else {state.run[0].translate(PLAIN): state.run[1]}
        if not results:
            raise BadInput("there is nothing to save yet: trace a branch first.")
        save(path, **results)
        return writable(path).absolute()

    def keep(self, path: str | Path) -> None:
        """`save` in the background; what is wrong with the path is refused at once."""
        target = writable(path)
        self._run(
            f"saving {target}",
            lambda _: self.save(target),
            lambda file, _: self.tell(f"Wrote {file}."),
        )

    def figure(self, what: str, suffix: str) -> bytes:
        """Draw the "zones", "branches" or "simulation" for a journal: ".pdf", ".svg", ".png"."""
        state = self.state
        if what == "zones" and state.plane is not None:
            if state.awaited:
                raise BadInput(f"the zones at {state.awaited} are being computed; wait a moment.")
            drawn = plot_zones(state.plane)
        elif what == "branches" and state.shown:
            x, y = state.columns
            drawn = plot(*state.shown.values(), x=x, y=y)
        elif what == "simulation" and state.run is not None:
            drawn = plot_motion(state.run[1])
        else:
            raise BadInput(f"there is nothing to draw as {what} yet.")
        with TemporaryDirectory() as folder:
            return save_figure(drawn, Path(folder) / f"{what}{suffix}").read_bytes()


PLAIN: Mapping[int, str | None] = str.maketrans({"[": "_", "]": None, "'": None, "/": "_"})
