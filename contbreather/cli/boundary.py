"""`contbreather boundary`: one kind of event as a curve in two parameters."""

from __future__ import annotations

import contbreather as cb
from contbreather.cli.branch import leave
from contbreather.cli.interrupts import kept
from contbreather.cli.options import Axes, ModelOptions, SavedOutput, StepSizes, Window, interval
from contbreather.errors import BadInput
from contbreather.parameters import NEEDED

KINDS = ("LP", "PF", "PD", "NS", "GR")


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
    wanted = _kind(kind)
    on = where.on(*pair)
    first, second = pair
    if first == second:
        raise BadInput(f"--pair {first} {second}: two different parameters are expected")
    params = where.need(*(name for name in NEEDED if name not in pair))
    within = {first: interval(first, window, on.reach), second: interval(second, None, {})}
    options = {**params, **on.given, "within": within, "threshold": on.threshold}
    steps = sizes.steps(largest=0.02)
    seed = cb.orbits.find_event(wanted, pair, **options)
    locus = seed.event.locus if seed.event else None
    axes.check(into.output, seed.curve.problem, *(locus(seed).extra if locus else ()))
    curve, cut = kept(
        cb.continuation.boundary, seed, pair, within=within, steps=steps, save=into.save
    )
    leave(curve, "curve", {"curve": wanted, "pair": pair, **on.entry()}, into, cut, axes)


def _kind(kind: str | None) -> str:
    if kind is None or kind.upper() not in KINDS:
        got = "none was given" if kind is None else f"{kind!r} is not one of them"
        raise BadInput(f"a boundary is of a kind LP, PF, PD, NS or GR; {got}")
    return kind.upper()
