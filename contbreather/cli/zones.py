"""`contbreather zones` and `atlas`: the whole diagram of existence and stability, or many."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import contbreather as cb
from contbreather.cli.options import Workers, ZoneOptions, assigned
from contbreather.cli.output import (
    Output,
    Result,
    SavedOutput,
    lives_on,
    model_entry,
    stacked_table,
    table_of,
)
from contbreather.cli.process import until_interrupted
from contbreather.errors import BadInput, add_partial_result

if TYPE_CHECKING:
    from xarray import Dataset

RESTITUTIONS = (0.8, 0.4)  # the paper's


def zones(
    *,
    k: tuple[float, ...] = (),
    gamma: tuple[float, ...] = (),
    a: tuple[float, ...] = (),
    beyond: bool = False,
    plane: ZoneOptions = ZoneOptions(),
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
        Coupling: diagrams in (k, a) instead; one value beside k or a: in (omega, a) or (omega, k).
    a
        Amplitude: diagrams in (k, gamma) instead; one value beside k: in (omega, gamma).
    beyond
        Say of the regions beyond GR without a breather which orbit is there: with other sites that
        impact, or more impacts of the same.
    """
    from contbreather.orbits.zone_search import second_of

    every: dict[str, Any] = {"k": k, "gamma": gamma, "a": a}
    typed = {name: values for name, values in every.items() if values}
    if into == SavedOutput():
        into = SavedOutput(csv="zones.csv", output="zones.png")
    into.check(plane.read)
    if second := second_of(typed):
        if len(typed[second]) != 1:
            raise BadInput(f"--{second}: one value is expected in planes of omega, not several")
        typed[second] = typed[second][0]
    options = {("ks" if name == "k" else name): values for name, values in typed.items()}
    options = {**(options or {"ks": RESTITUTIONS}), **plane.options(typed)}
    diagrams, cut = until_interrupted(_computed, options, beyond, into.save)
    if not any(map(any, diagrams)):
        nothing = cb.orbits.zone_diagram.NO_CURVE
        raise BadInput(f"{nothing} (see contbreather point); widen the window")
    into.leave(of_zones(diagrams, options["within"]), cut=cut)


def of_zones(diagrams: Sequence[cb.orbits.Zones], within: Any = None) -> Result:
    there = [diagram for diagram in diagrams if any(diagram)]
    _, curve = next(iter(there[0]))
    return Result(
        lambda: {**lives_on(curve), "zones": [_entry(diagram) for diagram in diagrams]},
        partial(zones_lines, diagrams),
        # points in order along each curve; `piece` tells curves of one kind apart
        lambda: stacked_table(({}, diagram.columns()) for diagram in there),
        lambda: cb.plotting.plot_zones(diagrams, within=within)[0],
    )


def _computed(options: dict[str, Any], beyond: bool, save: Any) -> tuple[cb.orbits.Zones, ...]:
    from contbreather.continuation.walk.checkpoint import checkpoint
    from contbreather.workers import Failed

    done: list[cb.orbits.Zones | Failed] = []

    def so_far() -> tuple[cb.orbits.Zones, ...] | None:
        there = [drawn for drawn in done if not isinstance(drawn, Failed)]
        return tuple(replace(drawn, beyond=beyond) for drawn in there) or None

    with (
        checkpoint(save, "zones", so_far) as file,
        add_partial_result(lambda drawn: done.extend(drawn[len(done) :])),
    ):
        for result in cb.zones_many(**options):
            if isinstance(result, Failed):
                raise result.error
            done.append(result)
            if file:
                file.look(True, so_far)
        if file:
            file.finish(so_far())
    return so_far() or ()


def _entry(diagram: cb.orbits.Zones) -> dict[str, Any]:
    shown = ("omega", "gamma", "a", "k", "nu", "t")
    curves = [
        {"curve": kind, **{name: branch[name] for name in shown if name in branch.curve.slots},
         "p": branch["p"], "phi": cb.orbits.zone_diagram.phases_on(branch),
         "labels": [point.label for point in branch]}
        for kind, branch in diagram
    ]  # fmt: skip
    attributes = "verdict", "lower", "beyond", "outline"
    regions = [
        {**{name: getattr(region, name) for name in attributes}, "unstable": region.counts}
        for region in diagram.regions
    ]
    losses = {name: diagram.model.get(name) for name in ("damping", "spring")}
    fixed = dict([diagram.fixed]) | {n: value for n, value in losses.items() if value is not None}
    fixed |= diagram.held
    table = diagram.table()  # the codim-2 points, each once
    names = [column.heading for column in table.columns]
    points = [dict(zip(names, row, strict=True)) for row in table.rows]
    return {"fixed": fixed, "pair": diagram.pair, "curves": curves, "points": points,
            "regions": regions}  # fmt: skip


def zones_lines(planes: Sequence[cb.orbits.Zones]) -> Iterator[object]:
    """Say where the curves meet, and how many points they have."""
    table = cb.orbits.zone_diagram.ZoneDiagrams(planes).table()
    yield table if table.rows else "No two curves meet there."
    for plane in planes:
        sizes = ", ".join(f"{kind} {sum(map(len, c))}" for kind, c in plane.curves.items() if c)
        cut = "; interrupted, curves may be missing" if plane.interrupted else ""
        at = ", ".join(f"{n} = {x:g}" for n, x in {**dict([plane.fixed]), **plane.held}.items())
        yield f"Points on the curves at {at}: {sizes}{cut}."
        for told in plane.sentences():
            drawn = plane.beyond or "damping" in plane.model
            yield f"{told}." if drawn else f"{told}; --past-folds draws them."


# --- many diagrams --------------------------------------------------------------------------------


def atlas(
    *,
    k: tuple[str, ...] = (),
    gamma: tuple[str, ...] = (),
    a: tuple[str, ...] = (),
    over: tuple[str, ...] = (),
    plane: ZoneOptions = ZoneOptions(),
    workers: Workers | None = None,
    save: str | None = None,
    into: Output = Output(),
) -> None:
    """Surfaces of LP, GR, PF and NS: a zone diagram for each of many values.

    Without files and without --json it writes atlas.png and atlas.nc.

    Parameters
    ----------
    k
        Restitution: diagrams in (gamma, a) at VALUE,VALUE,... or LOW:HIGH:COUNT, so many at equal
        distances.
    gamma
        Coupling: diagrams in (k, a) instead.
    a
        Amplitude: diagrams in (k, gamma) instead.
    over
        NAME=VALUE,VALUE,... or NAME=LOW:HIGH:COUNT of a parameter in the formula.
    workers
        Number of processes, all cores unless given.
    save
        Write the atlas to this netCDF file.
    """
    from contbreather.checks import values_by
    from contbreather.orbits.atlas import save_atlas

    if into == Output() and save is None:
        into, save = Output(output="atlas.png"), "atlas.nc"
    into.check(plane.read, save=save)
    typed = {"k": k, "gamma": gamma, "a": a}
    fixed = {n: values_by(f"--{n}", ",".join(texts)) for n, texts in typed.items() if texts}
    wanted = "NAME=VALUE,VALUE,... was expected, c3=0,0.1 for instance"
    further = assigned("--over", over, lambda n, words: values_by(f"--over {n}", words), wanted)
    begin = tuple(f"{name}={values[0]!r}" for name, values in further.items())
    plane = replace(plane, set=(*plane.set, *begin))
    options = {**plane.options(fixed), "executor": workers, **fixed}
    entry = model_entry(plane.verge(options["lattice"]), **plane.on(), varied=further)
    for name in further:
        if name in options:
            raise BadInput(f"--over {name}: this name is taken; rename it in the formula")
    dataset, cut = until_interrupted(cb.atlas, **{**options, **further})
    lost = {name: options[name] for name in ("damping", "spring") if options[name]}
    written = [] if save is None else [str(save_atlas(save, dataset))]
    columns = _columns(dataset)
    result = Result(
        lambda: {**entry, **lost, "atlas": columns, "failed": _failed(dataset)},
        partial(_atlas_lines, dataset),
        lambda: table_of(columns),
        partial(cb.plotting.plot_atlas, dataset),
    )
    into.leave(result, cut=cut, others=written)


def _columns(dataset: Dataset) -> dict[str, Any]:
    """Columns along points, with words in place of their numbers."""
    from contbreather.orbits.atlas import words

    columns: dict[str, Any] = {
        str(n): c.to_numpy() for n, c in dataset.items() if c.dims == ("point",)
    }
    return {**columns, "kind": words(dataset, "kind"), "meeting": words(dataset, "meeting")}


def _failed(dataset: Dataset) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = dataset.drop_dims("point").to_dataframe().to_dict("records")
    return rows


def _atlas_lines(dataset: Dataset) -> Iterator[object]:
    kinds = _columns(dataset)["kind"]
    counts = ", ".join(f"{kinds.count(kind)} points of {kind}" for kind in dict.fromkeys(kinds))
    count = len({*dataset.slice.values.tolist()})
    yield f"{count} diagram{'s' if count > 1 else ''}: {counts}."
    for row in _failed(dataset):
        at = ", ".join(
            f"{n.removeprefix('failed_')} = {v:g}" for n, v in row.items() if n != "reason"
        )
        yield f"No diagram at {at}: {row['reason'].rstrip('.')}."
