"""What a notebook asks of a value.

Pictures are drawn on a higher floor, and values must not know it: they ask a painter, which the
front desk hands in.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from .tables import Sheet


class HtmlRepr:
    """A value that notebooks show as a small picture and a table."""

    __slots__ = ()
    painter: ClassVar[Callable[[Any], str] | None] = None

    def table(self) -> Sheet:
        """What it consists of, for people: in a terminal, a notebook and the explorer."""
        raise NotImplementedError

    def _repr_html_(self) -> str | None:
        return None if HtmlRepr.painter is None else HtmlRepr.painter(self)
