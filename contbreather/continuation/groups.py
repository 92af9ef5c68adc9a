"""A branch as a group of variables for a file: columns for anybody, and what it takes to go on.

What others read are variables along the dimension ``point``. What only this package needs, which
equations these are and how the walk was asked for, is one text in JSON, the variable `ABOUT`. Text
is bytes everywhere, and truth is 0 or 1: netCDF's own strings and booleans are lost on Octave.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .branch import Branch, Settings
from .cycles import Iterate
from .extended import event_of
from .point import Event
from .points import Points
from .problem import Problem

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

Array = NDArray[Any]
Variable = tuple[tuple[str, ...], Any, dict[str, Any]]  # dimensions, values, attributes

ABOUT = "about_in_json"
DOUBTFUL, ORIGIN = "doubtful", "origin"
LONGEST = 200  # bytes of a name: netCDF takes 256, and some get an ending here
_TEXT = 20_000  # bytes of an attribute: HDF5 takes 64 kB


def written(branch: Branch, *, recorded: bool | None = True) -> dict[str, Dataset]:
    """The group of a branch, with those of its doubtful points and of the point it was born from.

    Parameters
    ----------
    branch : Branch
    recorded : bool or None
        Whether to ask for the recorded columns, which may take as long as the branch itself; None
        where the file has no equations that give them later.
    """
    points = Points.of(branch.points)
    if recorded is None:
        recorded = _equations(branch.problem) is None
    groups = {"": _dataset(branch, points, branch.problem.record if recorded else ())}
    if branch.doubtful:
        failed = _dataset(branch, Points.of(branch.doubtful))
        groups[DOUBTFUL] = failed.rename_dims(point=DOUBTFUL)
    if branch.origin is not None:
        alone = Branch((branch.origin,), branch.stop)
        data = _dataset(alone, Points.of(alone.points))
        # xarray wants dimensions of one name to have one size in a group and in those inside it
        groups[ORIGIN] = data.rename_dims({name: f"{ORIGIN}_{name}" for name in data.sizes})
    return groups


def check_names(what: str, names: Iterable[str]) -> None:
    """Refuse what netCDF takes for a path, or for its own, or not at all."""
    for name in names:
        good = isinstance(name, str) and name.isprintable() and name == name.strip()
        good = good and "/" not in name and name not in ("", ".", "..")
        good = good and len(name.encode()) <= LONGEST and not name.startswith("_nc4_")
        if not good:
            raise BadInput(
                f"{name!r} cannot be the name of a {what} in a file: at most {LONGEST} printable "
                "bytes without / were expected, and not . or ..; choose another name"
            )


def about(content: Mapping[str, Any]) -> Variable:
    """JSON as a variable."""
    return (), np.array(json.dumps(content, separators=(",", ":")).encode()), {}


def about_in(group: DataTree) -> dict[str, Any]:
    """What `about` said of a group."""
    content: dict[str, Any] = json.loads(group.dataset[ABOUT].values.tobytes())
    return content


def text(given: str) -> np.bytes_:
    """Text as HDF5 and all that read it take it, neither null bytes nor what is no character."""
    image = given.replace("\0", r"\0").encode(errors="backslashreplace")
    return np.bytes_(image[:_TEXT].decode(errors="ignore").encode())


def _dataset(branch: Branch, points: Points, record: Iterable[str] = ()) -> Dataset:
    from xarray import Dataset

    curve, problem = branch.curve, branch.problem
    slots = curve.slots.items()
    variables = {name: column(name, points.z[:, slot], "unknown") for name, slot in slots}
    variables[curve.free[0]][2]["role"] = text("free")
    for name, value in problem.params.items():
        if name not in curve.free:
            variables[name] = ((), float(value), {"role": text("fixed")})
    for name in record:
        variables[name] = column(name, points.recorded(name), "recorded")
    for name, one in {**_of_points(points), ABOUT: about(_about(branch, points, record))}.items():
        if name in variables:
            raise BadInput(f"{name!r} is a name that the file needs itself; choose another")
        variables[name] = one
    check_names("column", variables)
    own = {"point", DOUBTFUL, *(d for one in variables.values() for d in one[0])}
    if taken := sorted(own & set(variables)):
        raise BadInput(f"{taken[0]!r} is a name that the file needs itself; choose another")
    return Dataset(variables, attrs=_attributes(branch))


def _attributes(branch: Branch) -> dict[str, Any]:
    """For people; what is empty is left out."""
    event = event_of(branch.problem)
    said = {
        "label": branch.problem.label,
        "free": branch.free,
        "boundary": event.kind if event else "",
        "stop": branch.stop.name,
        "stop_meaning": branch.stop.value,
        "reason": branch.reason,
        "began": branch.began.name if branch.began else "",
        "began_reason": branch.began_reason,
    }
    return {name: text(value) for name, value in said.items() if value}


def _about(branch: Branch, points: Points, record: Iterable[str]) -> dict[str, Any]:
    problem, event = branch.problem, event_of(branch.problem)
    base = _base(problem)
    return {
        "content": "branch",
        "label": problem.label,
        "unknowns": list(problem.start),
        "parameters": list(problem.params),
        "recorded": list(record),
        "free": list(branch.curve.free),
        "boundary": event_plain(event) if event else None,
        "stop": branch.stop.name,
        "reason": branch.reason,
        "began": branch.began.name if branch.began else None,
        "began_reason": branch.began_reason,
        "image_of": branch.image_of,
        "kinds": _kinds(points),
        "located": [i for i, point in points.made.items() if not point.located],
        "detail": {i: _json(point.detail) for i, point in points.made.items() if point.detail},
        "parent": bool(points[0].parent),
        "point_label": points[0].label,
        "period": base.residual.period if isinstance(base.residual, Iterate) else None,
        "equations": _equations(problem),
        "base": [list(base.start), list(base.params)],
        "settings": _settings(branch.settings),
    }


def _base(problem: Problem) -> Problem:
    """Of a boundary the original problem."""
    found: Problem = getattr(problem.residual, "problem", problem) if event_of(problem) else problem
    return found


def _equations(problem: Problem) -> dict[str, Any] | None:
    """What they are made of, if that can be said."""
    recipe = _base(problem).recipe
    return None if recipe is None else recipe.said()


def _settings(given: Settings | None) -> dict[str, Any] | None:
    if given is None:
        return None
    asked = given.events
    return {
        "within": {name: [float(one) for one in ends] for name, ends in given.within.items()},
        "events": None if asked is None else [event_plain(event) for event in asked],
        "steps": asdict(given.steps),
        "inadmissible": given.inadmissible,
    }


def event_plain(event: Event) -> dict[str, Any]:
    """An event by its kind, and by what it was made of where that can be said."""
    said = event.recipe and event.recipe.said()
    return said or {"kind": event.kind, "ends": event.ends}


def column(name: str, values: Array, role: str = "") -> Variable:
    """One value for each point; it may be an array, complex, or true and false."""
    dimensions = ("point", *(f"{name}_axis{i}" for i in range(1, values.ndim)))
    attributes: dict[str, Any] = {"role": text(role)} if role else {}
    if values.dtype.kind == "c":
        values = np.stack([values.real, values.imag], axis=-1)
        dimensions = (*dimensions, "complex")
    elif values.dtype.kind == "b":
        values, attributes["flag_meanings"] = values.astype("i1"), text("false true")
        attributes["flag_values"] = np.arange(2, dtype="i1")
    return dimensions, values, attributes


def _kinds(points: Points) -> list[str]:
    return ["", *sorted({point.kind for point in points.made.values()} - {""})]


def _of_points(points: Points) -> dict[str, Variable]:
    """What every point has, and the numbers and words in `detail` of the special ones."""
    kinds, made = _kinds(points), points.made
    codes = np.zeros(len(points), dtype="i1")
    brackets = np.full((len(points), 2), math.nan)
    located = np.ones(len(points), dtype=bool)
    for i, point in made.items():
        codes[i], located[i] = kinds.index(point.kind), point.located
        brackets[i] = point.bracket or brackets[i]
    words = ["regular", *("_".join(kind.split()) for kind in kinds[1:])]  # CF parts them at blanks
    flags = {
        "flag_values": np.arange(len(kinds), dtype="i1"),
        "flag_meanings": text(" ".join(words)),
    }
    found: dict[str, Variable] = {
        "arclength": column("", points.arclength),
        "residual": column("", points.residual),
        "point_tangent": column("point_tangent", points.tangent),
        "point_kind": (("point",), codes, flags),
        "point_bracket": (("point", "bracket_end"), brackets, {}),
        "point_located": column("", located),
    }
    for name in sorted({name for point in made.values() for name in point.detail}):
        values = {i: point.detail[name] for i, point in made.items() if name in point.detail}
        if all(isinstance(value, str) for value in values.values()):
            cells = [text(values.get(i, "")) for i in range(len(points))]
            found[f"detail_{name}"] = (("point",), np.array(cells), {"role": text("detail")})
        elif all(isinstance(value, complex | float | int | np.number) for value in values.values()):
            numbers = np.full(len(points), math.nan, dtype=np.result_type(*values.values(), float))
            numbers[list(values)] = list(values.values())
            found[f"detail_{name}"] = column("", numbers, "detail")
    return found


# --- details: numbers, words, arrays, and lists and dicts of these -------------------------------


def _json(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        parts = [value.real.tolist(), value.imag.tolist()] if value.dtype.kind == "c" else None
        return {"complex array": parts} if parts else {"array": value.tolist()}
    if isinstance(value, complex | np.complexfloating):
        return {"complex": [float(value.real), float(value.imag)]}
    if isinstance(value, Mapping):
        return {"dict": {str(name): _json(one) for name, one in value.items()}}
    if isinstance(value, list | tuple):
        return [_json(one) for one in value]
    if isinstance(value, np.generic):
        return value.item()
    return value if value is None or isinstance(value, bool | int | float | str) else None


def from_json(value: Any) -> Any:
    """What `_json` made of a detail."""
    if isinstance(value, list):
        return [from_json(one) for one in value]
    if not isinstance(value, Mapping):
        return value
    ((kind, content),) = value.items()
    if kind == "dict":
        return {name: from_json(one) for name, one in content.items()}
    if kind == "complex":
        return complex(*content)
    if kind == "array":
        return np.array(content)
    return np.array(content[0]) + 1j * np.array(content[1])
