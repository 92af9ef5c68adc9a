"""What the explorer shows, as one frozen value, and the script that makes the same."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contbreather.continuation.branch import Branch
from contbreather.continuation.diagram import Diagram
from contbreather.continuation.point import Point
from contbreather.continuation.switching import lift_of
from contbreather.explorer.preview import Preview, preview_of
from contbreather.orbits.zone_diagram import Zones
from contbreather.simulation.simulate import SimulationRun

RING = 400  # sites of the ring that is judged besides, the paper's


@dataclass(frozen=True)
class Named:
    """A curve, and how the script calls it."""

    code: str
    branch: Branch


@dataclass(frozen=True)
class Chosen:
    """What was clicked at, and how the script makes it."""

    code: str  # branch1[17], or cb.symmetric(a=0.5, gamma=0.08, k=0.8)
    orbit: Any  # None where a point is known by its numbers only
    point: Point | None = None  # None where no curve goes through it
    curve: str = ""  # as the script calls it
    index: int = -1  # of the point on it
    typed: tuple[tuple[str, Any], ...] = ()  # what it was asked for by

    @property
    def switches(self) -> bool:
        """Whether other curves leave it."""
        return self.point is not None and lift_of(self.point) is not None

    @property
    def traces(self) -> bool:
        """Whether it is an event that can be followed in two parameters."""
        event = None if self.point is None else self.point.event
        event = getattr(event, "base", event)
        return event is not None and event.locus is not None

    @property
    def free(self) -> tuple[str, ...]:
        """The parameters that can vary."""
        if self.point is not None:
            return tuple(self.point.base_point.curve.problem.params)
        return tuple(self.orbit.problem.params)

    @property
    def title(self) -> str:
        """Its label, if it has one, and where it is."""
        label = self.point.title if self.point is not None else ""
        return f"{label} on {self.curve}" if label else self.code.removeprefix("cb.")


@dataclass(frozen=True)
class PageState:
    """All that is seen; of zones those that are wanted, which may still be computed."""

    fixed: tuple[str, float] = ("k", 0.8)  # what is constant in the plane of the zones
    forcing: str = ""
    conditions: tuple[tuple[str, Any], ...] = ()  # besides: lattice, site, spring, ... as typed
    zones_of: str = ""  # what of these zones are of, as the script gives it to `cb.zones`
    awaited: str = ""  # the diagram that is being computed, in words
    plane: Zones | None = None  # the last that was computed
    preview: Preview | None = None  # what is drawn: that, or what lies between its neighbours
    curves: tuple[Named, ...] = ()
    listed: str = ""  # the curve whose points are offered, by its code
    hidden: frozenset[str] = frozenset()  # curves that are not drawn, by their code
    axes: tuple[str, str] = ("", "")  # columns; empty: those of the first curve
    chosen: Chosen | None = None
    sites: tuple[int, ...] = (0, 1, 2)  # whose motion is drawn
    ring: int = RING  # that is judged besides
    run: tuple[str, SimulationRun] | None = None  # the last simulation, by its code
    lines: tuple[str, ...] = ()  # of the script that made curves and runs

    @property
    def shown(self) -> tuple[Named, ...]:
        """The curves that are drawn: of those that are not hidden, those with both columns."""
        columns = set(self.columns)
        return tuple(
            curve
            for curve in self.curves
            if curve.code not in self.hidden and columns <= set(curve.branch.names)
        )

    @property
    def columns(self) -> tuple[str, str]:
        """What the axes of the bifurcation diagram are."""
        first = next((curve.branch for curve in self.curves if curve.code not in self.hidden), None)
        if first is None:
            return "a", "p"
        start = first.problem.start  # a period before the orbit of a cycle without its equations
        unknowns = [n for n in start if n not in first.problem.internals]
        unknowns.sort(key=lambda name: np.ndim(start[name]))
        other = [*first.curve.varied, *unknowns, "arclength"][1]
        return self.axes[0] or first.free, self.axes[1] or other

    @property
    def title(self) -> str:
        """What the zone diagram is about."""
        name, value = self.fixed
        of = (f"F = a ({self.forcing})" if self.forcing else "", self.zones_of)
        return ", ".join(filter(None, (f"{name} = {value:g}", *of)))

    def curve(self, code: str) -> Branch:
        """The curve that the script calls so."""
        return next(curve.branch for curve in self.curves if curve.code == code)

    def without(self, code: str) -> PageState:
        """Without a curve; the script goes on making it, for others may come from it, and what is
        looked at."""
        curves = tuple(curve for curve in self.curves if curve.code != code)
        return replace(self, curves=curves, listed=self.listed if self.listed != code else "")

    def with_result(self, name: str, lines: Iterable[str], value: Any) -> PageState:
        """With one more result, whatever `save` takes or several of that, and how it came."""
        parts = dict(result_leaves(name, value))
        curves = [Named(code, part) for code, part in parts.items() if isinstance(part, Branch)]
        runs = [
            (c, part)
            for c, part in parts.items()
            if isinstance(part, SimulationRun) and part.record
        ]
        planes = [part for part in parts.values() if isinstance(part, Zones)]
        plane = planes[-1] if planes else self.plane
        return replace(
            self,
            lines=(*self.lines, *lines),
            curves=(*self.curves, *curves),
            listed=curves[0].code if curves else self.listed,
            run=runs[-1] if runs else self.run,
            plane=plane,
            preview=preview_of(plane) if planes and plane is not None else self.preview,
            fixed=plane.fixed if planes and plane is not None else self.fixed,
            axes=self._axes_for(curves),
        )

    def _axes_for(self, new: Iterable[Named]) -> tuple[str, str]:
        """Those of the diagram when curves join it: of one in two parameters its own plane, until a
        branch comes."""
        pairs = [curve.branch.curve.varied for curve in new if len(curve.branch.curve.varied) > 1]
        if pairs:
            return pairs[-1][0], pairs[-1][1]
        in_plane = any(self.axes == curve.branch.curve.varied for curve in self.curves)
        return ("", "") if in_plane and new else self.axes

    def script(self) -> str:
        """Python that computes and draws what is seen, to the last digit."""
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
            curves = ", ".join(curve.code for curve in self.shown)
            yield f'cb.save_figure(cb.plot({curves}, x="{x}", y="{y}"), "branches.pdf")'
        if self.run is not None:
            yield f'cb.save_figure(cb.plotting.plot_motion({self.run[0]}), "motion.pdf")'


def drawn_columns(branch: Branch) -> list[str]:
    """Its columns of real numbers, as they are drawn: not words, nor an orbit on its mesh. The ends
    tell, for a whole column may take long to measure."""
    internals, ends = branch.problem.internals, (branch[:1], branch[-1:])
    return [
        name
        for name in branch.names
        if name not in internals and all(np.asarray(end[name]).dtype.kind in "fiub" for end in ends)
    ]


def result_leaves(code: str, value: Any) -> Iterator[tuple[str, Any]]:
    """What a result consists of, by what the script calls it."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from result_leaves(f"{code}[{key!r}]", item)
    elif isinstance(value, tuple | list | Diagram):
        for i, item in enumerate(value):
            yield from result_leaves(f"{code}[{i}]", item)
    else:
        yield code, value
