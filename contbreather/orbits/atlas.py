"""Many zone diagrams, over the cores, and an atlas of them: over further parameters their curves
make surfaces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contbreather.checks import check_kind, combinations, kind_of, row
from contbreather.errors import BadInput, add_partial_result, partial_result
from contbreather.files import writable
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.conditions import Walls
from contbreather.lattice.forcing import Drive, Forcing
from contbreather.lattice.formula import forcing_of
from contbreather.lattice.parse import as_typed
from contbreather.orbits.zone_diagram import KINDS, NO_CURVE, Zones, phases_on
from contbreather.orbits.zone_search import PAIRS, second_of
from contbreather.orbits.zones import zones
from contbreather.parameters import parameter
from contbreather.storage.netcdf import ATLAS, checked_file, fill_group
from contbreather.workers import Failed, each

if TYPE_CHECKING:
    from xarray import Dataset

Variable = tuple[str, Any, dict[str, Any]]  # dimension, values, attributes

COLUMNS = ("gamma", "a", "k", "p")
MEANINGS = {
    "kind": "which limit of the breather the point is on",
    "meeting": "the limits that meet there",
    "curve": "number of the curve, its points in order along it",
    "slice": "number of the diagram",
}


def zones_many(
    ks: float | Sequence[float] | None = None,
    *,
    gamma: float | Sequence[float] | None = None,
    a: float | Sequence[float] | None = None,
    over: Mapping[str, float | Sequence[float]] | None = None,
    forcing: Drive | None = None,
    lattice: UniformLattice | None = None,
    within: Mapping[str, tuple[float, float]] | None = None,
    threshold: float | None = None,
    past_folds: bool = False,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
    omega: float = 1.0,
    executor: Executor | int | None = None,
    progress: bool | None = None,
) -> Iterator[Zones | Failed]:
    """The zone diagrams of many values of k, over the cores of the machine.

    Parameters
    ----------
    ks, gamma, a : sequence of float
        Values of exactly one of the three: each diagram is in the plane of the other two. With one
        value of gamma, or else of a, besides: in that of the frequency and the third.
    over : dict, optional
        Values of parameters of the forcing, ``{"c3": (0.1, 0.2)}``: a diagram for each of `ks` with
        each of them, in the order of `itertools.product`, the last one fastest.
    forcing, lattice, within, threshold, past_folds, site, damping, spring, walls, omega
        As of `zones`, for all of them.
    executor, progress
        As of `trace_many`.

    Yields
    ------
    Zones or Failed
        In order, as they come, each as `zones` alone finds it; `Failed`, with its ``reason``, for
        values that `zones` refuses or where a worker died twice.

    Raises
    ------
    BadInput
        If not exactly one parameter has values, or `over` names none of the forcing.
    Interrupted
        On Ctrl-C; its ``partial`` is a tuple of the diagrams up to there.

    Examples
    --------
    >>> window = {"gamma": (0.0, 0.05)}
    >>> for diagram in zones_many([0.7, 0.8], within=window, executor=1):
    ...     print(diagram)
    <Zones of upper breathers in ('gamma', 'a') at k = 0.7; LP: 1, GR: 1, PF: 1, NS: 0>
    <Zones of upper breathers in ('gamma', 'a') at k = 0.8; LP: 1, GR: 1, PF: 1, NS: 0>
    """
    # planes beforehand: what is refused is refused before a worker begins
    values = {name: of for name, of in {"k": ks, "gamma": gamma, "a": a}.items() if of is not None}
    second = second_of(values)
    held: dict[str, Any] = {second: parameter(second, values.pop(second))} if second else {}
    slices = slices_of(values, over, forcing)
    draw = partial(
        drawn_in_plane, lattice=lattice, within=within, threshold=threshold, past_folds=past_folds,
        site=site, damping=damping, spring=spring, walls=walls, omega=omega, **held,
    )  # fmt: skip
    return each(draw, slices, executor=executor, progress=progress, unit="diagrams")


@dataclass(frozen=True)
class Slice:
    """One plane: the parameter that is fixed with its value, and the forcing."""

    name: str
    value: float
    forcing: Forcing


def drawn_in_plane(where: Slice, **shared: Any) -> Zones:
    fixed: dict[str, Any] = {where.name: where.value}
    diagram: Zones = zones(**fixed, forcing=where.forcing, **shared, progress=False)
    return diagram


def slices_of(
    values_of: Mapping[str, float | Sequence[float] | None],
    over: Mapping[str, float | Sequence[float]] | None,
    forcing: Drive | None,
) -> list[Slice]:
    """List the planes, those of the first value first."""
    over = {} if over is None else over
    check_kind(over, Mapping, "a dict of parameters of the forcing with their values")
    fixed = {name: values for name, values in values_of.items() if values is not None}
    if len(fixed) != 1:
        raise BadInput(
            f"many diagrams need values of exactly one of {', '.join(PAIRS)}, got "
            f"{', '.join(fixed) or 'none'}"
        )
    ((name, values),) = fixed.items()
    drive = forcing_of(forcing)
    for other in over:
        if other not in drive.params:
            have = ", ".join(drive.params) or "none"
            raise BadInput(f"no parameter {other!r} of the forcing {drive!r}; it has {have}")
    axes = {name: values, **over}
    grid = {axis: row(axis, of, "values of it").tolist() for axis, of in axes.items()}
    # what is left beside the fixed parameter belongs to the forcing
    return [Slice(name, at.pop(name), drive.at(**at) if at else drive) for at in combinations(grid)]


def atlas(
    *,
    k: float | Sequence[float] | None = None,
    gamma: float | Sequence[float] | None = None,
    a: float | Sequence[float] | None = None,
    forcing: Drive | None = None,
    lattice: UniformLattice | None = None,
    within: Mapping[str, tuple[float, float]] | None = None,
    threshold: float | None = None,
    past_folds: bool = False,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
    omega: float = 1.0,
    executor: Executor | int | None = None,
    progress: bool | None = None,
    **over: float | Sequence[float],
) -> Dataset:
    """Surfaces of LP, GR, PF and NS in three parameters or more: zone diagrams, one by one.

    Parameters
    ----------
    k, gamma, a : float or sequence of float
        Exactly one: each diagram is in the plane of the other two.
    **over : float or sequence of float
        Values of parameters of the forcing, ``c3=(0.0, 0.1, 0.2)``; a diagram for each combination.
    forcing, lattice, within, threshold, past_folds, site, damping, spring, walls, omega
        As of `zones`, for all of them.
    executor, progress
        As of `zones_many`.

    Returns
    -------
    xarray.Dataset
        Along ``point``: ``gamma``, ``a``, ``k``, the parameters in `over`, ``p`` and ``phi`` of the
        breather; ``kind`` (LP, GR, PF, NS) and ``meeting`` (the kind of point where two limits
        meet, NS-GR for instance) as numbers with `flag_values` and `flag_meanings`; ``curve``
        and ``slice`` are numbers, from 0. Along ``failed``: values of which there is no diagram,
        with the ``reason``. Attributes say what all of it is of, and whether it was interrupted.
        `contbreather.plotting.plot_atlas` draws it.

    Raises
    ------
    BadInput
        As `zones_many`; or if there is no diagram at all.
    Interrupted
        On Ctrl-C; its ``partial`` is the atlas as far as it got.

    Examples
    --------
    >>> table = atlas(k=[0.7, 0.8], within={"gamma": (0.0, 0.03)}, executor=1)
    >>> table.sizes["point"] > 400, table.kind.attrs["flag_meanings"]
    (True, 'LP GR PF NS')
    >>> fold = table.where(table.kind == 0, drop=True)
    >>> round(float(fold.a.sel(point=(fold.k == 0.8) & (fold.gamma == 0.0)).item()), 9)
    0.070559228
    """
    slices = slices_of({"k": k, "gamma": gamma, "a": a}, over, forcing)
    diagrams = zones_many(
        k, gamma=gamma, a=a, over=over, forcing=forcing, lattice=lattice, within=within,
        threshold=threshold, past_folds=past_folds, site=site, damping=damping, spring=spring,
        walls=walls, omega=omega, executor=executor, progress=progress,
    )  # fmt: skip
    done: list[Zones | Failed] = []
    with (
        partial_result(lambda: surfaces(slices, done) if done else None),
        add_partial_result(lambda piece: done.extend(piece[len(done) :])),
    ):
        for diagram in diagrams:
            done.append(diagram)
    return surfaces(slices, done)


def surfaces(slices: Sequence[Slice], diagrams: Sequence[Zones | Failed]) -> Dataset:
    """The points of many diagrams in one table, with what they are."""
    from xarray import Dataset

    if all(isinstance(diagram, Failed) for diagram in diagrams):
        none = BadInput("an atlas needs values of at least one parameter")
        raise next((d.error for d in diagrams if isinstance(d, Failed)), none)
    over = tuple(slices[0].forcing.params)
    curves = [
        (i, kind, branch)
        for i, diagram in enumerate(diagrams)
        if isinstance(diagram, Zones)
        for kind, branch in diagram
    ]
    if not curves:
        raise BadInput(f"{NO_CURVE}; widen the window")
    names = (*COLUMNS, *over)
    numbers = {name: np.concatenate([b[name] for _, _, b in curves]) for name in names}
    numbers["phi"] = np.concatenate([phases_on(branch) for _, _, branch in curves])
    sizes = [len(branch) for _, _, branch in curves]
    numbers["curve"] = np.repeat(np.arange(len(curves), dtype="i4"), sizes)
    numbers["slice"] = np.repeat(np.array([i for i, _, _ in curves], dtype="i4"), sizes)
    kinds = np.repeat([kind for _, kind, _ in curves], sizes).tolist()
    # where two limits meet the kind of the point names both, NS-GR
    meetings = [p.kind if "-" in p.kind else "" for _, _, b in curves for p in b]
    columns: dict[str, Variable] = {name: ("point", row, {}) for name, row in numbers.items()}
    columns["kind"] = _coded(kinds, KINDS)
    columns["meeting"] = _coded(meetings, ("", *sorted({*meetings} - {""})))
    for name, meaning in MEANINGS.items():
        columns[name][2]["long_name"] = meaning
    about = _about(slices[0], diagrams)
    whole = sum(isinstance(diagram, Failed) or not diagram.interrupted for diagram in diagrams)
    if whole < len(slices):
        about["interrupted"] = f"after {whole} of {len(slices)} diagrams"
    return Dataset({**columns, **_failed(slices, diagrams, over)}, attrs=about)


def _coded(words: Sequence[str], vocabulary: Sequence[str]) -> Variable:
    """Words as numbers, with what each of them means, as CF has it."""
    shown = " ".join(word or "none" for word in vocabulary)
    flags = {"flag_values": np.arange(len(vocabulary), dtype="i1"), "flag_meanings": shown}
    return "point", np.array([vocabulary.index(word) for word in words], dtype="i1"), flags


def _failed(
    slices: Sequence[Slice], diagrams: Sequence[Zones | Failed], over: Sequence[str]
) -> dict[str, Variable]:
    """Values that have no diagram, and why."""
    # strict=False: of an atlas that was interrupted the last slices have no diagram
    pairs = [(s, d) for s, d in zip(slices, diagrams, strict=False) if isinstance(d, Failed)]
    fixed = slices[0].name
    columns: dict[str, Variable] = {f"failed_{fixed}": ("failed", [s.value for s, _ in pairs], {})}
    for name in over:
        columns[f"failed_{name}"] = ("failed", [s.forcing.params[name] for s, _ in pairs], {})
    columns["reason"] = ("failed", np.array([d.reason for _, d in pairs], "U"), {})
    return columns


def _about(first: Slice, diagrams: Sequence[Zones | Failed]) -> dict[str, Any]:
    zones = next(z for z in diagrams if isinstance(z, Zones) and any(z.curves.values()))
    on = zones.model
    about = {
        "format": ATLAS,
        "Conventions": "CF-1.11",
        "fixed": first.name,
        "plane": " ".join(zones.pair),
        "over": " ".join(first.forcing.params),
        "forcing": first.forcing.describe(),
        "lattice": on["lattice"].describe(),
        **{name: on[name] for name in ("damping", "spring", "site") if on.get(name)},
        "walls": as_typed(on.get("walls", Walls())),
        "threshold": zones.threshold if on["lattice"].sites else 0,
        **zones.held,  # omega for instance
    }
    return {name: text for name, text in about.items() if text}


def words(atlas: Dataset, name: str) -> list[str]:
    """A column of numbers with flags as words, empty where it says none."""
    vocabulary = [
        "" if word == "none" else word for word in atlas[name].attrs["flag_meanings"].split()
    ]
    return [vocabulary[code] for code in atlas[name].to_numpy().tolist()]


def check_atlas(atlas: object) -> None:
    if "plane" not in getattr(atlas, "attrs", ()):
        raise BadInput(f"an atlas was expected, as contbreather.atlas makes; got {kind_of(atlas)}")


def save_atlas(path: str | Path, atlas: Dataset) -> Path:
    """Write an atlas to a netCDF-4 file, whole or not at all; anything that reads netCDF or HDF5
    reads it, ``xarray.open_dataset(path, decode_cf=False)`` for instance."""
    check_atlas(atlas)
    columns = {name: (v.dims, v.values, v.attrs) for name, v in atlas.variables.items()}
    with checked_file(target := writable(path)) as file:
        fill_group(file, columns, atlas.attrs)
    return target
