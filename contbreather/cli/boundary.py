"""`contbreather boundary`: one kind of event as a curve in two parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from contbreather.cli.interrupts import kept
from contbreather.cli.options import (
    PARAMETERS,
    Csv,
    Json,
    Output,
    RingSites,
    Threshold,
    Where,
    check_values,
    first_in,
    interval,
    known,
    lattice_by,
    lattice_entry,
)
from contbreather.cli.output import check_ends, check_places, leave
from contbreather.errors import BadInput

if TYPE_CHECKING:
    from contbreather.continuation import Event, Point
    from contbreather.lattice import Forcing, Lattice

KINDS = ("LP", "PF", "NS", "GR")


def boundary(
    kind: Annotated[str | None, Parameter(help="LP, PF, NS or GR.")] = None,
    where: Where = Where(),
    *,
    pair: Annotated[tuple[str, str], Parameter(help="The two parameters to vary.", negative="")] = (
        "gamma",
        "a",
    ),
    window: Annotated[
        tuple[float, float] | None,
        Parameter(
            help="Lowest and highest value of the first; 0 to 0.2499 for gamma, 0.01 to 0.999 for "
            "k unless given.",
            negative="",
            allow_leading_hyphen=True,
        ),
    ] = None,
    sites: RingSites = None,
    threshold: Threshold = None,
    csv: Csv = None,
    output: Output = None,
    json: Json = False,
) -> None:
    """A curve of folds (LP), pitchforks (PF), Neimark-Sacker points (NS) or grazings (GR).

    Its first point is found on a branch in the second parameter, at the value of the first one if
    that is given. Past a fold (as NS-LP) it goes on among the breathers with the smaller p; the
    curves of `contbreather zones`, which finds all of all kinds, end there. On a ring the curve of
    NS ends where another of its waves passes the threshold first; `zones` has the whole envelope.
    """
    from contbreather import continuation

    check_places(csv, output)
    wanted = _kind(kind)
    forcing = where.drive(pair)
    _check_pair(pair, forcing)
    span = interval(pair[0], window)
    lattice, modulus = lattice_by(sites, threshold)
    seed = _seed(wanted, pair, where, forcing, span, lattice, modulus)
    within = {pair[0]: span, pair[1]: interval(pair[1], None)}
    steps = continuation.Steps(largest=0.02)
    found, cut = kept(lambda: continuation.boundary(seed, pair, within=within, steps=steps))
    about = {"curve": wanted, "pair": pair, "forcing": forcing.describe()}
    about |= lattice_entry(lattice, modulus)
    leave(found, about, csv, output, json, cut=cut)
    check_ends(found, "curve")


def _kind(kind: str | None) -> str:
    if kind is None or kind.upper() not in KINDS:
        given = "none was given" if kind is None else f"{kind!r} is none of them"
        raise BadInput(f"a boundary is of a kind LP, PF, NS or GR; {given}")
    return kind.upper()


def _check_pair(pair: tuple[str, str], forcing: Forcing) -> None:
    for name in pair:
        known(name, forcing)
    if pair[0] == pair[1]:
        raise BadInput(f"--pair {pair[0]} {pair[1]}: two different parameters are wanted")


def _up_to_the_fold(events: tuple[Event, ...]) -> tuple[Event, ...]:
    """The curve is to begin among the breathers before the fold."""
    return tuple(replace(one, terminal=one.terminal or one.kind == "LP") for one in events)


def _seed(
    kind: str,
    pair: tuple[str, str],
    where: Where,
    forcing: Forcing,
    span: tuple[float, float],
    lattice: Lattice,
    threshold: float,
) -> Point:
    """The first event of the kind on branches in the second parameter."""
    from contbreather.breathers.problem import problem_of
    from contbreather.continuation import trace

    first, free = pair
    fixed = where.need(*(name for name in PARAMETERS if name not in pair))
    check_values(fixed)
    reason = ""
    for value in _values(first, where.given.get(first), span):
        values = {**fixed, first: value} if first in PARAMETERS else fixed
        driven = forcing.at(**{first: value}) if first in forcing.params else forcing
        reach = interval(free, None)
        try:
            start = first_in(free, reach, values, driven, lattice=lattice)
        except BadInput as error:
            reason = str(error)
            continue
        problem = problem_of(start, threshold)
        events = _up_to_the_fold(problem.events)
        branch = trace(problem, free, within={free: reach}, events=events, progress=False)
        for point in branch.special:
            if point.kind == kind and point.located:
                return point
        reason = f"the branch in {free} at {first} = {value:.6g} has {_labels(branch.special)}"
    raise BadInput(f"no {kind} found for {first} between {span[0]:g} and {span[1]:g}; {reason}")


def _labels(points: tuple[Point, ...]) -> str:
    return ", ".join(point.label for point in points) or "no special point"


def _values(name: str, given: float | None, span: tuple[float, float]) -> Iterator[float]:
    """Where to look for a first point: evenly spread, the middle first."""
    if given is not None:
        if not span[0] <= given <= span[1]:
            raise BadInput(
                f"{name} = {given:g} is outside of the window {span[0]:g} to {span[1]:g}"
            )
        yield given
        return
    low, high = max(span[0], -10.0), min(span[1], 1.0 if name == "a" else 10.0)
    for fraction in (0.5, 0.25, 0.75, 0.1, 0.9, 0.4, 0.6, 0.02, 0.98):
        yield low + fraction * (high - low)
