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
from .recipes import all_fetched, fetched

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

Parts = Mapping[str, Any]


class Said(NamedTuple):
    """A value taken apart: what JSON holds of it, columns, and values that are groups of their
    own."""

    about: Mapping[str, Any]
    columns: Mapping[str, Any]
    parts: Parts


class Content(NamedTuple):
    """One kind of value: ``said(value)`` takes it apart, ``made(about, data, parts)`` puts it
    together again."""

    kind: str
    said: Callable[[Any], Said]
    made: Callable[[Mapping[str, Any], Dataset, Parts], Any]


_OF_TYPE: dict[type, Content] = {}


def content(type_: type, kind: str, said: Callable[[Any], Said]) -> Callable[..., Any]:
    """Enter a function as what puts values of a type together again."""

    def entered(made: Callable[..., Any]) -> Callable[..., Any]:
        _OF_TYPE[type_] = Content(kind, said, made)
        return made

    return entered


def keepable() -> str:
    """What can be kept, in words."""
    return ", ".join(["branches", *(f"{one.kind.removesuffix('s')}s" for one in _OF_TYPE.values())])


def groups_of(name: str, value: Any, *, recorded: bool | None = True) -> dict[str, Dataset]:
    """The groups of a value by their paths in the file."""
    if isinstance(value, Branch):
        own = written(value, recorded=recorded)
        return {f"{name}/{part}" if part else name: data for part, data in own.items()}
    if type(value) not in _OF_TYPE:
        all_fetched()
    known = _OF_TYPE.get(type(value))
    if known is None:
        raise BadInput(f"{kind_of(value)} cannot be kept in a file; {keepable()} can")
    from xarray import Dataset

    said = known.said(value)
    json = {"content": known.kind, "parts": list(said.parts), **said.about}
    attributes = {"content": text(known.kind)}
    groups = {name: Dataset({ABOUT: about(json), **said.columns}, attrs=attributes)}
    for part, inner in said.parts.items():
        groups |= groups_of(f"{name}/{part}", inner, recorded=recorded)
    return groups


def made_of(group: DataTree, told: Mapping[str, Any], parts: Parts) -> Any:
    """What was taken apart."""
    fetched(told["content"])
    for known in _OF_TYPE.values():
        if known.kind == told["content"]:
            return known.made(told, group.to_dataset(inherit=False), parts)
    raise BadInput(
        f"the file holds {told['content']!r}, which is unknown here; {keepable()} can be"
    )
