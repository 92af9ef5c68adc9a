"""A study out of its file: everything that is wrong with it at once, each with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from contbreather.checks import combinations
from contbreather.errors import BadInput
from contbreather.files import read_text
from contbreather.orbits.zone_search import PAIRS
from contbreather.orbits.zones import model_of
from contbreather.plotting.canvas import FIGURES
from contbreather.stability.verdict import THRESHOLD
from contbreather.studies.schema import KINDS, Figure, FromPoint, GridTask, Study, part
from contbreather.tables import visible

KeyPath = tuple[str, ...]
Fault = tuple[KeyPath, str]  # where it is said, and what is wrong
EVENTS = {"arms": ("PF", "PD", "BP"), "boundary": ("LP", "PF", "PD", "NS", "GR", "VI", "BP")}
MEASURES = ("p", "phi", "c", "asymmetry", "unstable", "condition", "nu", "arclength", "residual")
NUMBERED = re.compile(r"[tpJc]\d*|norm\([qr]\)")  # columns that some branches have more than one of
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
        try:
            tables = tomllib.loads(text)
        except ValueError as error:  # which the one of numbers too long for Python is, too
            raise BadInput(f"{path} is not TOML: {error}") from error
        _beside(Path(path), tables)
        study, wrong = _checked(tables)
    except RecursionError as error:
        raise BadInput(f"{path} is no study: tables or lists are too deep in others") from error
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


def _checked(tables: Mapping[str, Any]) -> tuple[Study, list[Fault]]:
    """The study, as far as its tables have no mistakes of their own, and all mistakes."""
    unread: set[str] = set()
    wrong: list[Fault] = []
    while True:
        try:
            study = Study.model_validate(tables)
        except ValidationError as error:
            wrong += _sentences(error)
            places = {mistake["loc"][:2] for mistake in error.errors()}
            unread |= {str(place[-1]) for place in places} | {str(place[0]) for place in places}
            tables = _without(tables, places)
        else:
            return study, [*wrong, *faults(study, unread)]


def _without(tables: Mapping[str, Any], places: set[Any]) -> dict[str, Any]:
    """The rest, so that all of its mistakes are found as well."""
    left = {name: table for name, table in tables.items() if (name,) not in places}
    for first, *second in places:
        if first in (*KINDS, "figure") and second:
            left[first] = {name: value for name, value in left[first].items() if name not in second}
        else:
            left.pop(first, None)
    return left


def _sentences(error: ValidationError) -> Iterator[Fault]:
    """What pydantic found, in our words."""
    for mistake in error.errors(include_url=False):
        place = tuple(str(task) for task in mistake["loc"])
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
                yield place, f"{wanted} was expected, got {_typed(value)}"


def _typed(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, dict):
        return "a table"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _guess(place: KeyPath) -> str:
    """The keys that are known where an unknown one is."""
    model: Any = Study
    for task in place[:-1]:
        field = getattr(model, "model_fields", {}).get(task)
        if field is not None:
            inner = getattr(field.annotation, "__args__", (None, field.annotation))
            model = inner[-1]
    names = list(getattr(model, "model_fields", {}))
    near = get_close_matches(place[-1], names, 1)
    return f"; did you mean {near[0]}?" if near else f"; there are {', '.join(names)}"


# --- lines ------------------------------------------------------------------------------------


def _lines(text: str) -> Iterator[tuple[KeyPath, int]]:
    """Where tables and keys begin: what tomllib does not keep."""
    table: KeyPath = ()
    for line, content in enumerate(text.splitlines(), start=1):
        header = _HEADER.match(content)
        if header:
            table = _dotted(header.group(1))
            yield table, line
            continue
        key = _KEY.match(content)
        if key:
            yield (*table, *_dotted(key.group(1))), line


def _dotted(name: str) -> KeyPath:
    return tuple(task.strip().strip("\"'") for task in name.split("."))


def _line(lines: Mapping[KeyPath, int], place: KeyPath) -> int:
    """That of the key or of what is in it, or of the innermost table that is there."""
    for size in range(len(place), 0, -1):
        inside = [line for at, line in lines.items() if at[:size] == place[:size]]
        if inside:
            return min(inside)
    return 1


def _listed(name: str, faults: Sequence[tuple[int, KeyPath, str]]) -> str:
    mistakes = [
        visible(f"line {line}{', ' + '.'.join(place) if place else ''}: {why}")
        for line, place, why in sorted(faults, key=lambda fault: fault[0])
    ]
    if len(mistakes) == 1:
        return f"{name}, {mistakes[0]}"
    return "\n  ".join([f"{name} has {len(mistakes)} mistakes:", *mistakes])


# --- what fits together ---------------------------------------------------------------------------


def faults(study: Study, unread: Collection[str] = ()) -> Iterator[Fault]:
    """What does not fit together; `unread` are tables that are there, but have mistakes of their
    own."""
    if not (study.results or unread):
        wanted = "a table [branch.NAME], [zones.NAME] or [atlas.NAME] is expected"
        yield (), f"nothing is asked for: {wanted}"
    yield from _names(study)
    yield from _references(study, unread)
    if "chain" not in unread:
        yield from _of_the_chain(study, unread)
        yield from _of_the_model(study)
    for name, figure in study.figure.items():
        yield from _drawn(study, name, figure, unread)


def _tables(study: Study, *kinds: str) -> Iterator[tuple[str, str, Any]]:
    """Kind, name and table of all that are of these kinds."""
    for kind in kinds:
        for name, table in getattr(study, kind).items():
            yield kind, name, table


def _names(study: Study) -> Iterator[Fault]:
    taken: dict[str, str] = {}
    for kind, name, _ in _tables(study, *KINDS, "figure"):
        if not name.replace("-", "").replace("_", "").isalnum():
            yield (kind, name), "a name of letters, digits, - and _ was expected"
    for kind, name, _ in _tables(study, *KINDS):
        if name in taken:
            yield (kind, name), f"{name!r} is there already, as {taken[name]}"
        taken[name] = kind
    written: dict[str, str] = {}
    for name, figure in study.figure.items():
        first = written.setdefault(figure.path(name), name)
        if first != name:
            yield ("figure", name, "file"), f"figure {first} is written to this file already"


def _references(study: Study, unread: Collection[str]) -> Iterator[Fault]:
    sources = {**study.branch, **study.arms, **study.boundary}
    for kind, name, table in _tables(study, "arms", "boundary"):
        source, _, arm = part(table.of)
        place = (kind, name, "of")
        if source in unread:
            continue
        if source not in sources:
            have = _names_there(sources, unread)
            yield place, f"no branch, arms or boundary {source!r}; there are {have}"
        elif (source in study.arms) != bool(arm):
            wanted = f"{source}/arm1" if source in study.arms else source
            yield place, f"{wanted!r} was expected, got {table.of!r}"
        elif name in _origins(study, source):
            yield place, f"it comes from itself, by way of {source!r}"
        else:
            yield from _no_member(study, place, table.of, unread)
            yield from _no_event(study, kind, name)


def _no_member(
    study: Study, place: KeyPath, named: str, unread: Collection[str]
) -> Iterator[Fault]:
    """A member of a scan that is not in it."""
    wanted = part(named)
    if not wanted.member or {*_origins(study, wanted.family)} & {*unread}:
        return
    there = list(members(study, wanted.family))
    if there and not any(map(wanted.has, there)):
        values = {name: dict.fromkeys(at[name] for at in there) for name in there[0]}
        have = "; ".join(f"{name} = {', '.join(map(str, of))}" for name, of in values.items())
        yield place, f"{wanted.family} has no {named.split('/')[1]}; it has {have}"


def members(study: Study, family: str) -> Iterator[dict[str, float]]:
    """The values of each member of a family: of a grid all, else those of what it starts from."""
    table = study.results[family]
    if isinstance(table, GridTask):
        yield from combinations(table.grid)
    elif isinstance(table, FromPoint):
        source = part(table.of)
        yield from filter(source.has, members(study, source.family))


def _no_event(study: Study, kind: str, name: str) -> Iterator[Fault]:
    """A label that no special point of the source has from which anything of this kind sets out."""
    at, source = getattr(study, kind)[name].at, study.results[name].source
    if source in study.boundary:  # where two kinds meet there are names of many sorts
        return
    # symmetric breathers have no PD: it is that of an arm that leaves them at a pitchfork
    events = [event for event in EVENTS[kind] if event != "PD" or source not in study.branch]
    if at.rstrip("0123456789") not in events:
        what = f"{kind} of {'a branch' if source in study.branch else 'arms'} start"
        yield (kind, name, "at"), f"{what} at {', '.join(events)}, 'PF1' for instance; got {at!r}"


def _names_there(read: Collection[str], unread: Collection[str]) -> str:
    return ", ".join([*read, *sorted({*unread} - {*KINDS, "chain", "figure"})]) or "none"


def _origins(study: Study, name: str) -> list[str]:
    """What a result comes from, itself first."""
    origins: list[str] = []
    while name in study.results and name not in origins:
        origins.append(name)
        name = study.results[name].source
    return origins


def _of_the_chain(study: Study, unread: Collection[str]) -> Iterator[Fault]:
    """What the library cannot do with it: nothing that is said there is passed over."""
    chain, infinite = study.chain, study.chain.place.sites is None
    drawn = any(getattr(study, kind) or kind in unread for kind in ("zones", "atlas"))
    arms = bool(study.arms) or "arms" in unread
    # only zones are not for an infinite chain with springs
    passed = {"spring"} if infinite and not drawn else set()
    try:
        model_of(**{name: value for name, value in chain.on.items() if name not in passed})
    except BadInput as error:
        yield ("chain",), str(error)
    if infinite and chain.spring and arms:
        yield (
            ("chain", "spring"),
            "arms on the infinite chain are without springs; leave spring out, or name a lattice, "
            "'ring:200'",
        )
    if arms and chain.verge != THRESHOLD:
        yield (
            ("chain", "threshold"),
            f"arms are judged by the paper's {THRESHOLD}; leave threshold out, or keep the arms "
            "in a study of their own",
        )


def _of_the_model(study: Study) -> Iterator[Fault]:
    """Parameters that there are not, and zone diagrams past the folds of what is evaluated by exact
    modes."""
    infinite, params = study.chain.place.sites is None, study.chain.drive.params
    names = sorted({*PAIRS, *params, "spring"} | ({"damping"} if not infinite else set()))
    there = f"of {', '.join(names)}"
    for kind, name, table in _tables(study, "branch", "zones", "atlas", "boundary"):
        for parameter in set(getattr(table, "over", ())) - set(params):
            have = ", ".join(params) or "none"
            yield (kind, name, "over"), f"the forcing has no {parameter!r}; it has {have}"
        if kind == "branch" and table.free not in names:
            yield (kind, name, "free"), f"one {there} was expected, {table.free!r} is none"
        if kind == "boundary" and len({*table.pair} & {*names}) < 2:
            yield (kind, name, "pair"), f"two {there} were expected, got {table.pair}"
        if not infinite and getattr(table, "past_folds", False):
            try:
                model_of(**study.chain.on, past_folds=True)
            except BadInput as error:
                yield (kind, name, "past_folds"), str(error).removeprefix("past_folds: ")


def _drawn(study: Study, name: str, figure: Figure, unread: Collection[str]) -> Iterator[Fault]:
    if figure.file is not None and not figure.file.lower().endswith(FIGURES):
        wanted = f"one of {', '.join(FIGURES)} was expected"
        yield ("figure", name, "file"), f"{wanted}, got {figure.file!r}"
    if figure.file is not None and figure.file != Path(figure.file).name:
        wanted = "a name in the folder of the results was expected"
        yield ("figure", name, "file"), f"{wanted}, got {figure.file!r}"
    draws = [part(drawing).family for drawing in figure.draws]
    if set(draws) & set(unread):
        return
    for family in draws:
        if family not in study.results:
            have = _names_there(study.results, unread)
            yield ("figure", name, "draws"), f"nothing is called {family!r}; there are {have}"
            return
    kinds = {type(study.results[family]).__name__ for family in draws}
    alone = kinds == {"Atlas"} and len(draws) == 1
    if not (alone or kinds == {"ZonesTask"} or not kinds & {"ZonesTask", "Atlas"}):
        wanted = "zone diagrams, one atlas, or branches, arms and boundaries"
        yield ("figure", name, "draws"), f"{wanted} were expected, not some of each"
        return
    fit = {"over", "at"} if alone else set() if kinds == {"ZonesTask"} else {"x", "y"}
    if not unread:
        for drawing in figure.draws:
            yield from _no_member(study, ("figure", name, "draws"), drawing, unread)
    columns = {*MEASURES, *PAIRS, "damping", "spring", *study.chain.drive.params}
    for key in sorted({"x", "y", "over", "at"} & figure.model_fields_set):
        column = getattr(figure, key)
        if key not in fit:
            yield (
                ("figure", name, key),
                "x and y are columns of branches, over and at choose surfaces of an atlas; leave "
                f"{key} out of a figure of {' and '.join(sorted(kinds)).lower()}",
            )
        elif not alone and column not in columns and not NUMBERED.fullmatch(column):
            yield (
                ("figure", name, key),
                f"no branch of a study has a column {column!r}; there are "
                f"{', '.join(sorted(columns))}, and of each impact t1, p1",
            )
