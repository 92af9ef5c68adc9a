"""A study out of its file: everything that is wrong with it at once, each with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from contbreather.checks import brief
from contbreather.errors import BadInput
from contbreather.files import read_text
from contbreather.plotting.canvas import FIGURES
from contbreather.stability.verdict import THRESHOLD
from contbreather.studies.schema import KINDS, FromPoint, Study
from contbreather.tables import visible

KeyPath = tuple[str, ...]
Fault = tuple[KeyPath, str]  # where it is said, and what is wrong
# a header of a table, or a key
_PLACE = re.compile(r"""\s*(?:\[\s*([^\[\]]+?)\s*\]\s*(?:#.*)?$|([\w.\-"' ]+?)\s*=)""")


def read(path: str | Path) -> Study:
    """Read a study file.

    Raises
    ------
    BadInput
        If it cannot be read, or is no study: all mistakes at once, each with its line and what is
        wanted.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "study.toml"
    >>> _ = path.write_text("[zones.paper]\\nk = [0.8, 0.4]\\n")
    >>> read(path).zones["paper"].k
    [0.8, 0.4]
    """
    text = read_text(path)
    try:
        try:
            tables = tomllib.loads(text)
        except ValueError as error:  # which the one of numbers too long for Python is, too
            raise BadInput(f"{path} is not TOML: {error}") from error
        chain: Any = tables.get("chain")
        lattice = str(chain.get("lattice")) if isinstance(chain, dict) else ""
        if re.search(r"\.(csv|graphml)(:|$)", lattice.lower()):  # a file beside the study
            chain["lattice"] = str(Path(path).resolve().parent / lattice)
        # also those of which the study says nothing because of their own mistakes
        kinds = [(name, kind) for kind in KINDS if isinstance(tables.get(kind), dict)
                 for name in tables[kind]]  # fmt: skip
        study, faults = _without_mistakes(tables)
    except RecursionError as error:
        raise BadInput(f"{path} is no study: tables or lists are too deep in others") from error
    if faults := [*faults, *_of_names(study, kinds), *_of_references(study, dict(kinds))]:
        lines = _lines(text)
        # of what is not there the line of the innermost table that is
        places = sorted((_line(lines, at), ".".join(at), why) for at, why in faults)
        said = [visible(f"line {n}{', ' * bool(at)}{at}: {why}") for n, at, why in places]
        several = "\n  ".join([f"{Path(path).name} has {len(said)} mistakes:", *said])
        raise BadInput(several if said[1:] else f"{Path(path).name}, {said[0]}")
    return study


def _without_mistakes(tables: dict[str, Any]) -> tuple[Study, list[Fault]]:
    """Leave out tables with mistakes: those in how the others fit together are found, too."""
    try:
        return Study.model_validate(tables), []
    except ValidationError as error:
        faults = [*_sentences(error)]
    for first, *second in {place[:2] for place, _ in faults}:
        if second and first != "chain":
            del tables[first][second[0]]
        else:
            del tables[first]
    return Study.model_validate(tables), faults


def _sentences(error: ValidationError) -> Iterator[Fault]:
    for mistake in error.errors(include_url=False):
        place = tuple(str(key) for key in mistake["loc"] if key != "[key]")
        match mistake["type"]:
            case "missing":
                yield place[:-1], f"{place[-1]} is missing"
            case "extra_forbidden":
                yield place, f"unknown here{_guess(place)}"
            case "value_error":
                yield place, str(mistake["ctx"]["error"])
            case _:
                yield place, f"{mistake['msg']}, got {brief(mistake['input'])}"


def _guess(place: KeyPath) -> str:
    """Name the keys that are known where an unknown one is."""
    table: Any = Study.model_fields[place[0]].annotation if place[1:] else Study
    names = [*(get_args(table) or (table,))[-1].model_fields]
    near = get_close_matches(place[-1], names, 1)
    return f"; did you mean {near[0]}?" if near else f"; there are {', '.join(names)}"


# --- lines ------------------------------------------------------------------------------------


def _lines(text: str) -> dict[KeyPath, int]:
    """Find the first line of each table and key, which tomllib does not keep."""
    table: KeyPath = ()
    lines: dict[KeyPath, int] = {(): 1}
    for line, content in enumerate(text.splitlines(), start=1):
        if match := _PLACE.match(content):
            names = tuple(key.strip(" \"'") for key in match[match.lastindex or 0].split("."))
            table, place = (names, names) if match[1] else (table, (*table, *names))
            for size in range(1, len(place) + 1):
                lines.setdefault(place[:size], line)
    return lines


def _line(lines: Mapping[KeyPath, int], place: KeyPath) -> int:
    return lines[place] if place in lines else _line(lines, place[:-1])


# --- how tables fit together ------------------------------------------------------------------


def _of_names(study: Study, named: Sequence[tuple[str, str]]) -> Iterator[Fault]:
    """Refuse a study of nothing, two things of one name, and files that cannot be figures."""
    if not named:
        wanted = "a table [branch.NAME], [zones.NAME] or [atlas.NAME] is expected"
        yield (), f"nothing is asked for: {wanted}"
    known: dict[str, str] = {}
    for name, kind in named:
        if known.setdefault(name, kind) != kind:
            yield (kind, name), f"{name!r} is there already, as {known[name]}"
    files: dict[Path, str] = {}
    for name, picture in study.pictures(Path()).items():
        place, typed = ("figure", name, "file"), study.figure[name].file
        if files.setdefault(picture, name) != name:
            yield place, f"figure {files[picture]} is written to this file already"
        if picture.suffix.lower() not in FIGURES:
            yield place, f"one of {', '.join(FIGURES)} was expected, got {str(picture)!r}"
        if typed and typed != Path(typed).name:
            yield place, f"a name in the folder of the results was expected, got {typed!r}"


def _of_references(study: Study, kinds: Mapping[str, str]) -> Iterator[Fault]:
    """Refuse arms, boundaries and figures of nothing or of themselves, and options of other
    pictures; `kinds` are of all results."""
    starts = [name for name, kind in kinds.items() if kind in ("branch", "arms", "boundary")]
    tables: dict[KeyPath, FromPoint] = {("arms", name): one for name, one in study.arms.items()}
    tables |= {("boundary", name): one for name, one in study.boundary.items()}
    sources = {name: table.of.family for (_, name), table in tables.items()}
    for (kind, name), table in tables.items():
        source, place, origins = sources[name], (kind, name, "of"), [sources[name]]
        while origins[-1] in sources and origins[-1] not in origins[:-1]:
            origins.append(sources[origins[-1]])
        if source not in starts:
            have = ", ".join(starts) or "none"
            yield place, f"no branch, arms or boundary {source!r}; there are {have}"
        elif (kinds[source] == "arms") != bool(table.of.arm):
            wanted = f"{source}/arm1" if kinds[source] == "arms" else source
            yield place, f"{wanted!r} was expected"
        elif name in origins:
            yield place, f"it comes from itself, by way of {source!r}"
    if "arms" in kinds.values() and study.chain.verge != THRESHOLD:
        paper = f"arms are judged by the paper's {THRESHOLD}; leave threshold out, or keep the arms"
        yield ("chain", "threshold"), f"{paper} in a study of their own"
    for name, figure in study.figure.items():
        families = [drawing.family for drawing in figure.draws]
        for family in {*families} - {*kinds}:
            have = ", ".join(kinds) or "none"
            yield ("figure", name, "draws"), f"nothing is called {family!r}; there are {have}"
        drawn = {kinds[family] for family in families if family in kinds}
        if "atlas" in drawn and len(families) > 1:
            yield ("figure", name, "draws"), "an atlas is drawn alone"
        fit = {"over", "at"} if "atlas" in drawn else set() if "zones" in drawn else {"x", "y"}
        for key in sorted(figure.options.keys() - fit) if drawn else ():
            yield (
                ("figure", name, key),
                "x and y are columns of branches, over and at choose surfaces of an atlas; leave "
                f"{key} out of a figure of {' and '.join(sorted(drawn))}",
            )
