"""A study out of its file: everything that is wrong with it at once, each with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contbreather.errors import BadInput
from contbreather.files import read_text

if TYPE_CHECKING:
    from pydantic import ValidationError

    from contbreather.studies.schema import Study

Place = tuple[str, ...]
WANTED = {  # by what pydantic calls a mistake
    "string": "a text in quotes",
    "int": "a whole number",
    "float": "a number",
    "finite_number": "a finite number",
    "bool": "true or false",
    "list": "a list",
    "dict": "a table of names and values",
    "model": "a table of keys",
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "a number of at least {ge:g}",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
}
ONE_BY_ONE = ("branch", "arms", "boundary", "zones", "atlas", "figure")  # tables of tables
_HEADER = re.compile(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*([\w.\-"' ]+?)\s*=""")


def read(path: str | Path) -> Study:
    """What a study file says.

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
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path} is not TOML: {error}") from error
    _beside(Path(path), tables)
    study, wrong = _checked(tables)
    if wrong:
        lines = dict(_lines(text))
        raise BadInput(_listed(Path(path).name, [(_line(lines, at), at, why) for at, why in wrong]))
    return study


def _beside(path: Path, tables: dict[str, Any]) -> None:
    """The file of a lattice is looked for where the study is."""
    chain = tables.get("chain")
    lattice = chain.get("lattice") if isinstance(chain, dict) else None
    if isinstance(chain, dict) and str(lattice).lower().endswith((".csv", ".graphml")):
        chain["lattice"] = str(path.resolve().parent / str(lattice))


def _checked(tables: Mapping[str, Any]) -> tuple[Study, list[tuple[Place, str]]]:
    """The study, as far as its tables have no mistakes of their own, and all mistakes."""
    try:
        from pydantic import ValidationError
    except ImportError as error:
        raise BadInput("studies need pydantic; install it: pip install pydantic") from error
    from contbreather.studies.references import faults
    from contbreather.studies.schema import Study

    unread: set[str] = set()
    wrong: list[tuple[Place, str]] = []
    while True:
        try:
            study = Study.model_validate(tables)
        except ValidationError as error:
            wrong += _sentences(error, Study)
            places = {mistake["loc"][:2] for mistake in error.errors()}
            unread |= {str(place[-1]) for place in places} | {str(place[0]) for place in places}
            tables = _without(tables, places)
        else:
            return study, [*wrong, *faults(study, unread)]


def _without(tables: Mapping[str, Any], places: set[Any]) -> dict[str, Any]:
    """The rest, so that all of its mistakes are found as well."""
    left = {name: table for name, table in tables.items() if (name,) not in places}
    for first, *second in places:
        if first in ONE_BY_ONE and second:
            left[first] = {name: value for name, value in left[first].items() if name not in second}
        else:
            left.pop(first, None)
    return left


def _sentences(error: ValidationError, study: Any) -> Iterator[tuple[Place, str]]:
    """What pydantic found, in our words."""
    for mistake in error.errors(include_url=False):
        place = tuple(str(task) for task in mistake["loc"])
        value = mistake["input"]
        match mistake["type"]:
            case "missing":
                yield place[:-1], f"{place[-1]} is missing"
            case "extra_forbidden":
                yield place, f"unknown here{_guess(place, study)}"
            case "value_error":
                yield place, str(mistake["ctx"]["error"])
            case kind:
                wanted = WANTED[kind.removesuffix("_type")].format(**mistake.get("ctx", {}))
                yield place, f"{wanted} was expected, got {_typed(value)}"


def _typed(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, dict):
        return "a table"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _guess(place: Place, study: Any) -> str:
    """The keys that are known where an unknown one is."""
    model = study
    for task in place[:-1]:
        field = getattr(model, "model_fields", {}).get(task)
        if field is not None:
            inner = getattr(field.annotation, "__args__", (None, field.annotation))
            model = inner[-1]
    names = list(getattr(model, "model_fields", {}))
    near = get_close_matches(place[-1], names, 1)
    return f"; did you mean {near[0]}?" if near else f"; there are {', '.join(names)}"


# --- lines ------------------------------------------------------------------------------------


def _lines(text: str) -> Iterator[tuple[Place, int]]:
    """Where tables and keys begin: what tomllib does not keep."""
    table: Place = ()
    for line, content in enumerate(text.splitlines(), start=1):
        header = _HEADER.match(content)
        if header:
            table = _dotted(header.group(1))
            yield table, line
            continue
        key = _KEY.match(content)
        if key:
            yield (*table, *_dotted(key.group(1))), line


def _dotted(name: str) -> Place:
    return tuple(task.strip().strip("\"'") for task in name.split("."))


def _line(lines: Mapping[Place, int], place: Place) -> int:
    """That of the key or of what is in it, or of the innermost table that is there."""
    for size in range(len(place), 0, -1):
        inside = [line for at, line in lines.items() if at[:size] == place[:size]]
        if inside:
            return min(inside)
    return 1


def _listed(name: str, faults: Sequence[tuple[int, Place, str]]) -> str:
    mistakes = [
        f"line {line}{', ' + '.'.join(place) if place else ''}: {why}"
        for line, place, why in sorted(faults, key=lambda fault: fault[0])
    ]
    if len(mistakes) == 1:
        return f"{name}, {mistakes[0]}"
    return "\n  ".join([f"{name} has {len(mistakes)} mistakes:", *mistakes])
