"""What the explorer shows, as one frozen value: the script that makes the same, and what is said of
it all."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from contbreather.continuation.branches.diagram import Diagram
from contbreather.continuation.branches.switching import branches_leave
from contbreather.continuation.curve.branch import Branch
from contbreather.continuation.curve.point import Point
from contbreather.errors import BadInput, ContbreatherError
from contbreather.lattice.chain import Ring
from contbreather.lattice.formula import as_formula
from contbreather.lattice.parse import as_typed
from contbreather.orbits.orbit import Orbit
from contbreather.orbits.zone_diagram import Zones
from contbreather.parameters import NUMBERS, OPTIONAL, POWERS
from contbreather.simulation.simulate import SimulationRun

RING = 400  # sites of the ring that is judged besides, the paper's
MOST = 2000  # sites, whose multipliers a page waits for


@dataclass(frozen=True)
class Chosen:
    """Breather or point, and how the script makes it."""

    code: str  # branch1[17], or cb.symmetric(a=0.5, gamma=0.08, k=0.8)
    orbit: Any  # None where a point is known by its numbers only
    point: Point | None = None  # None where no curve goes through it
    curve: str = ""  # as the script calls it
    index: int = -1  # of the point on it
    typed: tuple[tuple[str, Any], ...] = ()  # what it was asked for by

    @property
    def switches(self) -> bool:
        return self.point is not None and branches_leave(self.point)

    @property
    def traces(self) -> bool:
        event = None if self.point is None else self.point.event
        event = getattr(event, "base", event)
        return event is not None and event.locus is not None

    @property
    def free(self) -> tuple[str, ...]:
        if self.point is not None:
            return tuple(self.point.base_point.curve.problem.params)
        return tuple(self.orbit.problem.params)

    @property
    def title(self) -> str:
        label = self.point.title if self.point is not None else ""
        return f"{label} on {self.curve}" if label else self.code.removeprefix("cb.")


def point_of(code: str, branch: Branch, index: int) -> Chosen:
    """Point of a curve; of one that was loaded without its equations its numbers only."""
    point = branch[index]
    try:
        orbit = point.solution
    except BadInput:
        orbit = None
    if not hasattr(orbit, "admissibility"):  # what another problem's points are is its own
        orbit = None
    place = f".first({point.label!r})" if point.label else f"[{index}]"
    return Chosen(code + place, orbit, point, code, index)


@dataclass(frozen=True)
class PageState:
    """State of a page; of zones those that are wanted, which may still be computed."""

    # what is constant in the plane of the zones
    fixed: tuple[str, float] = ("k", NUMBERS["k"].first)
    forcing: str = ""
    conditions: tuple[tuple[str, Any], ...] = ()  # besides: lattice, site, spring, ... as typed
    zones_of: str = ""  # what of these zones are of, as the script gives it to `cb.zones`
    awaited: str = ""  # the diagram that is being computed, in words
    plane: Zones | None = None  # the last that was computed, which is drawn
    curves: Mapping[str, Branch] = field(default_factory=dict)  # by what the script calls them
    listed: str = ""  # the curve whose points are offered, by its code
    hidden: frozenset[str] = frozenset()  # curves that are not drawn, by their code
    axes: tuple[str, str] = ("", "")  # columns; empty: those of the first curve
    chosen: Chosen | None = None
    sites: tuple[int, ...] = ()  # whose motion is drawn; unless given that which hits, and the next
    ring: int = RING  # that is judged besides
    run: tuple[str, SimulationRun] | None = None  # the last simulation, by its code
    outcome: str = ""  # what became of it
    lines: tuple[str, ...] = ()  # of the script that made curves and runs

    @property
    def shown(self) -> dict[str, Branch]:
        return {code: one for code, one in self.curves.items() if code not in self.hidden}

    @property
    def offered(self) -> list[str]:
        """Names of the columns of numbers that all drawn curves have."""
        first, *others = [drawn_columns(branch) for branch in self.shown.values()] or [[]]
        return [name for name in first if all(name in its for its in others)]

    @property
    def columns(self) -> tuple[str, str]:
        """Axes of the bifurcation diagram: the chosen ones, where all curves have them, otherwise
        the parameter that varies and a size."""
        first, offered = next(iter(self.shown.values()), None), self.offered
        if first is None:
            return "a", "p"
        start = first.problem.start  # a period before the orbit of a cycle without its equations
        unknowns = sorted(start, key=lambda name: np.ndim(start[name]))
        usual = ((first.free,), (*first.curve.varied[1:], "p", *first.problem.shown, *unknowns))
        x, y = (
            next((name for name in (chosen, *names, *offered) if name in offered), "")
            for chosen, names in zip(self.axes, usual, strict=True)
        )
        return x, y

    def ticked(self, codes: Iterable[str]) -> PageState:
        """Draw these curves; those of another problem give way to one that was not drawn."""
        wanted = [code for code in self.curves if code in {*codes}]
        new = next((code for code in wanted if code in self.hidden), None)
        if new is not None:
            wanted = [code for code in wanted if _alike(self.curves[code], self.curves[new])]
        return replace(self, hidden=frozenset({*self.curves} - {*wanted}))

    @property
    def title(self) -> str:
        name, value = self.fixed
        of = (f"F = a ({self.forcing})" if self.forcing else "", self.zones_of)
        return ", ".join(filter(None, (f"{name} = {value:g}", *of)))

    def slider(self, name: str) -> tuple[float, ...]:
        """Ends and step of what is fixed in a plane, in units of the frequency that is set."""
        unit = float(dict(self.conditions).get("omega") or 1.0) ** POWERS.get(name, 0)
        return tuple(unit * value for value in NUMBERS[name].slider)

    def without(self, code: str) -> PageState:
        """Remove a curve; the script goes on making it, for others may come from it, and what is
        chosen."""
        curves = {other: branch for other, branch in self.curves.items() if other != code}
        return replace(self, curves=curves, listed=self.listed if self.listed != code else "")

    def with_result(
        self, name: str, lines: Iterable[str], value: Any, outcome: str = ""
    ) -> PageState:
        """Add a result, whatever `save` takes or several of that, and how it came; curves of
        another problem are drawn no more."""
        parts = dict(result_leaves(name, value))
        curves = {code: part for code, part in parts.items() if isinstance(part, Branch)}
        seen: dict[str, Any] = {}  # the last run, and the last zones
        for code, part in parts.items():
            # of less than a period nothing is recorded
            if isinstance(part, SimulationRun) and part.record and part.record.times.size:
                seen |= {"run": (code, part), "outcome": outcome or part.stop.value}
            elif isinstance(part, Zones):
                seen |= {"plane": part, "fixed": part.fixed}
        first = next(iter(curves), None)
        state = replace(
            self,
            lines=(*self.lines, *lines),
            curves={**self.curves, **curves},
            listed=first or self.listed,
            hidden=self.hidden if first is None else self.hidden | {first},
            axes=self._axes_for([*curves.values()]),
            **seen,
        )
        return state if first is None else state.ticked({*self.shown, *curves})

    def _axes_for(self, new: Sequence[Branch]) -> tuple[str, str]:
        """Axes when curves join: of one in two parameters its own plane, until a branch comes."""
        pairs = [branch.curve.varied for branch in new if len(branch.curve.varied) > 1]
        if pairs:
            return pairs[-1][0], pairs[-1][1]
        in_plane = any(self.axes == branch.curve.varied for branch in self.curves.values())
        return ("", "") if in_plane and new else self.axes

    def script(self) -> str:
        return "\n".join(self._script()) + "\n"

    def _script(self) -> Iterator[str]:
        yield "import contbreather as cb"
        yield ""
        yield from self.lines  # first: a lattice may be that of a curve
        more = f", forcing={self.forcing!r}" if self.forcing else ""
        more += f", {self.zones_of}" if self.zones_of else ""
        name, value = self.fixed
        yield f"zones = cb.zones({name}={value!r}{more})"
        if self.chosen is not None:
            yield f"here = {self.chosen.code}"
        if self.chosen is not None and (orbit := self.chosen.orbit) is not None:
            options = [] if orbit.lattice.sites is not None else [f"sites={self.ring}"]
            options += ["half=True"] if orbit.symmetric else []
            yield "print(here.admissibility().reason)"
            yield "print(here.stability())"
            yield f"mu = here.multipliers({', '.join(options)})"
        yield ""
        yield 'cb.save_figure(cb.plotting.plot_zones(zones), "zones.pdf")'
        if self.shown:
            x, y = self.columns
            curves = ", ".join(self.shown)
            yield f'cb.save_figure(cb.plot({curves}, x="{x}", y="{y}"), "branches.pdf")'
        if self.run is not None:
            yield f'cb.save_figure(cb.plotting.plot_motion({self.run[0]}), "simulation.pdf")'


def _alike(one: Branch, other: Branch) -> bool:
    """Tell whether both are curves of one problem, and may share axes."""
    return {*one.curve.varied} <= {*other.names} and {*other.curve.varied} <= {*one.names}


def drawn_columns(branch: Branch) -> list[str]:
    """Names of columns of real numbers, not words, nor an orbit on its mesh. The ends tell, for a
    whole column may take long to measure."""
    internals, ends = branch.problem.internals, (branch[:1], branch[-1:])
    return [
        name
        for name in branch.names
        if name not in internals and all(np.asarray(end[name]).dtype.kind in "fiub" for end in ends)
    ]


def result_leaves(code: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Parts of a result by their code."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from result_leaves(f"{code}[{key!r}]", item)
    elif isinstance(value, tuple | list | Diagram):
        for i, item in enumerate(value):
            yield from result_leaves(f"{code}[{i}]", item)
    else:
        yield code, value


def plane_in_words(zones: Zones) -> str:
    return next((model_in_words(branch[0].solution) for _, branch in zones), "no curve")


def model_in_words(orbit: Orbit) -> str:
    on = orbit.conditions
    own = {name: getattr(on, name) for name in OPTIONAL}
    words = [f"{n} = {x:.10g}" for n, x in own.items() if x != NUMBERS[n].default]
    return ", ".join((*_model(orbit, as_formula(on.forcing)), *words))


def _model(orbit: Orbit, drive: str) -> Iterator[str]:
    """Lattice, and sites that hit, walls and the formula of a drive that are not the usual ones."""
    sites, walls = orbit.section.hit, as_typed(orbit.walls)
    yield orbit.lattice.describe()
    if sites != (0,):
        yield f"site{'s' * (len(sites) > 1)} {', '.join(map(str, sites))}"
    if walls:
        yield f"walls {walls}"
    if drive:
        yield f"F = a ({drive})"


def watched(orbit: Orbit, sites: Sequence[int]) -> tuple[int, ...]:
    size, hit = orbit.lattice.sites, orbit.section.hit[0]
    wanted = sites or (hit, hit + 1, hit + 2)
    return tuple(n for n in wanted if size is None or -size <= n < size) or (hit,)


def small(lattice: Any) -> Any:
    """Refuse a lattice that is too large for a page."""
    if (lattice.sites or 0) > MOST:
        raise BadInput(f"{lattice.describe()}: at most {MOST} sites are shown here.")
    return lattice


# --- in words -------------------------------------------------------------------------------------


def told_apart(curves: Mapping[str, Branch]) -> tuple[str, dict[str, str]]:
    """Say what all curves share of the parameters that vary, those that do not and the model, and
    name each by its code and what it does not share: codes by names."""
    facts: dict[str, list[str]] = {}
    for code, branch in curves.items():
        varied, orbit = branch.curve.varied, point_of("", branch, 0).orbit
        facts[code] = [f"in {', '.join(varied)}"]
        if orbit is not None:  # parameters of a drive are among those below
            facts[code] += _model(orbit, "" if orbit.forcing.params else as_formula(orbit.forcing))
        fixed = ((n, v) for n, v in branch.problem.params.items() if n not in varied)
        facts[code] += [f"{name} = {value:.6g}" for name, value in fixed]
    first = next(iter(facts.values()), [])
    shared = [fact for fact in first if all(fact in its for its in facts.values())]
    own = {code: ", ".join(fact for fact in facts[code] if fact not in shared) for code in facts}
    by_name = {": ".join(filter(None, (code, words))): code for code, words in own.items()}
    return ", ".join(shared), by_name


@lru_cache(maxsize=1)
def map_on_ring(orbit: Orbit, ring: int) -> Orbit:
    """Orbit on a ring, once: its multipliers are drawn and judged."""
    return orbit.on(Ring(ring))


def verdict_in_words(orbit: Orbit) -> str:
    margins = orbit.admissibility()
    if not margins.ok and margins.margin < -1e-9:
        return "not admissible: it passes a wall"
    words = {True: "stable", False: "unstable", None: "of unknown stability"}

    def named() -> str:
        verdict = orbit.stability()
        settled = verdict.unstable or verdict.certain
        word = words[verdict.stable] if settled else "at the edge of stability"
        return f"{word} on the {verdict.lattice}"

    stable = _sentence(named)
    return stable if margins.ok else f"{stable}, at the edge of what is admissible"


def verdicts(orbit: Orbit, ring: int) -> Iterator[tuple[str, str]]:
    """Headings and sentences about an orbit."""
    margins = orbit.admissibility()
    yield "admissible" if margins.ok else "not admissible", margins.reason
    if not margins.ok and margins.margin < -1e-9:
        yield "stability", "nothing is said of it: the lattice has no such motion"
        return
    yield "own lattice", _sentence(lambda: orbit.stability().describe())
    if orbit.lattice.sites is None:
        yield f"ring of {ring}", _sentence(lambda: map_on_ring(orbit, ring).stability().describe())
        if orbit.symmetric and orbit.section.count == 1:
            yield "over-reflection", _sentence(lambda: _reflection(orbit))


def _reflection(orbit: Orbit) -> str:
    waves = orbit.stability().over_reflection
    if not waves.over_reflecting:
        return "waves come back no larger than they were: no ring of any size is unstable by them"
    if (times := f"{math.exp(waves.gain):.6g}") == "1":
        return "waves come back larger, by less than six digits show"
    return (
        f"waves come back up to {times} times as large (at the angle "
        f"{waves.nu:.6g} pi); on long rings |mu| = 1 + {waves.growth:.6g}/N over half a period"
    )


def _sentence(ask: Callable[[], str]) -> str:
    try:
        return ask()
    except BadInput as error:
        return f"not known: {error}"
    except ContbreatherError as error:
        return str(error)
