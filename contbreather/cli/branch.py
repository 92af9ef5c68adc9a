"""`contbreather branch` and `boundary`: curves of breathers in one parameter, of events in two."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import contbreather as cb
from contbreather.cli.options import (
    Axes,
    BranchWindow,
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
)
from contbreather.cli.process import until_interrupted
from contbreather.errors import BadInput
from contbreather.parameters import NEEDED

KINDS = ("LP", "PF", "PD", "NS", "GR")


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
    leave(traced, "branch", start.entry(), into, cut, axes)


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
    leave(curve, "curve", {"curve": kind.upper(), "pair": pair, **on.entry()}, into, cut, axes)


def leave(
    branch: cb.Branch,
    what: str,
    about: Mapping[str, Any],
    into: Output,
    cut: bool,
    axes: Axes = Axes(),
) -> None:
    """All that is wanted of one branch or boundary; raise if it broke off."""
    into.leave(
        lambda: {**about, **branch_entry(branch)},
        lines_of(branch),
        lambda: branch_table([branch]),
        lambda: axes.plot(branch),
        cut=cut,
    )
    check_ends(branch, what)
