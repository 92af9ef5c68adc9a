"""Branches in a file: one netCDF-4 file with a group for each, written whole or not at all.

It ends with the checksum of all bytes before, which HDF5 does not look at. Nothing is read from a
file that has another one: of what is damaged HDF5 makes other numbers, or goes on for ever.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..checks import kind_of
from ..errors import BadInput
from ..files import opened, write_whole
from .boundary import boundary_problem
from .branch import Branch, Stop, labelled
from .curve import Curve
from .equilibria import branch_point, fold, hopf
from .extended import event_of
from .newton import Undefined
from .point import Event, Point
from .problem import Problem, problem_in
from .trail import measure

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

    from .trace import Startable

Array = NDArray[Any]

_FORMAT = "branches of contbreather 2"
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_SEAL = b"\nsha256 of all bytes before: %s\n"
_SEALED = len(_SEAL % bytes(64))
_LONGEST = 200  # bytes of a name: netCDF takes 256, and some get an ending here
_DOUBTFUL = "doubtful"
_FITS = 1e-6  # relative residual at which points of a file solve the equations they are given


def save(path: str | Path, *branches: Branch, **named: Branch) -> None:
    """Write branches to one netCDF-4 file, readable by anything that reads netCDF or HDF5.

    Each branch is a group: ``branch1``, ``branch2``, ..., or the name it is given here. Unknowns,
    the free parameter and recorded numbers are variables along the dimension ``point``, fixed
    parameters are scalars. ``point_kind`` says what a point is, as CF flags. Complex numbers have
    a trailing axis (re, im). The file is written beside `path` and then moved there, so that
    an interruption leaves what was there before; its last line is the checksum of the rest.

    Raises
    ------
    BadInput
        If there is nothing to write, a name is none for netCDF, or `path` cannot be written.

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
                f"save writes branches, got {kind_of(one)}; pass them one by one, "
                "save(path, *branches) for those of a list"
            )
    if not every or len(every) < len(branches) + len(named):
        raise BadInput(f"branches with different names are wanted, got {list(every) or 'none'}")
    groups: dict[str, Dataset] = {}
    _check_names("branch", every)
    for name, branch in every.items():
        groups[f"/{name}"] = _dataset(branch, branch.points, recorded=True)
        if branch.doubtful:
            failed = _dataset(branch, branch.doubtful, recorded=False)
            groups[f"/{name}/{_DOUBTFUL}"] = failed.rename_dims(point=_DOUBTFUL)
    # in memory first: where a disk is full, HDF5 ends the interpreter
    image = _image(groups)
    write_whole(path, lambda file: file.writelines((image, _SEAL % _checksum(image))))


def load(
    path: str | Path, *, problem: Problem | Startable | None = None
) -> Branch | dict[str, Branch]:
    """Read what `save` wrote: the branch, or all of them by name if there are several.

    Parameters
    ----------
    path : str or Path
        The file.
    problem : Problem, Orbit or Point, optional
        The equations of the branches (of a boundary: those of the original problem). A file holds
        numbers only: without it a branch has its columns and special points, with it
        it can be continued, traced as a boundary, and asked for ``point.solution``.

    Raises
    ------
    BadInput
        If the file cannot be read, is no file of branches or is damaged, or if `problem` has
        other names or is not solved by the points.
    """
    import xarray

    own = None if problem is None else problem_in(problem)
    image = io.BytesIO(_verified(path))
    with xarray.open_datatree(image, engine="h5netcdf", decode_cf=False) as tree:
        if tree.attrs.get("format") != _FORMAT:
            raise BadInput(f"{path} holds no branches that `save` wrote")
        found = {name: _branch(group, own) for name, group in tree.children.items()}
    return next(iter(found.values())) if len(found) == 1 else found


def _checksum(image: bytes) -> bytes:
    return hashlib.sha256(image).hexdigest().encode()


def _verified(path: str | Path) -> bytes:
    """The netCDF part of a file that `save` wrote, if it is as it was."""
    with opened(path) as file:
        if file.read(len(_SIGNATURE)) != _SIGNATURE:
            raise BadInput(f"cannot read {path}: it is not a netCDF-4 file")
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - _SEALED))
        seal = file.read()
        if not (seal.startswith(_SEAL[:-3]) and seal.endswith(_SEAL[-1:])):
            raise BadInput(
                f"{path} holds no branches that `save` wrote, or it has lost its end: the checksum "
                "that should be there is not"
            )
        file.seek(0)
        image = file.read(size - _SEALED)
    if seal != _SEAL % _checksum(image):
        raise BadInput(
            f"{path} is damaged: its checksum is not the one that `save` wrote; restore a copy"
        )
    return image


# --- writing ----------------------------------------------------------------------------------


def _image(groups: Mapping[str, Dataset]) -> bytes:
    """The bytes of a netCDF-4 file."""
    from xarray import Dataset, DataTree

    root = Dataset(attrs={"format": _FORMAT, "Conventions": "CF-1.11"})
    tree = DataTree.from_dict({"/": root, **groups})
    return bytes(tree.to_netcdf(engine="h5netcdf"))


def _check_names(what: str, names: Iterable[str]) -> None:
    """Refuse what netCDF takes for a path, or for its own, or not at all."""
    for name in names:
        good = isinstance(name, str) and name.isprintable() and name == name.strip()
        good = good and "/" not in name and name not in ("", ".", "..")
        good = good and len(name.encode()) <= _LONGEST and not name.startswith("_nc4_")
        if not good:
            raise BadInput(
                f"{name!r} cannot be the name of a {what} in a file: at most {_LONGEST} printable "
                "bytes without / were wanted, and not . or ..; choose another name"
            )


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
            raise BadInput(f"{name!r} is a name that the file needs itself; choose another")
        variables[name] = column
    _check_names("column", variables)
    own = {"point", _DOUBTFUL, *(d for one in variables.values() for d in one[0])}
    if taken := sorted(own & set(variables)):
        raise BadInput(f"{taken[0]!r} is a name that the file needs itself; choose another")
    event = event_of(problem)
    attributes = {
        "label": _text(problem.label),
        "unknowns": list(problem.start),
        "parameters": list(problem.params),
        "free": curve.free[0],
        "boundary": event.kind if event else "",
        "stop": branch.stop.name,
        "stop_meaning": branch.stop.value,
        "reason": _text(branch.reason),
        "began": branch.began.name if branch.began else "",
        "began_reason": _text(branch.began_reason),
        "image_of": -1 if branch.image_of is None else branch.image_of,
    }
    return Dataset(variables, attrs=attributes)


def _text(text: str) -> str:
    """As HDF5 takes it: neither null bytes nor what is no character."""
    return text.encode(errors="backslashreplace").decode().replace("\0", r"\0")


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
    texts = [_text(kind) for kind in kinds]
    flags = {
        "flag_values": np.arange(len(kinds), dtype="i1"),
        "flag_meanings": " ".join(["regular", *("_".join(kind.split()) for kind in texts[1:])]),
        "kinds": texts,  # CF parts its words at blanks, which ours may hold
    }
    nowhere = (np.nan, np.nan)
    found: dict[str, Variable] = {
        "arclength": _column("", np.array([point.arclength for point in points])),
        "residual": _column("", np.array([point.residual for point in points])),
        "point_tangent": _column("point_tangent", np.stack([_tangent(point) for point in points])),
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
            words = np.array([_text(value or "") for value in values], dtype=object)
            found[f"detail_{name}"] = (("point",), words, {"role": "detail"})
        elif all(isinstance(value, complex | float | int | np.number) for value in given):
            numbers = np.array([np.nan if value is None else value for value in values])
            found[f"detail_{name}"] = _column("", numbers, role="detail")
    return found


# --- reading ----------------------------------------------------------------------------------


def _branch(group: DataTree, problem: Problem | None) -> Branch:
    data = group.to_dataset()
    curve, events = (_bare(data), ()) if problem is None else _attached(data, problem)
    doubtful = group.children.get(_DOUBTFUL)
    failed = doubtful and doubtful.to_dataset(inherit=False)
    began = str(data.attrs["began"])
    return Branch(
        labelled(tuple(_points(data, curve, events))),
        Stop[str(data.attrs["stop"])],
        Stop[began] if began else None,
        str(data.attrs["reason"]),
        str(data.attrs["began_reason"]),
        tuple(_points(failed.rename_dims({_DOUBTFUL: "point"}), curve, events)) if failed else (),
        data.attrs["image_of"] if data.attrs["image_of"] >= 0 else None,
    )


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
        ground, pair = Point(curve, curve.start), (free[1], free[0])
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
    kinds = [str(kind) for kind in np.atleast_1d(data["point_kind"].attrs["kinds"])]
    details = {name: _values(data, name) for name in _named(data, "recorded", "detail")}
    recorded = set(_named(data, "recorded"))  # where one has no value it is NaN, not absent
    tangents = data["point_tangent"].values
    brackets = data["point_bracket"].values.tolist()
    numbers = [data[name].values.tolist() for name in ("arclength", "residual", "point_located")]
    for i, code in enumerate(data["point_kind"].values.tolist()):
        detail = {name.removeprefix("detail_"): _plain(v[i]) for name, v in details.items()}
        point = Point(
            curve,
            z[i].copy(),
            None if np.isnan(tangents[i]).any() else tangents[i].copy(),
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


def _tangent(point: Point) -> Array:
    return np.full(point.z.size, np.nan) if point.tangent is None else point.tangent


def _plain(value: Any) -> Any:
    """A number as Python's own, an array as it is."""
    return value.item() if isinstance(value, np.generic) else value


def _empty(value: Any) -> bool:
    return bool(value == "") if isinstance(value, str) else np.ndim(value) == 0 and value != value
