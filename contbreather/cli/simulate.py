"""`contbreather simulate`: a lattice in motion, from a breather or any state."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

import contbreather as cb
from contbreather.cli.options import ModelOptions, Whole
from contbreather.cli.output import CUT, Result, SavedRun, inform, sentences, walls_entry
from contbreather.cli.process import CutShort, computing
from contbreather.errors import BadInput
from contbreather.files import read_text, write_csv, write_whole
from contbreather.parameters import NAMES
from contbreather.tables import Sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from contbreather.simulation.integrator import Chunk
    from contbreather.simulation.simulate import SmoothRun

    Ran = cb.simulation.SimulationRun | SmoothRun

SITES = 20  # the paper's ring
JUDGED = 4096  # periods that a verdict looks at, at most
ENOUGH = 50  # and at least
WANTED = "JSON with u, v and t, or two columns u and v were expected"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """A run as it was typed."""

    periods: float = 200.0
    """Length of the run, in periods 2 pi."""
    smooth: float | None = None
    """Smooth walls (21) of this hardness m; rigid ones unless given."""
    start: str | None = None
    """File with the first state; the exact breather unless given."""
    perturb: float = 0.0
    """Standard deviation of a random push on it."""
    noise: float = 0.0
    """Strength of white noise on every site, all the time."""
    seed: Whole = 0
    """Of that push, and of the noise."""
    stream: str | None = None
    """File to keep the run in, run.nc for instance; the same command again goes on with it."""
    impacts: str | None = None
    """Write all impacts to this file."""
    final: str | None = None
    """Write the last state to this file, for --start."""

    def check(self, where: ModelOptions, into: SavedRun) -> None:
        """Refuse what cannot be, before anything is computed."""
        from contbreather.checks import number, whole

        read = where.read | {"--start": self.start if self.start != self.final else None}
        into.check(read, impacts=self.impacts, final=self.final)
        rigid = {"--impacts": self.impacts, "--stream": self.stream, "--noise": self.noise}
        for option, value in {**rigid, "--walls": where.walls}.items():
            if self.smooth is not None and value:
                raise BadInput(f"{option} goes with rigid walls only: leave out --smooth")
        if self.stream is not None and (self.noise or into.save is not None):
            raise BadInput(
                "--stream: a stream is without noise and kept in its own file; leave out --noise "
                "and --save, or --stream"
            )
        whole("--seed", self.seed, 0)
        number("--perturb", self.perturb, 0.0, 1e6, "a standard deviation, from 0 to 1e6")

    @computing()
    def simulate(self, where: ModelOptions) -> RunSummary:
        import numpy as np

        from contbreather.progress import Bar
        from contbreather.simulation.simulate import length_of

        # also before the first period: on long rings and dense lattices the breather takes a while
        with Bar(None, int(length_of(self.periods, 0))) as bar:
            values, on = where.given(), where.on()
            lattice = None if on["lattice"].sites is None else on["lattice"]
            if self.start is None:
                (u, v), t0 = _breather(where, on, lattice)
            else:
                (u, v), t0 = read_state(self.start)
                if lattice is not None and lattice.sites != len(u):
                    typed = "--sites" if where.lattice is None else "--lattice"
                    raise BadInput(
                        f"{typed} {where.lattice or lattice.sites}: the state in {self.start} has "
                        f"{len(u)} sites; leave out {typed}"
                    )
            if self.perturb:
                push = np.random.default_rng(self.seed).normal(size=(2, len(u)))
                u, v = (u, v) + self.perturb * push
            shared: dict[str, Any] = {**values, "lattice": lattice, "forcing": on["forcing"]}
            shared |= {"periods": self.periods, "t0": t0, "progress": bar}
            summary = partial(
                RunSummary, asked=self.periods, site=where.site, begun=self.start is None
            )
            if self.smooth is not None:
                return summary(cb.simulation.simulate_smooth((u, v), m=self.smooth, **shared))
            shared["walls"] = on["walls"]
            if self.stream is None:
                return summary(cb.simulate((u, v), **shared, noise=self.noise, seed=self.seed))
            if self.periods.is_integer():  # whole ones alone are kept
                shared["periods"] = int(self.periods)
            recording = cb.simulation.record(self.stream, (u, v), **shared)
            return summary(recording.last(2 * JUDGED), stream=recording)


def read_state(path: str) -> tuple[tuple[Any, Any], float]:
    """Read displacements, velocities, and their time; 0 where the file does not say."""
    import numpy as np

    try:
        text = read_text(path)
    except BadInput as error:
        raise BadInput(f"{error}; {WANTED}") from error
    try:
        if text.lstrip().startswith("{"):
            content = json.loads(text)
            content = content.get("final", content)  # what --json prints will do, too
            u, v = (np.array(content[name], dtype=float) for name in "uv")
            return (u, v), float(content.get("t", 0.0))
        rows = [line.replace(",", " ").split() for line in text.splitlines() if line.strip()]
        if rows and rows[0] == ["u", "v"]:
            rows = rows[1:]
        u, v = np.array(rows, dtype=float).T
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise BadInput(f"no state in {path}: {WANTED}") from error
    return (u, v), 0.0


def _breather(where: ModelOptions, on: dict[str, Any], lattice: Any) -> tuple[Any, float]:
    """Find the exact breather at t = 0, or a quarter of a period later if it hits just then. On a
    ring it is the one without damping, as in the paper; on --lattice it has all."""
    from contbreather.orbits.start_search import breather_at

    values = where.given() | ({} if where.lattice else {"damping": 0.0})
    breather = breather_at(None, **{**values, **on, "lattice": lattice or cb.Ring(SITES)})
    margins = breather.admissibility()
    if not margins.ok:
        raise BadInput(f"{margins.reason.rstrip('.')}; give a state with --start instead")
    # a period should not begin at an impact: it might be counted there or not
    near = min(abs(math.remainder(time, math.pi)) for time in breather.times)
    # a breather that hits closer to t = 0 sets out a quarter of a period later
    t0 = 0.0 if near > 0.05 else 0.5 * math.pi
    return breather.state(t=t0), t0


def simulate(
    where: ModelOptions = ModelOptions(),
    options: RunOptions = RunOptions(),
    into: SavedRun = SavedRun(),
) -> None:
    """A lattice in motion, impact by impact, and a verdict on it.

    It is a ring of 20 unless a lattice or a state is given. It starts on the exact breather at
    t = 0, or from a file: JSON with u, v and t, as --final
    writes it, or two columns u and v. --csv takes the states once in a period. After Ctrl-C all
    that was simulated until then is written, then judged; a second one leaves the verdict out.
    """
    options.check(where, into)
    summary = options.simulate(where)
    if summary.interrupted:
        inform("interrupted: writing, then judging what there is; Ctrl-C while judging: no verdict")
    written = [str(path) for path in _files(summary, options, into)]
    try:
        into.leave(of_run(summary, where.given()), cut=summary.interrupted, others=written)
    finally:
        undamped = where.damping and not (where.lattice or options.start or options.smooth)
        if undamped and summary.lost is not None:
            inform(
                "it started on the breather without damping, which is no orbit of the damped ring: "
                f"--lattice ring:{where.sites or SITES} starts on the one with damping"
            )
    if summary.interrupted:  # while it was judged
        raise CutShort


def _files(summary: RunSummary, options: RunOptions, into: SavedRun) -> Iterator[Any]:
    """Write the last state first, from which it goes on: large tables take long."""
    if options.final is not None:
        state = summary.run.final
        last = {"t": float(summary.run.end), "u": state.u.tolist(), "v": state.v.tolist()}
        text = json.dumps(last, allow_nan=False) + "\n"
        yield write_whole(options.final, lambda file: file.write(text.encode()))
    if into.save is not None:
        cb.save(into.save, run=summary.run)
    if options.impacts is not None:
        rows = (row for chunk in summary.chunks() for row in chunk.impacts.tolist())
        names = cb.simulation.integrator.IMPACT.names or ()
        yield write_csv(options.impacts, names, rows, summary.cut)


# --- what it shows --------------------------------------------------------------------------------


@dataclass
class RunSummary:
    """A run (of a stream its last periods), how it ended, and what it is in the end. It is judged
    when what took long to simulate is on disk."""

    run: Ran
    asked: float | None = None  # periods; of a run out of a file nobody knows
    site: int = 0
    begun: bool = False  # whether as a breather
    stream: cb.simulation.Recording | None = None
    by_site: dict[int, int] | None = None
    rests: int = 0
    lost: int | None = None

    def __post_init__(self) -> None:
        self.periods = self.run.periods if self.stream is None else self.stream.periods
        self.stop = getattr(self.run, "reason", "") or self.run.stop.value
        self.cut = ""  # a remark in files
        ends = self.run.stop, getattr(self.stream, "stop", None)
        self.interrupted = cb.simulation.RunStop.INTERRUPTED in ends
        if self.interrupted:
            asked = "" if self.asked is None else f" of {self.asked:.12g}"
            after = f"after {self.periods}{asked} periods"
            goes_on = "" if self.stream is None else "; the same command goes on"
            self.stop, self.cut = f"interrupted {after}{goes_on}", f"{CUT} {after}"

    def chunks(self) -> Iterator[Chunk]:
        """Go through all of it; through a stream piece by piece, so that memory does not grow with
        its length."""
        if self.stream is None:
            from contbreather.simulation.integrator import EVENTS, Chunk

            u, v = (row[1:] for row in self.run.strobe)
            events = {n: getattr(self.run, n) for n in EVENTS if hasattr(self.run, n)}
            yield Chunk(0, u, v, u[:0], v[:0], **events)
            return
        yield from self.stream.chunks()

    @computing()
    def judge(self) -> dict[str, Any]:
        """Count its impacts and find the verdict; without it where Ctrl-C does not wait for it."""
        try:
            if hasattr(self.run, "impacts"):
                self._count()
            return _judged(self.run)
        except KeyboardInterrupt:
            self.interrupted = True
            return _undecided("no verdict: interrupted before it was found")

    def _count(self) -> None:
        """Count impacts, and periods until it was no breather any more."""
        import numpy as np

        from contbreather.paper.lifetimes import unlike_a_breather

        counts, rests, lost, wall = Counter[int](), 0, None, 0
        for chunk in self.chunks():
            hits = chunk.impacts
            counts.update(hits["site"].tolist())
            rests += int(chunk.rests["begins"].sum())
            if lost is None:
                wrong = unlike_a_breather(hits, chunk.periods, chunk.first, wall, self.site)
                gone = np.flatnonzero(wrong)
                lost = chunk.first + int(gone[0]) if gone.size else None
            wall = int(hits["wall"][-1]) if hits.size else wall
        self.by_site, self.rests, self.lost = dict(sorted(counts.items())), rests, lost


def _judged(run: Ran) -> dict[str, Any]:
    from contbreather.simulation.classify import judge

    half = min(JUDGED, run.periods // 2)
    if run.stop is cb.simulation.RunStop.CHATTER:
        return _undecided("it ends before a period of too many impacts")
    if half < ENOUGH:
        few = f"{run.span} {'is' if run.length == '1' else 'are'} too few"
        return _undecided(f"no verdict: {few}, give at least {2 * ENOUGH}")
    try:
        verdict: Any = judge(run.since(run.periods - half))
    except cb.errors.ContbreatherError as error:
        return _undecided(f"no verdict: {error}")
    kinds = {"kind": verdict.kind.name, "motion": verdict.motion.name}
    return {**kinds, "reason": str(verdict), "evidence": dict(verdict.evidence)}


def _undecided(reason: str) -> dict[str, Any]:
    return {"kind": "UNDECIDED", "motion": "UNDECIDED", "reason": reason, "evidence": {}}


def _in_periods(count: object) -> str:
    return f"{count} period{'s' * (str(count) != '1')}"


def _lines(summary: RunSummary) -> Iterator[object]:
    from contbreather.simulation.classify import in_words

    verdict, run = summary.judge(), summary.run
    m = getattr(run.conditions, "m", None)
    walls = "rigid walls" if m is None else f"smooth walls, m = {m:g}"
    length = _in_periods(summary.periods) if summary.stream else run.span
    lattice = run.conditions.lattice.describe()
    yield f"{lattice[0].upper()}{lattice[1:]}, {walls}, {length}"
    rows = list[tuple[str, str]]()
    if summary.by_site is not None:
        rows.append(("impacts", str(sum(summary.by_site.values()))))
        rows.append((f"of them at site {summary.site}", str(summary.by_site.get(summary.site, 0))))
        if summary.rests:  # the last rebounds of a chatter are summed: no impacts of the table
            times = "once" if summary.rests == 1 else f"{summary.rests} times"
            rows.append(("came to rest on a wall", times))
        if summary.begun:
            lost = "to the end" if summary.lost is None else _in_periods(summary.lost)
            rows.append(("breather kept for", lost))
    if rows := [*rows, *in_words(verdict["evidence"])]:
        yield Sheet.of(rows)
    plain = not summary.interrupted and summary.stop == "went through all its periods"
    yield from sentences([verdict["reason"], *([] if plain else [summary.stop])])


def of_run(summary: RunSummary, params: Mapping[str, float] | None = None) -> Result:
    """Present a run, with its parameters as they were typed."""

    def entry() -> dict[str, Any]:
        verdict, run, c = summary.judge(), summary.run, summary.run.conditions
        numbers = params or {name: getattr(c, name) for name in NAMES}
        counts = summary.by_site
        length = float(run.length)
        hits = {} if counts is None else {"total": sum(counts.values()), "by_site": counts}
        return {
            **numbers,
            "damping": c.damping,
            "forcing": c.forcing.describe(),
            "m": getattr(c, "m", None),
            "lattice": c.lattice.describe(),
            "sites": run.sites,
            "walls": walls_entry(getattr(c, "walls", None)),
            "periods": summary.periods if summary.stream or length.is_integer() else length,
            "stop": summary.stop,
            "interrupted": summary.interrupted,
            "noise": getattr(run, "noise", 0.0),
            "verdict": verdict,
            "final": {"t": run.end, "u": run.final.u, "v": run.final.v},
            **({"impacts": hits} if hits else {}),
            **({"lost_after": summary.lost} if hits and summary.begun else {}),
        }

    names = [f"{name}_{n}" for name in "uv" for n in range(summary.run.sites)]
    heading = ["period", "time", *names]
    return Result(
        entry,
        partial(_lines, summary),
        lambda: (heading, _strobes(summary)),
        partial(_draw, summary),
        summary.cut,
    )


def _strobes(summary: RunSummary) -> Iterator[list[float]]:
    """Read stroboscopic states, those of a stream piece by piece."""
    import numpy as np

    from contbreather.simulation.states import PERIOD

    stream, run = summary.stream, summary.run
    t0, begin = (float(run.times[0]), run.strobe) if stream is None else (stream.t0, stream.start)
    start: Any = (0, *(np.atleast_2d(row)[:1] for row in begin))
    later = ((chunk.first + 1, chunk.u, chunk.v) for chunk in summary.chunks())
    for first_period, u, v in chain([start], later):
        for i in range(len(u)):
            period = first_period + i
            yield [period, t0 + PERIOD * period, *u[i].tolist(), *v[i].tolist()]


def _draw(summary: RunSummary) -> Figure:
    run, site = summary.run, summary.site
    plotting = cb.plotting
    shown = tuple(dict.fromkeys((site + n) % run.sites for n in (0, 1, run.sites // 2)))
    titles = ["the last periods", "once in a period, later half", "where the energy is"]
    if getattr(run, "noise", 0.0):  # the last periods cannot be simulated once more by themselves
        del titles[0]
    with plotting.style():
        figure, panels = plotting.new_figure(len(titles), height=4.5 * len(titles))
        *motion, section, where = panels
        for ax in motion:
            end = plotting.runs.end_of(run, 6, cb.simulation.Sample(shown, 100))
            plotting.plot_motion(end, ax=ax)
        plotting.plot_section(run, site=site, skip=run.periods // 2, ax=section)
        plotting.plot_localisation(run, ax=where)
        for ax, letter, title in zip(panels, "abc", titles, strict=False):
            over = 17 if ax.get_legend() else 3  # points
            ax.set_title(f"({letter}) {title}", loc="left", pad=over)
    return figure
