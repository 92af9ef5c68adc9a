"""Tables of a study file: each key with its type. Ranges are those of the library's own checks."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationInfo,
    model_validator,
)

from contbreather.checks import numbers, spread
from contbreather.lattice.forcing import Forcing
from contbreather.lattice.formula import forcing_of
from contbreather.lattice.parse import lattice_by, walls_by
from contbreather.orbits.zone_search import PAIRS
from contbreather.parameters import CHOICES, NUMBERS, parameter
from contbreather.stability.verdict import threshold_on

_PART = re.compile(r"([^/=]+)(?:/([^/=]+=[^/]+))?(?:/([^/=]+))?")
KINDS = ("branch", "arms", "boundary", "zones", "atlas")  # of results


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
                f"{typed}: from, to and count were expected, {{from=0.3, to=0.9, count=7}}"
            )
        return spread("values", typed["from"], typed["to"], typed["count"])
    values: list[float] = numbers("values", typed if isinstance(typed, list) else [typed]).tolist()
    if not values or len({*values}) < len(values):
        raise ValueError(f"{typed}: at least one number was expected, each once")
    return values


def _in_range(typed: Any, info: ValidationInfo) -> Any:
    """Check values by the range of the parameter that has the name of the key."""
    for value in typed if isinstance(typed, list) else [typed]:
        parameter(str(info.field_name), value)
    return typed


def _name(typed: str) -> str:
    if not re.fullmatch(r"[\w-]+", typed):
        raise ValueError("a name of letters, digits, - and _ was expected")
    return typed


Name = Annotated[str, AfterValidator(_name)]
Source = Annotated[Part, PlainValidator(_part)]
Values = Annotated[list[float], PlainValidator(_values)]
Ranged = Annotated[list[float], PlainValidator(_values), AfterValidator(_in_range)]
Window = Annotated[list[float], Field(min_length=2, max_length=2)]
Loss = Annotated[float | list[float], AfterValidator(_in_range)]


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
    root: int | None = None
    optional: bool = False
    largest: float | None = None

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
    largest: float | None = None


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
