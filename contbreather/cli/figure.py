"""`contbreather figure`: the figures of the paper."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from contbreather.cli.interrupts import computing
from contbreather.cli.options import Output
from contbreather.errors import BadInput


def figure(number: str | None = None, *, into: Output = Output()) -> None:
    """A figure of the paper, with what is exact beside what the paper says, and our verdict.

    It is drawn to the file that --output names; without --output, --csv and --json to figure2.png
    for figure 2, and so on, in the current directory.

    Parameters
    ----------
    number
        2 to 8, as numbered in the captions.
    """
    from contbreather.paper import FIGURES

    if number is None or number not in map(str, FIGURES):
        there = ", ".join(map(str, FIGURES))
        raise BadInput(f"figure {number or '(none given)'}: there are the figures {there}")
    if into == Output():
        into = replace(into, output=f"figure{number}.png")
    into.check()
    with computing():
        drawing = FIGURES[int(number)]()
    rows = list(drawing.rows())
    content: dict[str, Any] = {"figure": int(number), "caption": drawing.caption, "rows": rows}
    if hasattr(drawing, "numbers"):  # what the caption's verdict is made of
        content["numbers"] = drawing.numbers
    into.leave(lambda: content, [drawing.caption], lambda: (rows, list(rows[0])), drawing.draw)
