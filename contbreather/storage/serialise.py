"""Values as nested dicts of plain values and arrays, and back: `to_dict` and `from_dict`.

A dict has the ``kind`` it is of, and what that kind is made of; a result has ``columns`` besides,
and ``groups``, dicts of its parts. Whoever has a type enters how it becomes a dict and what reads
one. Nothing in a dict is ever executed: a kind that nobody entered is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from inspect import isfunction
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from contbreather.checks import MOST, brief
from contbreather.errors import BadInput

Content = Mapping[str, Any]
Reader = TypeVar("Reader", bound=Callable[..., Any])


class NotSerialisable(Exception):
    """This has no dict: a function of the user's own, for instance."""


_WRITERS: dict[type, tuple[str, Callable[[Any], Content]]] = {}
_READERS: dict[str, Callable[..., Any]] = {}
_LATER: list[str] = []


def serialised(
    kind: str, type_: type | None = None, content: Callable[[Any], Content] = vars
) -> Callable[[Reader], Reader]:
    """Enter what reads the dicts of a kind, ``reader(**values)``, and how values of a type, not of
    those derived from it, become one.

    Examples
    --------
    >>> from fractions import Fraction
    >>> content = lambda ratio: {"numerator": ratio.numerator, "denominator": ratio.denominator}
    >>> _ = serialised("ratio", Fraction, content)(Fraction)
    >>> to_dict(Fraction(2, 3))
    {'kind': 'ratio', 'numerator': 2, 'denominator': 3}
    >>> from_dict(to_dict(Fraction(2, 3)))
    Fraction(2, 3)
    """

    def enter(reader: Reader) -> Reader:
        _READERS[kind] = reader
        if type_ is not None:
            _WRITERS[type_] = kind, content
        return reader

    return enter


def later(*modules: str) -> None:
    """Register modules to import before anything is unknown: they enter more kinds."""
    _LATER.extend(modules)


def _is_known(key: type | str) -> bool:
    while key not in _WRITERS and key not in _READERS and _LATER:
        import_module(_LATER.pop(0))
    return key in _WRITERS or key in _READERS


def to_dict(value: Any) -> Any:
    """A value as JSON and columns have it; `NotSerialisable` carries one that has no dict."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Mapping):
        return {name: to_dict(inner) for name, inner in value.items()}
    if type(value) is list:
        return [to_dict(inner) for inner in value]
    if hasattr(value, "to_dict"):  # what others are made of, and no kind by itself
        return value.to_dict()
    if not _is_known(type(value)):
        raise NotSerialisable(value)
    kind, content = _WRITERS[type(value)]
    return {"kind": kind, **content(value)}


def can_read(content: Content | None) -> bool:
    """Test whether this is a dict of a kind that is known here."""
    return content is not None and _is_known(content["kind"])


def from_dict(content: Any, **more: Any) -> Any:
    """The value of a dict, with what else its reader takes; refused where its kind is unknown, or
    the reader does not take what is in it."""
    if not isinstance(content, Mapping):
        return content
    values = {
        name: inner if name in ("columns", "groups") else from_dict(inner)
        for name, inner in content.items()
    }
    if not isinstance(content.get("kind"), str):
        return values
    kind = values.pop("kind")
    if not _is_known(kind):
        raise BadInput(f"{kind!r} is of no kind that is known here; update contbreather")
    reader = _READERS[kind]
    if isfunction(reader) and values.keys() & {"columns", "groups"}:  # a result
        check_types(values, get_type_hints(reader))
    try:
        return reader(**values, **more)
    except BadInput:
        raise
    except (ArithmeticError, LookupError, ValueError, TypeError, AttributeError) as error:
        what = f"a {kind} of {[*values]}"
        raise BadInput(f"{what} cannot be made again: {error!r}") from error


# --- what is in a dict ----------------------------------------------------------------------------


def check_types(content: Content, hints: Mapping[str, Any]) -> None:
    """Refuse values that are not of the types that whoever reads them has declared."""
    for name, value in content.items():
        if not _fits(value, hints.get(name, Any)):
            raise BadInput(f"its contents are not as `save` writes them: {name} = {brief(value)}")


def _fits(value: Any, hint: Any) -> bool:
    kind, inside = get_origin(hint) or hint, get_args(hint)
    if kind is Any:
        return True
    if kind in (Union, UnionType):
        return any(_fits(value, one) for one in inside)
    if kind is Literal:
        return isinstance(value, str) and value in inside
    if kind is float:  # of JSON, or of a column
        return isinstance(value, float) or (type(value) is int and abs(value) <= MOST)
    if kind is int:
        return type(value) is int and abs(value) <= MOST
    if kind in (list, tuple) and inside:
        each = inside * len(value) if kind is list and isinstance(value, list) else inside
        several = isinstance(value, list | tuple) and len(value) == len(each)
        return several and all(map(_fits, value, each))
    if isinstance(value, Mapping) and inside:
        return all(_fits(inner, inside[1]) for inner in value.values())
    return isinstance(value, type(None) if kind is None else kind)
