"""Lattices and walls as they are typed: `ring:20`, `open:3:masses=1,2,1`, `grid:5x5`, a file;
`-1,1`, `3:none,0.8`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from contbreather.errors import BadInput
from contbreather.files import read_text
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.conditions import Walls
from contbreather.lattice.finite import ROWS, Grid, Lattice, OpenChain, by_matrix

KNOWN = (
    "ring:20, open:9, open:9:fixed, grid:5x5, grid:5x5:periodic, a .csv with a stiffness matrix "
    "or a .graphml with a graph; behind it numbers of all sites, :masses=1,2,1 for instance, "
    f"or {', '.join(ROWS[1:])}"
)
_ROW = re.compile(rf":({'|'.join(ROWS)})=([^:]*)")


def lattice_by(typed: str | None, sites: int | None = None, option: str = "--lattice") -> Any:
    """The lattice of `--lattice`, or of `--sites`, which is short for a ring; `option` is what
    sentences call it, where it is typed elsewhere."""
    if typed is None:
        return InfiniteChain() if sites is None else Ring(sites)
    if sites is not None:
        raise BadInput(f"--lattice {typed} and --sites {sites}: give one of the two")
    bare, rows = _ROW.sub("", typed), _rows(typed, option)
    if bare.lower().endswith(".csv"):
        lattice = _of_matrix(bare)
    elif bare.lower().endswith(".graphml"):
        lattice = _of_graph(bare)
    elif (call := _call(bare)) is None:
        raise BadInput(f"{option} {typed}: expected {KNOWN}")
    else:
        make, sizes, options = call
        lattice = make(*sizes, **options)
    return replace(by_matrix(lattice), **rows) if rows else lattice


def _rows(typed: str, option: str) -> dict[str, Any]:
    """Numbers of all sites, by what they are of."""
    rows: dict[str, Any] = {}
    for name, words in _ROW.findall(typed):
        try:
            row = [float(word) for word in words.split(",")]
        except ValueError:
            raise BadInput(
                f"{option} {typed}: {name}={words}: numbers apart by commas were expected"
            ) from None
        if rows.setdefault(name, row) is not row:
            raise BadInput(f"{option} {typed}: {name} are given twice; leave one of them")
    return rows


def _call(typed: str) -> tuple[Callable[..., Any], list[int], dict[str, Any]] | None:
    """Constructor of a ring, an open chain or a grid, its sizes and its options."""
    name, size, *ends = typed.lower().split(":") if ":" in typed else (typed, "")
    # what is no size counts as 0, which no lattice has
    sizes = [int(word) if word.isdecimal() and len(word) < 10 else 0 for word in size.split("x")]
    if all(sizes):
        match name, len(sizes), ends:
            case "ring", 1, []:
                return Ring, sizes, {}
            case "open", 1, ([] | ["free" | "fixed"]):
                return OpenChain, sizes, {"ends": ends[0]} if ends else {}
            case "grid", 2, ([] | ["periodic"]):
                return Grid, sizes, {"periodic": True} if ends else {}
    return None


def _of_matrix(path: str) -> Lattice:
    """A row of the stiffness matrix on each line, its numbers apart by commas or spaces."""
    lines = read_text(path).replace(",", " ").replace(";", " ").splitlines()
    try:
        rows = [[float(word) for word in line.split()] for line in lines if line.strip()]
    except ValueError as error:
        raise BadInput(f"no stiffness matrix in {path}: {error}") from error
    widths = {len(row) for row in rows}
    if widths != {len(rows)}:
        shape = f"{len(rows)} rows of {', '.join(map(str, sorted(widths))) or 'no'} numbers"
        raise BadInput(f"no stiffness matrix in {path}: {shape}; a square matrix is expected")
    return Lattice(rows)


def _of_graph(path: str) -> Lattice:
    """Edges with their `weight`, nodes with their `mass` and `drive`."""
    from xml.etree.ElementTree import ParseError

    import networkx as nx

    text = read_text(path)
    try:
        graph = nx.parse_graphml(text)
    except (nx.NetworkXException, ParseError, ValueError, KeyError, TypeError) as error:
        raise BadInput(f"no graph in {path}: {' '.join(str(error).split())}") from error
    return Lattice.from_graph(graph)


def as_code(typed: str) -> str:
    """Python that makes what `lattice_by` makes.

    Examples
    --------
    >>> as_code("open:9"), as_code("grid:5x5:periodic")
    ('cb.OpenChain(9)', 'cb.Grid(5, 5, periodic=True)')
    """
    if (call := _call(typed)) is None:
        return f"cb.lattice.parse.lattice_by({typed!r})"
    make, sizes, options = call
    given = [*map(str, sizes), *(f"{name}={value!r}" for name, value in options.items())]
    return f"cb.{make.__name__}({', '.join(given)})"


def walls_by(typed: Any, sites: int | None) -> Any:
    """The walls of `--walls` as `symmetric` takes them, None where none were typed; numbers of a
    file as they are."""
    if not (isinstance(typed, list | tuple) and all(isinstance(text, str) for text in typed)):
        return typed
    of_all = [_ends(text, text) for text in typed if ":" not in text]
    by_site = dict(_of_site(text) for text in typed if ":" in text)
    # fewer than were typed: a second pair for all sites, or one site twice
    if len(of_all[:1]) + len(by_site) < len(typed):
        raise BadInput(f"walls {' '.join(typed)}: one pair for all sites, one for each of them")
    if by_site and of_all and isinstance(of_all[0], list):
        raise BadInput(f"walls {' '.join(typed)}: each site has its own already; leave out SITE:")
    if not by_site or sites is None:
        return of_all[0] if of_all else by_site or None
    return {**dict.fromkeys(range(sites), *of_all), **by_site} if of_all else by_site


def as_typed(walls: Walls) -> str:
    """Text that `walls_by` makes them of; nothing for the usual ones.

    Examples
    --------
    >>> as_typed(Walls.given({3: (None, 0.8)}))
    '3:none,0.8'
    """
    usual = walls.of_all == Walls().of_all
    pairs = ([] if usual else [("", walls.of_all)]) + [(f"{n}:", pair) for n, pair in walls.own]
    ends = {-math.inf: "none", math.inf: "none"}  # no wall on that side
    return " ".join(
        f"{site}{ends.get(low, repr(low))},{ends.get(high, repr(high))}"
        for site, (low, high) in pairs
    )


def _of_site(text: str) -> tuple[int, Any]:
    site, _, ends = text.partition(":")
    if not site.isdecimal():
        raise BadInput(f"walls {text}: SITE:LOW,HIGH is expected, for instance 3:none,0.8")
    return int(site), _ends(ends, text)


def _ends(words: str, text: str) -> Any:
    """A number, a pair or, of more, a list of them."""
    try:
        ends = [None if word.lower() == "none" else float(word) for word in words.split(",")]
    except ValueError as error:
        raise BadInput(
            f"walls {text}: LOW,HIGH is expected, for instance -1,1, or a number for each site; "
            "none for a wall that is not there"
        ) from error
    return (ends[0] if len(ends) == 1 else tuple(ends)) if len(ends) < 3 else ends
