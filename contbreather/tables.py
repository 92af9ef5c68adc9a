"""Numbers in a table that fits: fewer digits, then fewer columns, never half a number.

What results show of themselves is such a table, in a terminal, a notebook and the explorer. A
notebook shows a picture, too. These are drawn on a higher floor, and values must not know it: they
ask a renderer, which the front desk hands in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal
from unicodedata import category

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table

Cell = str | complex | None
DIGITS = 12  # where there is room
NOTHING = "\N{EN DASH}"


class HtmlRepr:
    """A value that notebooks show as a small picture and a table."""

    __slots__ = ()
    renderer: ClassVar[Callable[[Any], str] | None] = None

    def table(self) -> Sheet:
        """Table of what it consists of: in a terminal, a notebook and the explorer."""
        raise NotImplementedError

    def _repr_html_(self) -> str | None:
        return None if HtmlRepr.renderer is None else HtmlRepr.renderer(self)


@dataclass(frozen=True)
class Column:
    """A heading and its cells: words as they are, numbers with as many digits as there is room for.

    Parameters
    ----------
    heading : str
    cells : sequence of str, numbers or None
        None stands for a number that would mean nothing.
    digits : int
        Significant ones, at most; more than 12 where nothing has to fit.
    spare : bool
        Left out first where there is no room.
    right : bool, optional
        To which side the cells lean; by default numbers to the right, words to the left.
    """

    heading: str
    cells: Sequence[Cell]
    digits: int = DIGITS
    spare: bool = False
    right: bool | None = None

    def texts(self, digits: int) -> list[str]:
        digits = min(digits, self.digits)
        return [
            NOTHING if cell is None
            else visible(cell if isinstance(cell, str) else f"{cell:.{digits}g}")
            for cell in self.cells
        ]  # fmt: skip

    def width(self, digits: int) -> int:
        return max(map(len, (self.heading, *self.texts(digits))))

    @property
    def leaning(self) -> Literal["left", "right"]:
        right = self.right
        if right is None:
            right = not any(isinstance(cell, str) for cell in self.cells)
        return "right" if right else "left"


@dataclass(frozen=True, repr=False)
class Sheet:
    """Columns with a title: a rich table no wider than its console, as far as that can be."""

    columns: Sequence[Column]
    title: str = ""

    @classmethod
    def of(cls, rows: Iterable[tuple[str, Cell]], title: str = "", digits: int = DIGITS) -> Sheet:
        names, cells = zip(*rows, strict=True)
        return cls([Column("", names), Column("", cells, digits, right=True)], title)

    def further(self, *rows: Sequence[Cell]) -> Sheet:
        if not rows:
            return self
        columns = [
            replace(column, cells=[*column.cells, *cells])
            for column, cells in zip(self.columns, zip(*rows, strict=True), strict=True)
        ]
        return replace(self, columns=columns)

    @property
    def rows(self) -> list[tuple[Cell, ...]]:
        return list(zip(*(column.cells for column in self.columns), strict=True))

    def table(self, width: int | None = None) -> Table:
        """Draw it with all digits and columns, or those for which `width` is enough."""
        from rich.table import Table

        kept, digits = self._room(width)
        left: list[str] = []
        widest = math.inf if width is None else width
        while len(kept) > 2 and kept[-1].leaning == "right" and _width(kept, digits) > widest:
            left.insert(0, kept.pop().heading)
        table = Table(
            title=visible(self.title) or None, title_justify="left", caption_justify="left",
            caption=f"No room for {', '.join(left)}." if left else None,
            show_header=any(column.heading for column in kept),
        )  # fmt: skip
        for column in kept:
            # too narrow even so: a number goes on in the next line, an ellipsis would hide its end
            table.add_column(column.heading, justify=column.leaning, overflow="fold")
        for row in zip(*(column.texts(digits) for column in kept), strict=True):
            table.add_row(*row)
        return table

    def __repr__(self) -> str:
        return str(self)  # what a prompt shows

    def __str__(self) -> str:
        from rich.console import Console

        console = Console()
        with console.capture() as drawn:
            console.print(self)
        return drawn.get().rstrip()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield self.table(width=options.max_width)

    def html(self, width: int | None = None, most: int | None = None) -> str:
        """Write the table for a page, what is said in it as text; of many rows the first ones."""
        from html import escape  # a table of all characters that have names

        kept, digits = self._room(width)
        texts = (column.texts(min(digits, DIGITS)) for column in kept)
        lines = list(zip(*texts, strict=True))
        heading = "".join(f"<th>{escape(column.heading)}</th>" for column in kept)
        head = f"<tr>{heading}</tr>" if any(column.heading for column in kept) else ""
        rows = "".join(f"<tr>{''.join(_cells(*map(escape, line)))}</tr>" for line in lines[:most])
        left = 0 if most is None else len(lines) - most
        return f"<table>{head}{rows}</table>" + (f"<p>and {left} more</p>" if left > 0 else "")

    _repr_html_ = html

    def _room(self, width: int | None) -> tuple[list[Column], int]:
        """The columns that are kept, and the digits of their numbers."""
        kept = list(self.columns)
        digits = max((column.digits for column in kept), default=DIGITS)
        if width is None or _width(kept, digits) <= width:
            return kept, digits
        kept = [column for column in kept if not column.spare]
        while digits > 4 and _width(kept, digits) > width:
            digits -= 1
        # fewer than four tell too little; words as wide as that are not helped by fewer digits
        return kept, digits if _width(kept, digits) < _width(kept, DIGITS) else DIGITS


def visible(text: str) -> str:
    """Text in which what a terminal would obey, rather than show, is written out."""
    return "".join(
        letter
        if letter == "\n" or category(letter)[0] != "C"
        else letter.encode("unicode_escape").decode()
        for letter in text
    )


def yes_or_no(verdict: bool | None) -> Cell:
    """A verdict in a word; a dash where nothing is known."""
    return {True: "yes", False: "no", None: None}[verdict]


def _width(columns: Sequence[Column], digits: int) -> int:
    """Width with a rule and two spaces for each column, and one rule more."""
    return 1 + sum(column.width(digits) + 3 for column in columns)


def _cells(name: str, *others: str) -> Iterable[str]:
    yield f'<th style="text-align:left">{name}</th>'
    yield from (f'<td style="text-align:left">{cell}</td>' for cell in others)
