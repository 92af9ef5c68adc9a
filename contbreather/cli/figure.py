"""`contbreather figure`: the figures of the paper."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from contbreather.cli.interrupts import computing
from contbreather.cli.options import Csv, Json, Output
from contbreather.cli.output import check_places, say, to_csv, to_figure, to_json
from contbreather.errors import BadInput


def figure(
    number: Annotated[str | None, Parameter(help="2 to 8, as the captions count.")] = None,
    *,
    csv: Csv = None,
    output: Output = None,
    json: Json = False,
) -> None:
    """A figure of the paper, with what is exact beside what the paper says, and our verdict.

    It is drawn to the file that --output names; without --output, --csv and --json to figure2.png
    for figure 2, and so on, in the current directory.
    """
    from contbreather.paper import FIGURES

    if number is None or number not in map(str, FIGURES):
        there = ", ".join(map(str, FIGURES))
        raise BadInput(f"figure {number or '(none given)'}: there are the figures {there}")
    if output is None and csv is None and not json:
        output = f"figure{number}.png"
    check_places(csv, output)
    with computing():
        found = FIGURES[int(number)]()
    rows = list(found.rows())
    made = []
    if csv is not None:
        made.append(to_csv(csv, rows, list(rows[0])))
    if output is not None:
        made.append(to_figure(output, found.draw))
    if json:
        paths = [str(path) for path in made]
        content = {"figure": int(number), "caption": found.caption, "rows": rows, "written": paths}
        numbers = getattr(found, "numbers", None)  # what the caption's verdict is made of
        to_json(content if numbers is None else {**content, "numbers": numbers})
        return
    say(found.caption, *(f"Wrote {path}." for path in made))
