"""`contbreather boundary`: one kind of event as a curve in two parameters."""

from __future__ import annotations

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
    interval,
    known,
)
from contbreather.cli.output import check_ends, check_places, leave
from contbreather.errors import BadInput

if TYPE_CHECKING:
    from contbreather.lattice import Forcing

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
    from contbreather.breathers import find_event

    check_places(csv, output)
    wanted = _kind(kind)
    on = where.on(sites, threshold, pair)
    _check_pair(pair, on.forcing)
    given = where.need(*(name for name in PARAMETERS if name not in pair))
    within = {pair[0]: interval(pair[0], window, on.reach), pair[1]: interval(pair[1], None, {})}
    seed = find_event(wanted, pair, within=within, threshold=on.threshold, **{**given, **on.given})
    steps = continuation.Steps(largest=0.02)
    found, cut = kept(lambda: continuation.boundary(seed, pair, within=within, steps=steps))
    leave(found, {"curve": wanted, "pair": pair, **on.entry()}, csv, output, json, cut=cut)
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
