"""Branches in a file: one netCDF-4 file with a group for each, written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .boundary import boundary_problem
from .branch import Branch, Point, Stop, labelled
from .codim2 import fold, hopf
from .events import Event, branch_point
from .newton import Undefined
from .problem import Curve, Problem
from .trail import measure

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

Array = NDArray[Any]

_FORMAT = "branches of contbreather 1"
_DOUBTFUL = "doubtful"
_FITS = 1e-6  # relative residual at which points of a file solve the equations they are given


def save(path: str | Path, *branches: Branch, **named: Branch) -> None:
    """Write branches to one netCDF-4 file, readable by anything that reads netCDF or HDF5.

    Each branch is a group: ``branch1``, ``branch2``, ..., or the name it is given here. Unknowns,
    the free parameter and recorded numbers are variables along the dimension ``point``, fixed
    parameters are scalars. ``point_kind`` says what a point is, as CF flags. Complex numbers have
    a trailing axis (re, im). The file is written beside `path` and then moved there, so that
    an interruption leaves what was there before.

    Raises
    ------
    BadInput
        If there is nothing to write, or `path` cannot be written.

    Examples
    --------
    >>> import contbreather as cb, numpy as np, tempfile, pathlib
    >>> line = cb.Problem(lambda x, p: np.array([x[0] - p["mu"]]), {"x": 0.0}, {"mu": 0.0})
    >>> branch = cb.trace(line, "mu", within={"mu": (-1, 1)})
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "run.nc"
    >>> save(path, branch)
    >>> bool((load(path)["x"] == branch["x"]).all())
    True
    """
    every = {**{f"branch{i}": one for i, one in enumerate(branches, start=1)}, **named}
    for one in every.values():
        if not isinstance(one, Branch):
            raise BadInput(
                f"save writes branches, got a {type(one).__name__}; pass them one by one, "
                "save(path, *branches) for those of a list"
            )
    if not every or len(every) < len(branches) + len(named):
        raise BadInput(f"branches with different names are wanted, got {list(every) or 'none'}")
    groups: dict[str, Dataset] = {}
    for name, branch in every.items():
        groups[f"/{name}"] = _dataset(branch, branch.points, recorded=True)
        if branch.doubtful:
            failed = _dataset(branch, branch.doubtful, recorded=False)
            groups[f"/{name}/{_DOUBTFUL}"] = failed.rename_dims(point=_DOUBTFUL)
    with _whole(Path(path)) as temporary:
        _tree(groups).to_netcdf(temporary, engine="h5netcdf")


def load(path: str | Path, *, problem: Problem | None = None) -> Branch | dict[str, Branch]:
    """Read what `save` wrote: the branch, or all of them by name if there are several.

    Parameters
    ----------
    path : str or Path
        The file.
    problem : Problem, optional
        The equations of the branches (of a boundary: those of the original problem). A file holds
        numbers only: without it a branch has its columns and special points, with it
        it can be continued, traced as a boundary, and asked for ``point.solution``.

    Raises
    ------
    BadInput
        If the file cannot be read or is no file of branches, or if `problem` has other names
        or is not solved by the points.
    """
    import xarray

    try:
        with xarray.open_datatree(path, engine="h5netcdf", decode_cf=False) as tree:
            if tree.attrs.get("format") != _FORMAT:
                raise BadInput(f"{path} holds no branches that `save` wrote")
            found = {name: _branch(group, problem) for name, group in tree.children.items()}
    except OSError as error:  # what HDF5 has to say is not for people
        if error.errno is None:
            raise BadInput(f"cannot read {path}: it is no netCDF-4 file") from error
        raise BadInput(f"cannot read {path}: {os.strerror(error.errno)}") from error
    return next(iter(found.values())) if len(found) == 1 else found


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """A file to write beside `path`; it takes that name when all is on the disk."""
    if path.is_dir():
        raise BadInput(f"cannot write {path}: it is a directory; name a file in it")
    if not path.parent.is_dir():
        raise BadInput(f"cannot write {path}: there is no directory {path.parent}; make it first")
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        os.replace(temporary, path)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise BadInput(f"cannot write {path}: {reason}; choose another place") from error
    finally:
        temporary.unlink(missing_ok=True)


# --- writing ----------------------------------------------------------------------------------


def _tree(groups: Mapping[str, Dataset]) -> DataTree:
    from xarray import Dataset, DataTree

    root = Dataset(attrs={"format": _FORMAT, "Conventions": "CF-1.11"})
    return DataTree.from_dict({"/": root, **groups})


def _dataset(branch: Branch, points: Sequence[Point], *, recorded: bool) -> Dataset:
    from xarray import Dataset

    curve, problem = branch.curve, branch.problem
    part = replace(branch, points=tuple(points))
    variables = {name: _column(name, part[name]) for name in (*problem.start, *curve.free)}
    for name, value in problem.params.items():
        if name not in curve.free:
            variables[name] = ((), float(value), {"role": "fixed"})
    for name in problem.record if recorded else ():
        variables[name] = _column(name, part[name], role="recorded")
    for name, column in _of_points(points).items():
        if name in variables:
            raise BadInput(f"{name!r} is a name that the file needs itself; call yours otherwise")
        variables[name] = column
    together = problem.adjoined
    attributes = {
        "label": problem.label,
        "unknowns": list(problem.start),
        "parameters": list(problem.params),
        "free": curve.free[0],
        "boundary": together.event.kind if together and together.event else "",
        "stop": branch.stop.name,
        "stop_meaning": branch.stop.value,
        "reason": branch.reason,
        "began": branch.began.name if branch.began else "",
        "began_reason": branch.began_reason,
    }
    return Dataset(variables, attrs=attributes)


Variable = tuple[tuple[str, ...], Any, dict[str, Any]]  # dimensions, values, attributes


def _column(name: str, values: Array, **attributes: str) -> Variable:
    """One value for each point; it may be an array, and it may be complex."""
    values = np.asarray(values)
    dimensions = ("point", *(f"{name}_axis{i}" for i in range(1, values.ndim)))
    if values.dtype.kind == "c":
        values = np.stack([values.real, values.imag], axis=-1)
        dimensions = (*dimensions, "complex")
    return dimensions, values, attributes


def _of_points(points: Sequence[Point]) -> dict[str, Variable]:
    """What every point has, and the scalars in `detail` of the special ones."""
    kinds = ["", *sorted({point.kind for point in points} - {""})]
    flags = {
        "flag_values": np.arange(len(kinds), dtype="i1"),
        "flag_meanings": " ".join(["regular", *kinds[1:]]),
    }
    nowhere = (np.nan, np.nan)
    found: dict[str, Variable] = {
        "arclength": _column("", np.array([point.arclength for point in points])),
        "residual": _column("", np.array([point.residual for point in points])),
        "point_tangent": _column("point_tangent", np.stack([point.tangent for point in points])),
        "point_kind": (
            ("point",),
            np.array([kinds.index(point.kind) for point in points], dtype="i1"),
            flags,
        ),
        "point_bracket": (
            ("point", "bracket_end"),
            np.array([point.bracket or nowhere for point in points]),
            {},
        ),
        "point_located": _column("", np.array([point.located for point in points])),
    }
    for name in sorted({name for point in points for name in point.detail}):
        values = [point.detail.get(name) for point in points]
        given = [value for value in values if value is not None]
        if all(isinstance(value, str) for value in given):
            texts = np.array([value or "" for value in values], dtype=object)
            found[f"detail_{name}"] = (("point",), texts, {"role": "detail"})
        elif all(isinstance(value, complex | float | int | np.number) for value in given):
            numbers = np.array([np.nan if value is None else value for value in values])
            found[f"detail_{name}"] = _column("", numbers, role="detail")
    return found


# --- reading ----------------------------------------------------------------------------------


def _branch(group: DataTree, problem: Problem | None) -> Branch:
    data = group.to_dataset()
    curve, events = (_bare(data), ()) if problem is None else _attached(data, problem)
    doubtful = group.children.get(_DOUBTFUL)
    began = str(data.attrs["began"])
    return Branch(
        labelled(tuple(_points(data, curve, events))),
        Stop[str(data.attrs["stop"])],
        Stop[began] if began else None,
        str(data.attrs["reason"]),
        str(data.attrs["began_reason"]),
        tuple(_points(_regular(doubtful), curve, events)) if doubtful else (),
    )


def _regular(doubtful: DataTree) -> Dataset:
    return doubtful.to_dataset(inherit=False).rename_dims({_DOUBTFUL: "point"})


def _bare(data: Dataset) -> Curve:
    """A curve that has its names and numbers, but no equations."""

    def missing(*_: Any) -> Any:
        raise BadInput(
            "this branch was loaded without its equations; load(path, problem=...) attaches them"
        )

    free = str(data.attrs["free"])
    problem = Problem(
        missing,
        {name: _plain(_values(data, name)[0]) for name in _listed(data, "unknowns")},
        {name: float(_values(data, name).flat[0]) for name in _listed(data, "parameters")},
        record=dict.fromkeys(_named(data, "recorded"), missing),
        interpret=missing,
        label=str(data.attrs["label"]),
    )
    curve = Curve(problem, (free,))
    if str(data.attrs["boundary"]):
        curve.varied = (free, list(problem.start)[-1])
    return curve


def _attached(data: Dataset, problem: Problem) -> tuple[Curve, tuple[Event, ...]]:
    """The curve of these points on the equations that were given, and what can happen on it."""
    bare, kind = _bare(data), str(data.attrs["boundary"])
    here = {**bare.problem.start, **bare.problem.params}
    absent = [name for name in problem.names if name not in here]
    if absent:
        raise BadInput(f"the problem has {absent}, which the file has not: it has {list(here)}")
    own = problem.at(**{name: here[name] for name in problem.names})
    free = (_listed(data, "unknowns")[-1], *bare.free) if kind else bare.free
    curve = Curve(own, free)
    try:
        off = float((abs(curve.equations(curve.start)) / curve.rows).max())
    except Undefined as error:
        raise BadInput(f"the points of the file lie outside this problem: {error}") from error
    if off > _FITS:
        raise BadInput(f"the points of the file do not solve this problem: residual {off:.2g}")
    events = (*problem.events, fold(), branch_point(), hopf())
    if kind:
        event = next((one for one in events if one.kind == kind), None)
        if event is None:
            raise BadInput(f"this is a boundary of {kind}, which the problem has no event for")
        ground, pair = Point(curve, curve.start, np.empty(0), 0.0, off), (free[1], free[0])
        events = boundary_problem(ground, event, pair, events).events
        own = boundary_problem(ground, event, pair)
        curve = Curve(own, bare.free)
    if list(own.start) != list(bare.problem.start) or set(own.names) != set(here):
        raise BadInput(f"the file has {list(here)}, the problem has {list(own.names)}")
    return curve, (*own.events, *events)


def _happened(point: Point, events: Sequence[Event]) -> Event | None:
    """The event of a special point: of its kind and, if there are several, the one whose test is
    closest to zero."""
    alike = [event for event in events if event.kind == point.kind]
    if len(alike) > 1:
        return min(alike, key=lambda event: abs(measure(event, point)))
    return alike[0] if alike else None


def _points(data: Dataset, curve: Curve, events: Sequence[Event]) -> Iterator[Point]:
    count = data.sizes["point"]
    columns = [_values(data, name) for name in (*_listed(data, "unknowns"), *curve.free)]
    z = np.concatenate([column.reshape(count, -1) for column in columns], axis=1)
    kinds = ["", *str(data["point_kind"].attrs["flag_meanings"]).split()[1:]]
    details = {name: _values(data, name) for name in _named(data, "recorded", "detail")}
    recorded = set(_named(data, "recorded"))  # where one has no value it is NaN, not absent
    brackets = data["point_bracket"].values.tolist()
    numbers = [data[name].values.tolist() for name in ("arclength", "residual", "point_located")]
    for i, code in enumerate(data["point_kind"].values.tolist()):
        detail = {name.removeprefix("detail_"): _plain(v[i]) for name, v in details.items()}
        point = Point(
            curve,
            z[i].copy(),
            data["point_tangent"].values[i].copy(),
            numbers[0][i],
            numbers[1][i],
            kinds[code],
            bracket=None if np.isnan(brackets[i][0]) else tuple(brackets[i]),
            located=bool(numbers[2][i]),
            detail={n: v for n, v in detail.items() if n in recorded or not _empty(v)},
        )
        yield replace(point, event=_happened(point, events))


def _values(data: Dataset, name: str) -> Array:
    """The numbers of a variable, complex ones put together again."""
    values = np.asarray(data[name].values)
    if data[name].dims[-1:] == ("complex",):
        return np.asarray(values[..., 0] + 1j * values[..., 1])
    return values.astype(bool) if data[name].attrs.get("dtype") == "bool" else values


def _named(data: Dataset, *roles: str) -> list[str]:
    return [str(name) for name in data.variables if data[name].attrs.get("role") in roles]


def _listed(data: Dataset, which: str) -> list[str]:
    return [str(name) for name in np.atleast_1d(data.attrs[which])]


def _plain(value: Any) -> Any:
    """A number as Python's own, an array as it is."""
    return value.item() if isinstance(value, np.generic) else value


def _empty(value: Any) -> bool:
    return bool(value == "") if isinstance(value, str) else np.ndim(value) == 0 and value != value
