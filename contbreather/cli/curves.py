"""`contbreather point`, `branch`, `boundary`, `switch` and `diagram`: one breather, curves of them
in one parameter, of events in two, and the branches that leave others, once or everywhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Any, Literal

import contbreather as cb
from contbreather.cli.options import (
    Axes,
    BranchWindow,
    Judged,
    ModelOptions,
    StepSizes,
    Whole,
    Window,
)
from contbreather.cli.output import (
    Result,
    SavedOutput,
    branch_entry,
    check_ends,
    end_sentences,
    lines_of,
    lives_on,
    model_entry,
    point_entry,
    say,
    sentences,
    stacked_table,
    table_of,
    to_json,
)
from contbreather.cli.process import until_interrupted
from contbreather.errors import BadInput, NotConverged
from contbreather.parameters import NAMES, NEEDED, windows_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from contbreather.tables import Sheet

TIMES = ("t1", "t2", "t3", "t4")
SHOWN = ("p", *TIMES, "c", "asymmetry", "unstable")  # columns of the table


def point(
    where: ModelOptions = ModelOptions(),
    rule: Judged = Judged(),
    *,
    root: Whole | None = None,
    certify: bool = False,
    json: bool = False,
) -> None:
    """One breather: p, phi, admissibility, stability.

    Parameters
    ----------
    root
        Which solution of (11), in order of decreasing p, where there are several; unless given the
        first that is admissible.
    certify
        Prove all of it by interval arithmetic, on the infinite chain; exit status 1 if that fails.
    json
        Print one JSON object, in full precision.
    """
    from contbreather.orbits.closed_form import rooted

    on = where.on()
    verge = rule.verge(ring := on["lattice"])
    if where.sites is not None:  # of a point it asks for a ring besides the infinite chain
        on = replace(where, sites=None).on()
    roots: tuple[Any, ...] = cb.orbits.symmetric_roots(**{**where.given(), **on})
    breather = rooted(roots, root)
    others = [
        {"p": other.p, "phi": other.phi, "admissible": other.admissibility().ok}
        for other in roots if other is not breather
    ]  # fmt: skip
    judged, lines = _judged(breather, others, verge, None if where.sites is None else ring)
    content: dict[str, Any] = {
        **{name: value for name, value in breather.conditions.params.items() if name in NAMES},
        **model_entry(verge, **on),
        **{name: getattr(breather, name) for name in ("p", "phi", "chi")},
        **judged,
        "root": roots.index(breather) + 1,
    }
    proof = breather.certify() if certify else None
    if proof is not None:
        content["certificate"] = asdict(proof)
    if json:
        to_json(content)
    else:
        isolated = judged.get("multipliers", ()) if judged["admissible"] else ()
        rows = [("isolated multiplier of QS", f"{mu:.12g}") for mu in isolated]
        say(replace(breather.table().further(*rows), title="Symmetric breather"))
        say(*sentences(lines), *([] if proof is None else [proof.table()]))
    if proof is not None and proof.unproved:
        raise NotConverged(f"not all is proved: {'; '.join(proof.unproved)}")


def _judged(
    breather: Any, others: list[dict[str, Any]], verge: float, ring: Any
) -> tuple[dict[str, Any], list[str]]:
    """Judge admissibility and stability, on a ring besides: for JSON, and in sentences."""
    margins, finite = breather.admissibility(), breather.lattice.sites is not None
    verdict = breather.stability(threshold=verge) if finite else breather.stability()
    lines = [margins.reason, verdict.describe()]
    # what goes through a wall is no motion of the lattice, be its linearisation what it may
    judge = verdict if margins.ok else None
    content = {
        "admissible": margins.ok,
        **{name: getattr(margins, name) for name in ("max_neighbour", "margin", "reason")},
        **{name: getattr(judge, name, None) for name in ("stable", "unstable")},
        "other_roots": others,
    }
    if finite:
        content["largest"] = getattr(judge, "largest", None)
    else:
        exact = ("certain", "over_reflecting", "multipliers")
        content |= {name: getattr(verdict, name) for name in exact}
    if ring is not None:  # by the paper's rule
        by_rule = breather.stability(sites=ring.sites, threshold=verge)
        about = {"sites": ring.sites, "threshold": verge, "largest": by_rule.largest}
        content["ring"] = {**about, "unstable": by_rule.unstable if margins.ok else None}
        lines.append(by_rule.describe())
    if not margins.ok:
        lines[1:] = ["nothing is said of its stability: the lattice has no such motion"]
    if others:
        roots = [(root["p"], "" if root["admissible"] else "not ") for root in others]
        told = ", ".join(f"p = {p:.9g} ({no}admissible)" for p, no in roots)
        lines.append(f"further roots of (11): {told}")
    return content, lines


# --- curves ---------------------------------------------------------------------------------------


def branch(
    where: ModelOptions = ModelOptions(),
    rule: Judged = Judged(),
    *,
    along: BranchWindow,
    towards: Literal["both", "up", "down"] = "both",
    root: Whole | None = None,
    sizes: StepSizes = StepSizes(),
    axes: Axes = Axes(),
    into: SavedOutput = SavedOutput(),
) -> None:
    """A branch of breathers in one parameter, with its special points.

    It starts at the value of the free parameter, if one is given, or at a breather that is
    found in the window.

    Parameters
    ----------
    towards
        Direction in which the parameter changes at first.
    root
        Which solution of (11), in order of decreasing p, where there are several; unless given the
        first, and another only where that is no breather.
    """
    into.check(where.read)
    axes.check(into.output)
    steps, problem = sizes.steps(), along.problem(where, rule, root)
    traced, cut = until_interrupted(
        cb.continuation.trace, problem, along.free,
        within=along.within(where), towards=towards, steps=steps, save=into.save,
    )  # fmt: skip
    into.leave(of_branch(traced, axes), cut=cut)
    check_ends(traced, "branch")


def boundary(
    kind: str,
    where: ModelOptions = ModelOptions(),
    rule: Judged = Judged(),
    *,
    pair: tuple[str, str] = ("gamma", "a"),
    window: Window = None,
    sizes: StepSizes = StepSizes(),
    axes: Axes = Axes(),
    into: SavedOutput = SavedOutput(),
) -> None:
    """A curve of folds (LP), pitchforks (PF), Neimark-Sacker points (NS), grazings (GR) or period
    doublings (PD).

    Its first point is found on a branch in the second parameter, at the value of the first one if
    that is given. Past a fold (as NS-LP) it goes on among the breathers with the smaller p; the
    curves of `contbreather zones`, which finds all curves, end there. On a ring the curve of
    NS ends where another of its waves passes the threshold first; `zones` has the whole envelope.
    Symmetric breathers have no PD: it is that of an arm that leaves them at a pitchfork.

    Parameters
    ----------
    kind
        LP, PF, PD, NS or GR.
    pair
        The two parameters to vary; the window is that of the first.
    """
    into.check(where.read)
    axes.check(into.output)
    within = windows_of(pair, {pair[0]: window} if window else {}, where.omega or 1.0)
    steps = sizes.steps(largest=0.02)
    seed = cb.orbits.find_event(
        kind.upper(), pair, within=within, threshold=rule.threshold,
        **{**where.given(*NEEDED), **where.on(*pair)},
    )  # fmt: skip
    curve, cut = until_interrupted(
        cb.continuation.boundary, seed, pair, within=within, steps=steps, save=into.save
    )
    into.leave(of_branch(curve, axes), cut=cut)
    check_ends(curve, "curve")


def of_branch(branch: cb.Branch, axes: Axes = Axes()) -> Result:
    about: dict[str, Any] = {"free": branch.free}
    if branch.problem.beneath is not None:
        kind = branch.problem.label.partition(" ")[0]
        about = {"curve": kind, "pair": branch.curve.varied}
    return Result(
        lambda: {**about, **lives_on(branch), **branch_entry(branch)},
        partial(lines_of, branch),
        lambda: table_of(branch.tabulated()),
        partial(axes.plot, branch),
    )


# --- what leaves them -----------------------------------------------------------------------------


def switch(
    where: ModelOptions = ModelOptions(),
    *,
    along: BranchWindow,
    at: tuple[str, ...] = ("PF",),
    into: SavedOutput = SavedOutput(),
) -> None:
    """The branches that leave a branch of breathers: both arms of a pitchfork, doubled orbits.

    The breathers are followed as `contbreather branch` does, then everything that leaves them at
    the first point of the kind. Each arm is given to its end, with stability and special points.

    Parameters
    ----------
    at
        Where to switch, a kind or a label; once more for the branch found there: --at PF --at PD.
    """
    into.check(where.read)
    within = along.within(where)
    branch = parent = cb.continuation.trace(
        along.problem(where, switched=True), along.free, within=within
    )
    for kind in at[:-1]:
        parent = cb.switch(_first(kind, parent), within=within)[0]
    point = _first(at[-1], parent)
    arms, cut = until_interrupted(cb.switch, point, within=within, save=into.save)

    result = of_arms(arms)._replace(
        entry=lambda: {**arms_entry(arms), "branch": branch_entry(branch)},
        lines=partial(_lines, point, parent, arms),
        draw=partial(_drawn, parent, arms),
    )
    into.leave(result, cut=cut)
    for i, arm in enumerate(arms, start=1):
        check_ends(arm, f"arm {i}")


def of_arms(arms: Sequence[cb.Branch], axes: Axes = Axes()) -> Result:
    numbered = enumerate(arms, start=1)
    return Result(
        partial(arms_entry, arms),
        lambda: [_table(arms)],
        lambda: stacked_table(({"arm": i}, arm.tabulated()) for i, arm in numbered),
        partial(axes.plot, *arms),
    )


def _first(kind: str, branch: cb.Branch) -> cb.continuation.Point:
    try:
        return branch.first(kind.upper())
    except BadInput:
        there = ", ".join(point.label for point in branch.special) or "nothing"
        raise BadInput(f"--at {kind}: there is none. {branch.describe()}. It has {there}") from None


# --- for people -----------------------------------------------------------------------------------


def _lines(
    point: cb.continuation.Point, parent: cb.Branch, arms: Sequence[cb.Branch]
) -> Iterator[object]:
    """Say where it was switched, the special points of all arms, their stability, their ends."""
    free = point.curve.free[0]
    yield f"{point.label} at {free} = {point[free]:.12g}, on {parent.describe()}."
    if "coefficient" in point.detail:
        shift = "(t2 - t1 - pi)^2" if point["power"] == 2 else "|t2 - t1 - pi|"
        size = f"{shift} / ({free} - {point[free]:.6g}) -> {point['coefficient']:.9g}"
        yield f"{point.detail['criticality'].capitalize()}: {size}."
    yield _table(arms)
    for i, arm in enumerate(arms, start=1):
        start = arm[0].detail  # at GR and VI with what becomes of the orbit
        said = [f"{point.label}: {start['beyond']}, {start['says']}"] if "says" in start else []
        said += [*_stability_lines(arm), end_sentences(arm)[-1]]
        said += [] if arm.image_of is None else [f"the mirror image of arm {arm.image_of + 1}"]
        yield from (f"Arm {i}, {line}." for line in said)


def _table(arms: Sequence[cb.Branch]) -> Sheet:
    from contbreather.tables import Column, Sheet

    names = [arms[0].free, *(name for name in SHOWN if name in arms[0].names)]
    rows = [(i, point) for i, arm in enumerate(arms, start=1) for point in arm.special]
    numbers, points = zip(*rows, strict=True)
    columns = [Column("arm", numbers), Column("label", [_name(point) for point in points])]
    for name in names:
        cells = [point.table_value(name) for point in points]
        columns.append(Column(name, cells, spare=name in TIMES))
    return Sheet(columns, title=f"{arms[0].problem.label} in {arms[0].free}")


def _name(point: cb.continuation.Point) -> str:
    """The label that the point has in files, too: an arm starts at its EP1."""
    return point.title + "?" * (not point.located)


def _stability_lines(arm: cb.Branch) -> Iterator[str]:
    """Say between which of its special points an arm is stable, and on which chain."""
    from contbreather.continuation.events.step_interpolant import between
    from contbreather.stability.verdict import THRESHOLD

    on = f"the {arm[0].lattice.describe()}"
    if arm[0].lattice.sites is not None:
        on += f" (threshold {THRESHOLD})"
    marks = [(i, _name(point)) for i, point in enumerate(arm) if point.kind]
    for (i, first), (j, last) in pairwise(marks):
        # at special points the count is of a multiplier on the circle: rounding decides it
        inside = arm.points[i + 1 : j] or (between(arm[i], arm[j]),)
        counts = {point["unstable"] for point in inside if point is not None}
        if counts:
            numbers = ", ".join(str(count) for count in sorted(counts))
            word = "stable" if counts == {0} else f"unstable, multipliers outside: {numbers},"
            yield f"{first} to {last}: {word} on {on}"


def arms_entry(arms: Sequence[cb.Branch]) -> dict[str, Any]:
    """Write all that leaves a point for JSON."""
    first = arms[0]
    told = [
        {
            **branch_entry(arm),
            "label": arm.problem.label,
            "stability": list(_stability_lines(arm)),
            "end": end_sentences(arm)[-1],
            "image_of": None if arm.image_of is None else arm.image_of + 1,
        }
        for arm in arms
    ]
    at = point_entry(first[0].parent)
    return {"free": first.free, **lives_on(first), "at": at, "arms": told}


def _drawn(parent: cb.Branch, arms: Sequence[cb.Branch]) -> Figure:
    """Draw arms and the branch they leave: p, and what tells both arms apart if they are images."""
    plotting, branches = cb.plotting, (parent, *arms)
    with plotting.style():
        images = any(arm.image_of is not None for arm in arms)
        if not images or not all("p" in branch.names for branch in branches):
            return plotting.plot_diagram(branches).figure
        figure, (above, below) = plotting.new_figure(2)
        plotting.plot_diagram(branches, y="p", ax=above)
        plotting.plot_diagram(branches, ax=below)
    return figure


# --- everywhere -----------------------------------------------------------------------------------


def diagram(
    where: ModelOptions = ModelOptions(),
    *,
    along: BranchWindow,
    depth: Whole = 2,
    most: Whole = 100,
    beyond: bool = False,
    into: SavedOutput = SavedOutput(),
) -> None:
    """Follow the breathers, switch wherever other branches leave, follow these, and so on.

    No branch is in the diagram twice. Ctrl-C ends the work and keeps what there is.

    Parameters
    ----------
    depth
        How often to switch on the way from the first branch to another.
    most
        Number of branches after which no others are followed.
    beyond
        Switch at GR and VI, too: to orbits with an impact more or less.
    """
    into.check(where.read)
    tree, cut = until_interrupted(
        cb.diagram, along.problem(where, switched=True), along.free,
        within=along.within(where), depth=depth, most=most, beyond=beyond, save=into.save,
    )  # fmt: skip
    result = of_diagram(tree)
    loose = (f"{line}." for line in _loose_ends(tree, depth))
    result = result._replace(lines=lambda: chain([tree], loose))
    into.leave(result, cut=cut or tree.interrupted)
    ended = [(i, stop) for i, branch in enumerate(tree) for stop in (branch.began, branch.stop)]
    broken = [i for i, stop in ended if stop is not None and stop.failed]
    if broken or tree.failed:
        lost = [f"branch {i} broke off" for i in broken] + [str(failure) for failure in tree.failed]
        raise NotConverged(f"the diagram is not complete: {'; '.join(lost)}")


def of_diagram(tree: Any, axes: Axes = Axes()) -> Result:
    return Result(
        partial(diagram_entry, tree),
        lambda: [tree],
        lambda: table_of(tree.columns()),
        partial(cb.plotting.plot_diagram, tree, x=axes.x, y=axes.y),
    )


def _loose_ends(tree: Any, depth: int) -> Iterator[str]:
    """List what the tree does not show: arms that lead to a known branch, what is beyond where no
    orbit goes on, points left alone."""
    yield from map(str, (*tree.meetings, *tree.ends))
    begun = {birth.place.name for birth in tree.births if birth.place is not None}
    begun |= {meeting.place.name for meeting in tree.meetings}
    half = [place for place in tree.left if place.name in begun]
    deep = [place for place in tree.left if tree.births[place.branch].depth >= depth]
    rest = [place for place in tree.left if place not in half and place not in deep]
    more = "" if tree.interrupted else "; raise --most"
    left = (("all arms followed of", half, more), ("switched at", rest, more))
    for what, places, way_on in (*left, ("switched at", deep, "; raise --depth")):
        if places:
            yield f"Not {what}: {', '.join(place.name for place in places)}{way_on}"


def diagram_entry(tree: Any) -> dict[str, Any]:
    """Write branches for JSON, and the graph as nodes and edges that name them."""
    places = {place.name: place for row in tree.places for place in row}
    edges = [
        {"from": start, "to": end, "relation": relation}
        for start, end, relation in tree.graph.edges(data="relation")
    ]
    return {
        "free": tree[0].free,
        **lives_on(tree[0]),
        "branches": [
            {"label": branch.problem.label, "depth": birth.depth, **branch_entry(branch)}
            for branch, birth in zip(tree.branches, tree.births, strict=True)
        ],
        "points": {name: point_entry(place.point) for name, place in places.items()},
        "edges": edges,
        "left": [place.name for place in tree.left],
        "failed": [str(failure) for failure in tree.failed],
        "ends": [str(end) for end in tree.ends],
    }
