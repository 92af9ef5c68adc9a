"""Many zone diagrams at once, over the cores: `zones_many`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

from contbreather.checks import check_kind, combinations, row
from contbreather.errors import BadInput
from contbreather.lattice import Forcing, Lattice, forcing_of
from contbreather.orbits.zone_diagram import Zones
from contbreather.orbits.zone_search import PAIRS
from contbreather.orbits.zones import zones
from contbreather.stability.verdict import THRESHOLD
from contbreather.workers import Failed, each


def zones_many(
    ks: Sequence[float] | None = None,
    *,
    gamma: Sequence[float] | None = None,
    a: Sequence[float] | None = None,
    over: Mapping[str, Sequence[float]] | None = None,
    forcing: Forcing | str | None = None,
    lattice: Lattice | None = None,
    within: Mapping[str, tuple[float, float]] | None = None,
    threshold: float = THRESHOLD,
    past_folds: bool = False,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
    executor: Executor | int | None = None,
    progress: bool | None = None,
) -> Iterator[Zones | Failed]:
    """The zone diagrams of many values of k, over the cores of the machine.

    Parameters
    ----------
    ks, gamma, a : sequence of float
        Values of exactly one of the three: each diagram is in the plane of the other two.
    over : dict, optional
        Values of parameters of the forcing, ``{"c3": (0.1, 0.2)}``: a diagram for each of `ks` with
        each of them, in the order of `itertools.product`, the last one fastest.
    forcing, lattice, within, threshold, past_folds, site, damping, spring, walls
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
    slices = slices_of({"k": ks, "gamma": gamma, "a": a}, over, forcing)
    on: dict[str, Any] = {"site": site, "damping": damping, "spring": spring, "walls": walls}
    shared: dict[str, Any] = {"lattice": lattice, "within": within, "threshold": threshold}
    draw = partial(drawn, **shared, past_folds=past_folds, **on)
    return each(draw, slices, executor=executor, progress=progress, unit="diagrams")


@dataclass(frozen=True)
class Slice:
    """One plane: the parameter that is fixed with its value, and the forcing."""

    name: str
    value: float
    forcing: Forcing


def drawn(where: Slice, **shared: Any) -> Zones:
    """The diagram in one plane."""
    fixed: dict[str, Any] = {where.name: where.value}
    diagram: Zones = zones(**fixed, forcing=where.forcing, **shared, progress=False)
    return diagram


def slices_of(
    values_of: Mapping[str, float | Sequence[float] | None],
    over: Mapping[str, float | Sequence[float]] | None,
    forcing: Forcing | str | None,
) -> list[Slice]:
    """All planes, those of the first value first."""
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
