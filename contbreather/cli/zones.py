"""`contbreather zones`: the whole diagram of existence and stability."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import contbreather as cb
from contbreather.cli.interrupts import kept
from contbreather.cli.options import FiniteLattice, SavedOutput, ZoneWindows
from contbreather.cli.output import Table, table_of
from contbreather.errors import BadInput

RESTITUTIONS = (0.8, 0.4)  # the paper's
FIGURE, TABLE = "zones.png", "zones.csv"


def zones(
    *,
    k: tuple[float, ...] = (),
    gamma: tuple[float, ...] = (),
    a: tuple[float, ...] = (),
    plane: ZoneWindows = ZoneWindows(),
    where: FiniteLattice = FiniteLattice(),
    into: SavedOutput = SavedOutput(),
) -> None:
    """Zone diagrams: limits of existence LP and GR, of stability PF and NS, where they meet.

    Without files and without --json it writes zones.png and zones.csv.

    Parameters
    ----------
    k
        Restitution, one diagram in (gamma, a) for each; 0.8 and 0.4 unless another parameter is
        given.
    gamma
        Coupling: diagrams in (k, a) instead.
    a
        Amplitude: diagrams in (k, gamma) instead.
    """
    from contbreather.parameters import parameter

    name, values = _fixed(k, gamma, a)
    for value in values:
        parameter(name, value)
    if into == SavedOutput():
        into = SavedOutput(csv=TABLE, output=FIGURE)
    into.check({"--lattice": where.lattice})
    on, windows = plane.on(**vars(where)), plane.within
    options: dict[str, Any] = {"ks" if name == "k" else name: values, "within": windows}
    options |= {"lattice": on.lattice, "threshold": on.threshold, "forcing": on.forcing}
    options |= {"past_folds": plane.past_folds, **on.more, **where.losses}
    diagrams, cut = kept(_computed, options, into.save)
    if not any(branches for diagram in diagrams for branches in diagram.curves.values()):
        nothing = cb.orbits.zone_diagram.NO_CURVE
        raise BadInput(f"{nothing} (see contbreather point); widen the window")
    into.leave(
        lambda: {**on.entry(), "zones": [diagram_entry(diagram) for diagram in diagrams]},
        _lines(diagrams),
        lambda: curves_table(diagrams),
        lambda: cb.plotting.plot_zones(diagrams, within=windows)[0],
        cut=cut,
    )


def _computed(options: dict[str, Any], save: Any) -> tuple[cb.orbits.Zones, ...]:
    """All diagrams, over the cores where that pays."""
    from contbreather.continuation.checkpoint import checkpoint
    from contbreather.workers import Failed

    done: list[cb.orbits.Zones] = []
    with checkpoint(save, "zones") as file:
        for result in cb.zones_many(**options):
            if isinstance(result, Failed):
                raise result.error
            done.append(result)
            file.look(True, lambda: tuple(done))
        file.finish(tuple(done))
    return tuple(done)


def _fixed(
    k: tuple[float, ...], gamma: tuple[float, ...], a: tuple[float, ...]
) -> tuple[str, tuple[float, ...]]:
    """The parameter that is fixed, and its values."""
    typed = {name: values for name, values in {"k": k, "gamma": gamma, "a": a}.items() if values}
    if not typed:
        return "k", RESTITUTIONS
    if len(typed) > 1:
        raise BadInput(
            f"zones are drawn with one parameter fixed, but {' and '.join(typed)} were given; "
            "leave one"
        )
    return next(iter(typed.items()))


def curves_table(diagrams: Sequence[cb.orbits.Zones]) -> Table:
    """Points of all curves, in order along each; `piece` tells curves of one kind apart."""
    from contbreather.columns import stacked

    nonempty = (diagram for diagram in diagrams if any(diagram.curves.values()))
    return table_of(stacked(({}, diagram.columns()) for diagram in nonempty))


def _columns(branch: cb.Branch) -> dict[str, Any]:
    names = ("gamma", "a", "k", "p", "nu", "t")
    columns = {name: branch[name] for name in names if name in branch.curve.slots}
    return {**columns, "p": branch["p"], "phi": cb.orbits.zone_diagram.phase(branch)}


def diagram_entry(diagram: cb.orbits.Zones) -> dict[str, Any]:
    curves = [
        {"curve": kind, **_columns(branch), "labels": [point.label for point in branch]}
        for kind, branches in diagram.curves.items()
        for branch in branches
    ]
    regions = [
        {
            "verdict": region.verdict,
            "unstable": region.counts,
            "lower": region.lower,
            "outline": region.outline,
        }
        for region in diagram.regions
    ]
    losses = {name: diagram.model.get(name) for name in ("damping", "spring")}
    fixed = dict([diagram.fixed]) | {n: value for n, value in losses.items() if value is not None}
    return {"fixed": fixed, "pair": diagram.pair, "curves": curves,
            "points": list(_points(diagram)), "regions": regions}  # fmt: skip


def _points(diagram: cb.orbits.Zones) -> Iterator[dict[str, Any]]:
    """The codim-2 points, each once."""
    table = diagram.table()
    names = [column.heading for column in table.columns]
    return (dict(zip(names, row, strict=True)) for row in table.rows)


def _lines(planes: Sequence[cb.orbits.Zones]) -> Iterator[object]:
    """Where the curves meet, and how many points they have."""
    table = planes[0].table().further(*(row for plane in planes[1:] for row in plane.table().rows))
    yield table if table.rows else "No two curves meet there."
    for plane in planes:
        sizes = ", ".join(f"{kind} {sum(map(len, c))}" for kind, c in plane.curves.items() if c)
        cut = "; interrupted, curves may be missing" if plane.interrupted else ""
        yield f"Points on the curves at {plane.fixed[0]} = {plane.fixed[1]:g}: {sizes}{cut}."
        for told in plane.told():
            yield f"{told}." if "damping" in plane.model else f"{told}; --past-folds draws them."
