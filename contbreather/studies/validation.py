"""A study out of its file: everything that is wrong with it at once, each with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from operator import itemgetter
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from contbreather.errors import BadInput
from contbreather.files import read_text
from contbreather.plotting.canvas import FIGURES
from contbreather.stability.verdict import THRESHOLD
from contbreather.studies.schema import KINDS, Study
from contbreather.tables import visible

KeyPath = tuple[str, ...]
Fault = tuple[KeyPath, str]  # where it is said, and what is wrong
WANTED = {  # by what pydantic calls a mistake
    "string": "a text in quotes",
    "int": "a whole number",
    "float": "a number",
    "finite_number": "a finite number",
    "bool": "true or false",
    "list": "a list",
    "dict": "a table of names and values",
    "model": "a table of keys",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "string_pattern_mismatch": "a name of letters, digits, - and _",
}
_HEADER = re.compile(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*([\w.\-"' ]+?)\s*=""")


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
    faults += [*_of_names(study, kinds), *_of_sources(study, dict(kinds))]
    faults += [*_of_figures(study, dict(kinds))]
    if "arms" in dict(kinds).values() and study.chain.verge != THRESHOLD:
        paper = f"arms are judged by the paper's {THRESHOLD}; leave threshold out, or keep the arms"
        faults.append((("chain", "threshold"), f"{paper} in a study of their own"))
    if faults:
        lines = dict(_lines(text))
        places = sorted(((_line(lines, at), at, why) for at, why in faults), key=itemgetter(0))
        said = [
            visible(f"line {line}{', ' + '.'.join(at) if at else ''}: {why}")
            for line, at, why in places
        ]
        name, count = Path(path).name, len(said)
        several = "\n  ".join([f"{name} has {count} mistakes:", *said])
        raise BadInput(f"{name}, {said[0]}" if count == 1 else several)
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
        value = mistake["input"]
        match mistake["type"]:
            case "missing":
                yield place[:-1], f"{place[-1]} is missing"
            case "extra_forbidden":
                yield place, f"unknown here{_guess(place)}"
            case "value_error":
                yield place, str(mistake["ctx"]["error"])
            case kind:
                wanted = WANTED[kind.removesuffix("_type")].format(**mistake.get("ctx", {}))
                # as TOML has it
                got = str(value).lower() if isinstance(value, bool) else repr(value)
                got = "a table" if isinstance(value, dict) else got
                yield place, f"{wanted} was expected, got {got}"


def _guess(place: KeyPath) -> str:
    """Name the keys that are known where an unknown one is."""
    table: Any = Study.model_fields[place[0]].annotation if place[1:] else Study
    names = [*(get_args(table) or (table,))[-1].model_fields]
    near = get_close_matches(place[-1], names, 1)
    return f"; did you mean {near[0]}?" if near else f"; there are {', '.join(names)}"


# --- lines ------------------------------------------------------------------------------------


def _lines(text: str) -> Iterator[tuple[KeyPath, int]]:
    """Find where tables and keys begin, which tomllib does not keep."""
    table: KeyPath = ()
    for line, content in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(content):
            table = _dotted(header.group(1))
            yield table, line
        elif key := _KEY.match(content):
            yield (*table, *_dotted(key.group(1))), line


def _dotted(name: str) -> KeyPath:
    return tuple(key.strip().strip("\"'") for key in name.split("."))


def _line(lines: Mapping[KeyPath, int], place: KeyPath) -> int:
    """Find the line of a key or of what is in it, or of the innermost table that is there."""
    for size in range(len(place), 0, -1):
        inside = [line for at, line in lines.items() if at[:size] == place[:size]]
        if inside:
            return min(inside)
    return 1


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
    files: dict[str, str] = {}
    for name, picture in study.pictures(Path()).items():
        place, typed = ("figure", name, "file"), study.figure[name].file
        if files.setdefault(str(picture), name) != name:
            yield place, f"figure {files[str(picture)]} is written to this file already"
        if not str(picture).lower().endswith(FIGURES):
            yield place, f"one of {', '.join(FIGURES)} was expected, got {str(picture)!r}"
        if typed and typed != Path(typed).name:
            yield place, f"a name in the folder of the results was expected, got {typed!r}"


def _of_sources(study: Study, kinds: Mapping[str, str]) -> Iterator[Fault]:
    """Refuse arms and boundaries of nothing, or of themselves; `kinds` are of all results."""
    starts = [name for name, kind in kinds.items() if kind in ("branch", "arms", "boundary")]
    sources = {name: table.of.family for _, name, table in _tables(study, "arms", "boundary")}
    for kind, name, table in _tables(study, "arms", "boundary"):
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


def _of_figures(study: Study, kinds: Mapping[str, str]) -> Iterator[Fault]:
    """Refuse figures of nothing, and options of other pictures."""
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


def _tables(study: Study, *kinds: str) -> Iterator[tuple[str, str, Any]]:
    for kind in kinds:
        for name, table in getattr(study, kind).items():
            yield kind, name, table
