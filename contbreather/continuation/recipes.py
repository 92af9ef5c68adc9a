"""Equations, and events, as plain data: how a file says which they are, and who makes them again.

The engine does not know what is kept: whoever builds problems or events enters a maker for each
kind of them. A file holds the name of the kind and numbers; nothing in it is ever executed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from ..errors import BadInput
from .newton import OUT_OF_DOMAIN


def _as_it_is(value: Any) -> Any:
    return value


@dataclass(frozen=True)
class Recipe:
    """What equations (or an event) are made of: a kind, which has a maker, and what that needs.

    ``plain(value)`` says by numbers and names what is not a number, a name or a list of these.
    """

    kind: str
    of: Mapping[str, Any]
    plain: Callable[[Any], Any] = _as_it_is

    def said(self) -> dict[str, Any] | None:
        """What JSON takes; None where it cannot be said."""
        try:
            return {"kind": self.kind, **{name: self.plain(v) for name, v in self.of.items()}}
        except NotPlain:
            return None


class NotPlain(Exception):
    """This cannot be said by numbers and names: a function of the user's own, for instance."""


_MAKERS: dict[str, Callable[..., Any]] = {}
Make = TypeVar("Make", bound=Callable[..., Any])


def maker(kind: str) -> Callable[[Make], Make]:
    """Enter a function as what makes a kind of equations or events again.

    Examples
    --------
    >>> @maker("straight line")
    ... def line(of, start, params):
    ...     return of["slope"]
    >>> remade(Recipe("straight line", {"slope": 2.0}).said(), {}, {})
    2.0
    """

    def entered(made: Make) -> Make:
        _MAKERS[kind] = made
        return made

    return entered


_ELSEWHERE: list[Callable[[], object]] = []


def elsewhere(fetch: Callable[[], object]) -> None:
    """Say what to call, an import, where a kind is unknown: it enters more makers."""
    _ELSEWHERE.append(fetch)


def fetch_all() -> None:
    """See to it that all makers are entered."""
    while _ELSEWHERE:
        _ELSEWHERE.pop()()


def maker_of(kind: str) -> Callable[..., Any] | None:
    """What makes a kind, if that is known."""
    if kind not in _MAKERS:
        fetch_all()
    return _MAKERS.get(kind)


def remade(said: Mapping[str, Any] | None, *more: Any) -> Any:
    """What a recipe said, made again; None if that is nothing, or of a kind unknown here.

    Raises
    ------
    BadInput
        If it is not what its maker takes.
    """
    if said is None:
        return None
    made = maker_of(said["kind"])
    if made is None:
        return None
    try:
        return made(said, *more)
    except BadInput:
        raise
    except (*OUT_OF_DOMAIN, LookupError, TypeError, AttributeError) as error:
        what = f"a {said['kind']} of {[*said][1:]}"
        raise BadInput(f"{what} cannot be made again: {error!r}") from error
