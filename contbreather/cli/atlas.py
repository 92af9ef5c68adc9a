"""`contbreather atlas`: zone diagrams over one or two further parameters, as surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import contbreather as cb
from contbreather.cli.interrupts import kept
from contbreather.cli.options import FiniteLattice, Output, Workers, ZoneWindows, letter, once
from contbreather.cli.output import table_of
from contbreather.errors import BadInput

if TYPE_CHECKING:
    from xarray import Dataset

FIGURE, DATA = "atlas.png", "atlas.nc"


def atlas(
    *,
    k: tuple[str, ...] = (),
    gamma: tuple[str, ...] = (),
    a: tuple[str, ...] = (),
    over: tuple[str, ...] = (),
    plane: ZoneWindows = ZoneWindows(),
    where: FiniteLattice = FiniteLattice(),
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
        into, save = Output(output=FIGURE), DATA
    into.check({"--lattice": where.lattice}, save=save)
    typed = {"k": k, "gamma": gamma, "a": a}
    fixed = {n: values_by(f"--{n}", ",".join(texts)) for n, texts in typed.items() if texts}
    further = once("--over", map(_assigned, over))
    begin = tuple(f"{name}={values[0]!r}" for name, values in further.items())
    on = plane.on(*begin, **vars(where))
    options: dict[str, Any] = {
        "lattice": on.lattice,
        "threshold": on.threshold,
        "forcing": on.forcing,
        "within": plane.within,
        "past_folds": plane.past_folds,
        "executor": workers,
        **on.more,
        **where.losses,
        **fixed,
    }
    for name in further:
        if name in options:
            raise BadInput(f"--over {name}: this name is taken; rename it in the formula")
    dataset, cut = kept(cb.atlas, **{**options, **further})
    lost = {name: value for name, value in where.losses.items() if value}
    written = [] if save is None else [str(save_atlas(save, dataset))]
    into.leave(
        lambda: {**on.entry(), **lost, "atlas": _columns(dataset), "failed": _failed(dataset)},
        [*_lines(dataset), *(f"Wrote {path}." for path in written)],
        lambda: table_of(_columns(dataset)),
        lambda: cb.plotting.plot_atlas(dataset),
        cut=cut,
    )


def _assigned(text: str) -> tuple[str, list[float]]:
    from contbreather.checks import values_by

    name, equals, values = text.partition("=")
    if not equals:
        raise BadInput(f"--over {text!r}: NAME=VALUE,VALUE,... was expected, c3=0,0.1 for instance")
    return letter(name), values_by(f"--over {name}", values)


def _columns(dataset: Dataset) -> dict[str, Any]:
    """Those along points, words in place of their numbers."""
    from contbreather.orbits.atlas import words

    columns: dict[str, Any] = {
        str(n): c.to_numpy() for n, c in dataset.items() if c.dims == ("point",)
    }
    return {**columns, "kind": words(dataset, "kind"), "meeting": words(dataset, "meeting")}


def _failed(dataset: Dataset) -> list[dict[str, Any]]:
    columns = {str(n): c.to_numpy() for n, c in dataset.items() if c.dims == ("failed",)}
    return [dict(row) for row in table_of(columns)[0]]


def _lines(dataset: Dataset) -> Iterator[object]:
    """How many there are, and what is missing."""
    kinds = _columns(dataset)["kind"]
    counts = ", ".join(f"{kinds.count(kind)} points of {kind}" for kind in dict.fromkeys(kinds))
    count = len({*dataset.slice.values.tolist()})
    yield f"{count} diagram{'s' if count > 1 else ''}: {counts}."
    for row in _failed(dataset):
        at = ", ".join(
            f"{n.removeprefix('failed_')} = {v:g}" for n, v in row.items() if n != "reason"
        )
        yield f"No diagram at {at}: {row['reason'].rstrip('.')}."
