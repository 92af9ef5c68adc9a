"""`contbreather point`, `branch` and `boundary`: one breather, curves of them in one parameter, of
events in two."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import contbreather as cb
from contbreather.cli.options import (
    Axes,
    BranchWindow,
    ModelArguments,
    ModelOptions,
    StepSizes,
    Whole,
    Window,
    typed_interval,
)
from contbreather.cli.output import (
    Output,
    SavedOutput,
    branch_entry,
    branch_table,
    check_ends,
    lines_of,
    lives_on,
    say,
    sentences,
    to_json,
)
from contbreather.cli.process import until_interrupted
from contbreather.errors import BadInput, NotConverged
from contbreather.parameters import NAMES, NEEDED

if TYPE_CHECKING:
    from contbreather.tables import Sheet

KINDS = ("LP", "PF", "PD", "NS", "GR")


def point(
    where: ModelOptions = ModelOptions(),
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

    values, rule = where.need(*NEEDED), where.on()
    # of a point, --sites asks for a ring besides the infinite chain
    on = rule if where.lattice else replace(where, sites=None, threshold=None).on()
    roots: tuple[Any, ...] = cb.orbits.symmetric_roots(**{**values, **on.given})
    breather = rooted(roots, root)
    others = [other for other in roots if other is not breather]
    verdicts = _verdicts(breather, on, rule)
    content = _content(breather, on, verdicts, others, where.sites)
    proof = breather.certify() if certify else None
    if proof is not None:
        content["certificate"] = asdict(proof)
    if json:
        to_json({**content, "root": roots.index(breather) + 1})
    else:
        say(_table(breather, verdicts[0]))
        say(*_sentences(breather, verdicts, others), *([] if proof is None else [proof.describe()]))
    if proof is not None and proof.unproved:
        raise NotConverged(f"not all is proved: {'; '.join(proof.unproved)}")


def _verdicts(breather: Any, on: ModelArguments, rule: ModelArguments) -> list[Any]:
    """On its own lattice, and by the paper's rule if that was asked for besides."""
    if on.lattice.sites is not None:
        return [breather.stability(threshold=on.threshold)]
    if rule.lattice.sites is None:
        return [breather.stability()]
    ring = {"sites": rule.lattice.sites, "threshold": rule.threshold}
    return [breather.stability(), breather.stability(**ring)]


def _content(
    breather: Any, on: ModelArguments, verdicts: list[Any], others: list[Any], sites: int | None
) -> dict[str, Any]:
    verdict, margins = verdicts[0], breather.admissibility()
    # what goes through a wall is no motion of the lattice, be its linearisation what it may
    judged = margins.ok
    content: dict[str, Any] = {
        **{name: getattr(breather, name) for name in NAMES},
        **on.entry(),
        **{name: getattr(breather, name) for name in ("p", "phi", "chi")},
        "admissible": margins.ok,
        "max_neighbour": margins.max_neighbour,
        "margin": margins.margin,
        "reason": margins.reason,
        "stable": verdict.stable if judged else None,
        "unstable": verdict.unstable if judged else None,
        "other_roots": [
            {"p": other.p, "phi": other.phi, "admissible": other.admissibility().ok}
            for other in others
        ],
    }
    if on.lattice.sites is not None:
        return {**content, "largest": verdict.largest if judged else None}
    names = ("certain", "over_reflecting", "multipliers")
    content |= {name: getattr(verdict, name) for name in names}
    for ring in verdicts[1:]:
        content["ring"] = {
            "sites": sites,
            "threshold": ring.threshold,
            "largest": ring.largest,
            "unstable": ring.unstable if judged else None,
        }
    return content


def _table(breather: Any, verdict: Any) -> Sheet:
    judged = breather.lattice.sites is None and breather.admissibility().ok
    isolated = verdict.multipliers if judged else ()
    rows = [("isolated multiplier of QS", f"{mu:.12g}") for mu in isolated]
    return replace(breather.table().further(*rows), title="Symmetric breather")


def _sentences(breather: Any, verdicts: list[Any], others: list[Any]) -> list[str]:
    margins = breather.admissibility()
    lines = [margins.reason]
    if margins.ok:
        lines += [verdict.describe() for verdict in verdicts]
    else:
        lines.append("nothing is said of its stability: the lattice has no such motion")
    if others:
        roots = (
            f"p = {root.p:.9g} ({'' if root.admissibility().ok else 'not '}admissible)"
            for root in others
        )
        lines.append(f"further roots of (11): {', '.join(roots)}")
    return sentences(lines)


# --- curves ---------------------------------------------------------------------------------------


def branch(
    where: ModelOptions = ModelOptions(),
    along: BranchWindow = BranchWindow(),
    *,
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
    steps, start = sizes.steps(), along.start(where, root)
    axes.check(into.output, start.problem)
    options: dict[str, Any] = {"within": start.within, "towards": towards, "save": into.save}
    traced, cut = until_interrupted(
        cb.continuation.trace, start.problem, start.free, steps=steps, **options
    )
    leave(traced, "branch", into, cut, axes)


def boundary(
    kind: str | None = None,
    where: ModelOptions = ModelOptions(),
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
    if kind is None or kind.upper() not in KINDS:
        got = "none was given" if kind is None else f"{kind!r} is not one of them"
        raise BadInput(f"a boundary is of a kind LP, PF, PD, NS or GR; {got}")
    on = where.on(*pair)
    first, second = pair
    if first == second:
        raise BadInput(f"--pair {first} {second}: two different parameters are expected")
    params = where.need(*(name for name in NEEDED if name not in pair))
    within = {
        first: typed_interval(first, window, on.reach),
        second: typed_interval(second, None, {}),
    }
    options = {**params, **on.given, "within": within, "threshold": where.threshold}
    steps = sizes.steps(largest=0.02)
    seed = cb.orbits.find_event(kind.upper(), pair, **options)
    locus = seed.event.locus if seed.event else None
    axes.check(into.output, seed.curve.problem, *(locus(seed).extra if locus else ()))
    curve, cut = until_interrupted(
        cb.continuation.boundary, seed, pair, within=within, steps=steps, save=into.save
    )
    leave(curve, "curve", into, cut, axes)


def curve_entry(branch: cb.Branch) -> dict[str, Any]:
    """A branch or a boundary for JSON."""
    if branch.problem.beneath is None:
        about: dict[str, Any] = {"free": branch.free}
    else:
        kind = branch.problem.label.partition(" ")[0]
        about = {"curve": kind, "pair": branch.curve.varied}
    return {**about, **lives_on(branch), **branch_entry(branch)}


def leave(
    branch: cb.Branch,
    what: str,
    into: Output,
    cut: bool,
    axes: Axes = Axes(),
    entry: Callable[[cb.Branch], Mapping[str, Any]] = curve_entry,
) -> None:
    """All that is wanted of one branch or boundary; raise if it broke off."""
    into.leave(
        partial(entry, branch),
        lines_of(branch),
        partial(branch_table, [branch]),
        partial(axes.plot, branch),
        cut=cut,
    )
    check_ends(branch, what)
