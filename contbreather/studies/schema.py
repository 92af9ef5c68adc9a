"""Tables of a study file: each key with its type, ranges those of the library's own checks; and a
study out of its file, or everything that is wrong with it at once, each with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from contbreather.checks import brief, numbers, one_of, spread
from contbreather.continuation.branches.boundary import named_pair
from contbreather.errors import BadInput
from contbreather.files import named, read_text
from contbreather.lattice.chain import InfiniteChain, Ring
from contbreather.lattice.forcing import Forcing
from contbreather.lattice.formula import forcing_of
from contbreather.lattice.parse import lattice_by, walls_by
from contbreather.orbits.zone_search import PAIRS
from contbreather.parameters import CHOICES, NUMBERS, parameter
from contbreather.plotting.canvas import FIGURES
from contbreather.stability.verdict import THRESHOLD, threshold_on
from contbreather.tables import visible

_PART = re.compile(r"([^/=]+)(?:/([^/=]+=[^/]+))?(?:/([^/=]+))?")
KINDS = ("branch", "arms", "boundary", "zones", "atlas")  # of results
KeyPath = tuple[str, ...]
Fault = tuple[KeyPath, str]  # where it is said, and what is wrong
# a header of a table, or a key
_PLACE = re.compile(r"""\s*(?:\[\s*([^\[\]]+?)\s*\]\s*(?:#.*)?$|([\w.\-"' ]+?)\s*=)""")


# --- values as they are typed -----------------------------------------------------------------


class Part(NamedTuple):
    """Source of a part or a drawing: a family, its members with these values, one of their arms."""

    family: str
    member: Mapping[str, float]
    arm: str

    def __str__(self) -> str:
        member = ",".join(f"{name}={value!r}" for name, value in self.member.items())
        return "/".join(filter(None, (self.family, member, self.arm)))

    def has(self, at: Mapping[str, float]) -> bool:
        return all(at.get(name) == value for name, value in self.member.items())


def _part(named: Any) -> Part:
    """Take ``scan/gamma=0.02,k=0.8/arm1`` apart; only the family has to be there."""
    if match := _PART.fullmatch(str(named)):
        family, member, arm = match.groups(default="")
        pairs = (item.partition("=") for item in member.split(",") if item)
        with suppress(ValueError):
            return Part(family, {name.strip(): float(value) for name, _, value in pairs}, arm)
    raise ValueError(f"{named!r}: NAME, NAME/gamma=0.02 or NAME/gamma=0.02/arm1 was expected")


def _values(typed: Any) -> list[float]:
    """Read a number, a list of numbers, or so many from one to another."""
    if isinstance(typed, Mapping):
        if {*typed} != {"from", "to", "count"}:
            raise ValueError(
                f"{brief(typed)}: from, to and count were expected, {{from=0.3, to=0.9, count=7}}"
            )
        return spread("values", typed["from"], typed["to"], typed["count"])
    values = numbers("values", typed if isinstance(typed, list) else [typed])
    if values.ndim > 1 or not values.size or len({*values.flat}) < values.size:
        raise ValueError(f"{typed}: at least one number was expected, each once")
    return values.tolist()


def _losses(typed: Any) -> float | list[float]:
    """Read a number, or one for each site."""
    losses: float | list[float] = numbers("values", typed).tolist()
    return losses


def _in_range(typed: Any, info: ValidationInfo) -> Any:
    """Check values by the range of the parameter that has the name of the key."""
    for value in typed if isinstance(typed, list) else [typed]:
        # couplings above that are judged by the chain, too: `_of_couplings`
        if info.field_name != "gamma" or value < NUMBERS["gamma"].high:
            parameter(str(info.field_name), value)
    return typed


def _window(ends: list[float]) -> list[float]:
    low, high = ends
    if not low < high:
        raise ValueError(f"low < high was expected, got [{low:g}, {high:g}]")
    return ends


def _name(typed: str) -> str:
    if not re.fullmatch(r"[\w-]+", typed):
        raise ValueError("a name of letters, digits, - and _ was expected")
    return typed


Name = Annotated[str, AfterValidator(_name)]
Source = Annotated[Part, PlainValidator(_part)]
Values = Annotated[list[float], PlainValidator(_values)]
Ranged = Annotated[list[float], PlainValidator(_values), AfterValidator(_in_range)]
Window = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_window)]
Loss = Annotated[float | list[float], PlainValidator(_losses), AfterValidator(_in_range)]


# --- tables -----------------------------------------------------------------------------------


class Table(BaseModel):
    """One table of the file; keys that it does not know are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Chain(Table):
    """Lattice of the breathers, and its drive."""

    lattice: str | None = None
    forcing: str = CHOICES["forcing"].default
    parameters: dict[str, float] = Field(default_factory=dict)
    threshold: float | None = None
    damping: Loss = NUMBERS["damping"].default
    spring: Loss | None = None
    omega: Annotated[float, AfterValidator(_in_range)] = NUMBERS["omega"].default
    site: int = CHOICES["site"].default
    walls: Any = Field(default_factory=list)

    @model_validator(mode="after")
    def possible(self) -> Chain:
        """Make the lattice, its walls and the forcing, which refuse what cannot be."""
        _ = self.on, self.drive, self.verge
        return self

    @property
    def place(self) -> Any:
        return lattice_by(self.lattice, option="lattice")

    @property
    def drive(self) -> Forcing:
        return forcing_of(self.forcing, **self.parameters)

    @property
    def verge(self) -> float:
        """Threshold of instability, the paper's unless given."""
        return threshold_on(self.place, self.threshold)

    @property
    def on(self) -> dict[str, Any]:
        """Arguments of `symmetric`, but for the forcing."""
        lattice = self.place
        # a spring of 0 is a parameter, too
        spring = {} if self.spring is None else {"spring": self.spring}
        own = {"site": self.site, "walls": walls_by(self.walls, lattice.sites), **spring}
        return {"lattice": lattice, "damping": self.damping, "omega": self.omega, **own}


class GridTask(Table):
    """Values of parameters: a result for each combination of them."""

    a: Ranged | None = None
    gamma: Ranged | None = None
    k: Ranged | None = None
    over: dict[str, Values] = Field(default_factory=dict)

    @property
    def given(self) -> dict[str, list[float]]:
        """Values of those of the three that have some."""
        return {name: values for name in PAIRS if (values := getattr(self, name)) is not None}


class BranchTask(GridTask):
    """Breathers along one parameter; of several values a branch each."""

    kind: ClassVar[str] = "branch"
    free: str
    window: Window | None = None
    root: int | None = Field(None, ge=1)
    optional: bool = False
    largest: float | None = Field(None, gt=0.0)

    @model_validator(mode="after")
    def complete(self) -> BranchTask:
        """Refuse parameters without a value, but for the free one."""
        missing = [name for name in PAIRS if name not in (self.free, *self.given)]
        if missing:
            raise ValueError(
                f"{' and '.join(missing)} missing: only the free parameter needs no value"
            )
        return self


class FromPoint(Table):
    """Start from a special point of another part."""

    of: Source
    at: str
    within: dict[str, Window] = Field(default_factory=dict)
    optional: bool = False


class Arms(FromPoint):
    """Branches that leave another at a special point."""

    kind: ClassVar[str] = "arms"


class Boundary(FromPoint):
    """A special point as a curve in two parameters."""

    kind: ClassVar[str] = "boundary"
    pair: list[str] = Field(min_length=2, max_length=2)
    largest: float | None = Field(None, gt=0.0)


class ZonesTask(GridTask):
    """Zone diagrams, one for each value."""

    kind: ClassVar[str] = "zones"
    within: dict[str, Window] = Field(default_factory=dict)
    past_folds: bool = False
    beyond: bool = False

    @model_validator(mode="after")
    def one_fixed(self) -> ZonesTask:
        """Refuse any but one parameter with values."""
        if len(self.given) != 1:
            fixed = ", ".join(self.given) or "none"
            raise ValueError(f"values of exactly one of k, gamma and a are expected, got {fixed}")
        return self


class Atlas(ZonesTask):
    """Zone diagrams whose curves make surfaces: all their points in one file, too."""


class Figure(Table):
    """Results that are drawn together."""

    draws: list[Source] = Field(min_length=1)
    file: str | None = None
    x: str | None = None
    y: str | None = None
    over: str | None = None
    at: dict[str, float] = Field(default_factory=dict)

    @property
    def options(self) -> dict[str, Any]:
        """Options that were given to `plot` or `plot_atlas`."""
        return self.model_dump(include={"x", "y", "over", "at"}, exclude_unset=True)


class Study(Table):
    title: str = ""
    chain: Chain = Chain()
    branch: dict[Name, BranchTask] = Field(default_factory=dict)
    arms: dict[Name, Arms] = Field(default_factory=dict)
    boundary: dict[Name, Boundary] = Field(default_factory=dict)
    zones: dict[Name, ZonesTask] = Field(default_factory=dict)
    atlas: dict[Name, Atlas] = Field(default_factory=dict)
    figure: dict[Name, Figure] = Field(default_factory=dict)

    @property
    def results(self) -> dict[str, Table]:
        return {name: table for kind in KINDS for name, table in getattr(self, kind).items()}

    def pictures(self, folder: Path) -> dict[str, Path]:
        """File of each figure, in the folder of the results."""
        return {name: folder / (one.file or f"{name}.png") for name, one in self.figure.items()}


# --- out of a file --------------------------------------------------------------------------------


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
    path = named("read", path)
    text = read_text(path)
    try:
        try:
            tables = tomllib.loads(text)
        except ValueError as error:  # which the one of numbers too long for Python is, too
            raise BadInput(f"{path} is not TOML: {error}") from error
        chain: Any = tables.get("chain")
        lattice = str(chain.get("lattice")) if isinstance(chain, dict) else ""
        if re.search(r"\.(csv|graphml)(:|$)", lattice.lower()):  # a file beside the study
            chain["lattice"] = str(path.resolve().parent / lattice)
        # also those of which the study says nothing because of their own mistakes
        kinds = [(name, kind) for kind in KINDS if isinstance(tables.get(kind), dict)
                 for name in tables[kind]]  # fmt: skip
        study, faults = _without_mistakes(tables)
    except RecursionError as error:
        raise BadInput(f"{path} is no study: tables or lists are too deep in others") from error
    if all(at[0] != "chain" for at, _ in faults):  # else there is another one in its place
        faults += [*_of_couplings(study), *_of_parameters(study)]
    if faults := [*faults, *_of_names(study, kinds), *_of_references(study, dict(kinds))]:
        lines = _lines(text)
        # of what is not there the line of the innermost table that is
        places = sorted((_line(lines, at), ".".join(at), why) for at, why in faults)
        said = [visible(f"line {n}{', ' * bool(at)}{at}: {why}") for n, at, why in places]
        several = "\n  ".join([f"{path.name} has {len(said)} mistakes:", *said])
        raise BadInput(several if said[1:] else f"{path.name}, {said[0]}")
    return study


def _without_mistakes(tables: dict[str, Any]) -> tuple[Study, list[Fault]]:
    """Leave out tables with mistakes: those in how the others fit together are found, too."""
    try:
        return Study.model_validate(tables), []
    except ValidationError as error:
        faults = [*_sentences(error)]
    for (first, *others), _ in faults:  # of several in one table it is gone with the first
        if others and first != "chain":
            tables[first].pop(others[0], None)
        else:
            tables.pop(first, None)
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
            case "model_type":
                table = f"[{place[0]}{'.NAME' * bool(place[1:])}]"
                yield place, f"a table {table} was expected, got {brief(mistake['input'])}"
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


def _of_couplings(study: Study) -> Iterator[Fault]:
    """Refuse couplings whose band comes to the drive, on chain and ring at the frequency 1; of
    others the library says so when a part is computed."""
    if study.chain.omega != 1.0 or not isinstance(study.chain.place, InfiniteChain | Ring):
        return
    for kind in ("branch", "zones", "atlas"):
        for name, table in getattr(study, kind).items():
            try:
                for value in table.gamma or ():
                    parameter("gamma", value)
            except BadInput as error:
                yield (kind, name, "gamma"), str(error)


def _of_parameters(study: Study) -> Iterator[Fault]:
    """Refuse parameters that chain and drive, or the plane of a diagram, do not have."""
    drive = study.chain.drive
    named = [(("branch", name, "free"), [table.free]) for name, table in study.branch.items()]
    named += [(("boundary", name, "pair"), table.pair) for name, table in study.boundary.items()]
    for place, parameters in named:
        try:
            for one in named_pair(parameters) if place[-1] == "pair" else parameters:
                one_of("the parameter", one, (*NUMBERS, *drive.params))
        except BadInput as error:
            yield place, str(error)
    for kind in ("branch", "zones", "atlas"):
        for name, table in getattr(study, kind).items():
            try:
                drive.at(**{letter: drive.params.get(letter, 0.0) for letter in table.over})
            except BadInput as error:
                yield (kind, name, "over"), str(error)
    for kind in ("zones", "atlas"):
        for name, table in getattr(study, kind).items():
            plane = PAIRS[next(iter(table.given))]
            for other in table.within.keys() - {*plane}:
                yield (kind, name, "within", other), f"the plane is that of {' and '.join(plane)}"


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
        elif "zones" in drawn and len(drawn) > 1:
            yield ("figure", name, "draws"), "zones are drawn beside zones only"
        fit = {"over", "at"} if "atlas" in drawn else set() if "zones" in drawn else {"x", "y"}
        for key in sorted(figure.options.keys() - fit) if drawn else ():
            yield (
                ("figure", name, key),
                "x and y are columns of branches, over and at choose surfaces of an atlas; leave "
                f"{key} out of a figure of {' and '.join(sorted(drawn))}",
            )
