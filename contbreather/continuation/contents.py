"""What can be in a file: a branch, and whatever else somebody enters, as a tree of groups.

The engine enters branches and diagrams; zones and simulated runs are entered where they are known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from ..checks import kind_of
from ..errors import BadInput
from .branch import Branch
from .groups import ABOUT, about, text, written
from .recipes import fetch_all, maker, maker_of

if TYPE_CHECKING:
    from xarray import Dataset, DataTree


class Said(NamedTuple):
    """A value taken apart: what JSON holds of it, columns, and values that are groups of their
    own."""

    about: Mapping[str, Any]
    columns: Mapping[str, Any]
    parts: Mapping[str, Any]


_KINDS: dict[type, tuple[str, Callable[[Any], Said]]] = {}


def content(type_: type, kind: str, said: Callable[[Any], Said]) -> Callable[..., Any]:
    """Enter how values of a type are taken apart, and as what puts one together again a function
    ``made(about, data, parts)`` of what JSON held, a dataset with the columns, and the parts."""
    _KINDS[type_] = kind, said
    return maker(kind)


def keepable() -> str:
    """What can be kept, in words."""
    return ", ".join(["branches", *(f"{kind.removesuffix('s')}s" for kind, _ in _KINDS.values())])


def groups_of(name: str, value: Any, *, recorded: bool | None = True) -> dict[str, Dataset]:
    """The groups of a value by their paths in the file."""
    if isinstance(value, Branch):
        own = written(value, recorded=recorded)
        return {f"{name}/{part}" if part else name: data for part, data in own.items()}
    if type(value) not in _KINDS:
        fetch_all()
    if type(value) not in _KINDS:
        raise BadInput(f"{kind_of(value)} cannot be kept in a file; {keepable()} can")
    from xarray import Dataset

    kind, taken_apart = _KINDS[type(value)]
    said = taken_apart(value)
    json = {"content": kind, "parts": list(said.parts), **said.about}
    attributes = {"content": text(kind)}
    groups = {name: Dataset({ABOUT: about(json), **said.columns}, attrs=attributes)}
    for part, inner in said.parts.items():
        groups |= groups_of(f"{name}/{part}", inner, recorded=recorded)
    return groups


def made_of(group: DataTree, told: Mapping[str, Any], parts: Mapping[str, Any]) -> Any:
    """What was taken apart."""
    made = maker_of(told["content"])
    if made is None:
        raise BadInput(
            f"the file holds {told['content']!r}, which is unknown here; {keepable()} can be"
        )
    return made(told, group.to_dataset(inherit=False), parts)
