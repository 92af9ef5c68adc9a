"""What a study may say: the tables of its file, each key with its kind and its range."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Annotated, Any, NamedTuple

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationInfo,
    model_validator,
)

from contbreather.checks import number, real, spread
from contbreather.lattice.forcing import Forcing
from contbreather.lattice.formula import forcing_of
from contbreather.lattice.parse import lattice_by, walls_by
from contbreather.orbits.zone_search import PAIRS
from contbreather.orbits.zones import fixed_value
from contbreather.parameters import CHOICES, NUMBERS, parameter
from contbreather.stability.verdict import THRESHOLD, check_threshold

_PART = re.compile(r"([^/=]+)(?:/([^/=]+=[^/]+))?(?:/([^/=]+))?")
SPREAD = {"from", "to", "count"}
WANTED = "a value"
KINDS = ("branch", "arms", "boundary", "zones", "atlas")  # of results


class Part(NamedTuple):
    """What `of` and `draws` name: a family, its members with these values, one of their arms."""

    family: str
    member: Mapping[str, float]
    arm: str

    def has(self, at: Mapping[str, float]) -> bool:
        """Whether the member with these values is among those that are named."""
        return all(at.get(name) == value for name, value in self.member.items())


def part(named: str) -> Part:
    """``scan/gamma=0.02,k=0.8/arm1`` taken apart; only the family has to be there."""
    if match := _PART.fullmatch(named):
        family, member, arm = match.groups(default="")
        pairs = (item.partition("=") for item in member.split(",") if item)
        with suppress(ValueError):
            return Part(family, {name.strip(): float(value) for name, _, value in pairs}, arm)
    raise ValueError(f"{named!r}: NAME, NAME/gamma=0.02 or NAME/gamma=0.02/arm1 was expected")


def a_part(name: str) -> str:
    """The name of a part, as it was typed."""
    part(name)
    return name


def typed_values(typed: Any) -> list[float]:
    """A number, a list of numbers, or so many from one to another."""
    if isinstance(typed, Mapping):
        if set(typed) != SPREAD:
            raise ValueError(
                f"{typed}: from, to and count were expected, {{from=0.3, to=0.9, count=7}}"
            )
        return spread("values", typed["from"], typed["to"], typed["count"])
    several = typed if isinstance(typed, list) else [typed]
    if not several:
        raise ValueError("an empty list: at least one number was expected")
    numbers = [number("value", value, -1e300, 1e300, WANTED) for value in several]
    if len(set(numbers)) < len(numbers):
        raise ValueError(f"{typed}: each value once")
    return numbers


def typed_window(typed: Any) -> list[float]:
    """Two numbers, the smaller first; the second may be inf."""
    numbers = [real(x) for x in typed] if isinstance(typed, list) else []
    if len(numbers) != 2 or not numbers[0] < numbers[1] or math.isinf(numbers[0]):
        raise ValueError(f"{typed}: two numbers were expected, the smaller first, [0.0, 0.2]")
    return numbers


def in_range(typed: Any, info: ValidationInfo) -> Any:
    """A value, or several, in the range of the parameter that has the name of the key."""
    for value in typed if isinstance(typed, list) else [typed]:
        parameter(str(info.field_name), value)
    return typed


def in_planes(typed: list[float]) -> list[float]:
    """Values of k at which there are zones."""
    return [fixed_value("k", value) for value in typed]


Named = Annotated[str, AfterValidator(a_part)]
Values = Annotated[list[float], PlainValidator(typed_values)]
Ranged = Annotated[list[float], PlainValidator(typed_values), AfterValidator(in_range)]
Window = Annotated[list[float], PlainValidator(typed_window)]
Least = Annotated[float, AfterValidator(in_range)]


class Table(BaseModel):
    """One table of the file; keys that it does not know are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    @property
    def source(self) -> str:
        """What it starts from, empty if that is nothing."""
        return part(self.of).family if isinstance(self, FromPoint) else ""

    @property
    def entries(self) -> dict[str, Any]:
        """What was said, without what was not."""
        return self.model_dump(exclude_none=True)


class Chain(Table):
    """What breathers live on, and what drives it."""

    lattice: str | None = None
    forcing: str = CHOICES["forcing"].default
    parameters: dict[str, float] = Field(default_factory=dict)
    threshold: float | None = None
    damping: Least = NUMBERS["damping"].default
    spring: Least | None = None
    site: int = CHOICES["site"].default
    walls: list[str] = Field(default_factory=list)

    @model_validator(mode="after")
    def possible(self) -> Chain:
        """The lattice and the forcing can be made."""
        lattice = self.place
        if self.threshold is not None and lattice.sites is None:
            raise ValueError("threshold: only finite lattices have one; name a lattice, 'ring:400'")
        if not self.damping:
            check_threshold(self.verge)
        _ = self.drive, self.on
        return self

    @property
    def place(self) -> Any:
        return lattice_by(self.lattice, option="lattice")

    @property
    def drive(self) -> Forcing:
        return forcing_of(self.forcing, **self.parameters)

    @property
    def verge(self) -> float:
        """The threshold, the paper's unless given."""
        return THRESHOLD if self.threshold is None else self.threshold

    @property
    def on(self) -> dict[str, Any]:
        """As `symmetric` takes it, but for the forcing."""
        walls = walls_by(self.walls, self.place.sites)
        options = {"site": self.site or None, "damping": self.damping or None, "walls": walls}
        options["spring"] = self.spring  # one of 0 is a parameter, too
        return {"lattice": self.place, **{n: v for n, v in options.items() if v is not None}}


class GridTask(Table):
    """Values of parameters: something for each combination of them."""

    a: Ranged | None = None
    gamma: Ranged | None = None
    k: Ranged | None = None
    over: dict[str, Values] = Field(default_factory=dict)

    @property
    def given(self) -> list[str]:
        """Those of the three that have values."""
        return [name for name in PAIRS if getattr(self, name) is not None]

    @property
    def grid(self) -> dict[str, list[float]]:
        return {**{name: getattr(self, name) for name in self.given}, **self.entries["over"]}


class BranchTask(GridTask):
    """Breathers along one parameter; of several values a branch each."""

    free: str
    window: Window | None = None
    root: Annotated[int, Field(ge=1)] | None = None
    optional: bool = False
    largest: Annotated[float, Field(gt=0.0)] | None = None

    @model_validator(mode="after")
    def complete(self) -> BranchTask:
        """Each parameter but the free one has a value."""
        missing = [name for name in PAIRS if name not in (self.free, *self.given)]
        if missing:
            raise ValueError(
                f"{' and '.join(missing)} missing: only the free parameter needs no value"
            )
        return self


class FromPoint(Table):
    """What starts from a special point of another part."""

    of: Named
    at: str
    within: dict[str, Window] = Field(default_factory=dict)
    optional: bool = False


class Arms(FromPoint):
    """What leaves a branch at a special point."""


class Boundary(FromPoint):
    """A special point as a curve in two parameters."""

    pair: list[str] = Field(min_length=2, max_length=2)
    largest: Annotated[float, Field(gt=0.0)] | None = None


class ZonesTask(GridTask):
    """Zone diagrams, one for each value."""

    k: Annotated[list[float], PlainValidator(typed_values), AfterValidator(in_planes)] | None = None
    within: dict[str, Window] = Field(default_factory=dict)
    past_folds: bool = False

    @model_validator(mode="after")
    def one_fixed(self) -> ZonesTask:
        """Exactly one of the three has values."""
        fixed = self.given
        if len(fixed) != 1:
            raise ValueError(
                f"values of exactly one of k, gamma and a are expected, got {fixed or 'none'}"
            )
        wrong = sorted(set(self.within) - set(PAIRS[fixed[0]]))
        if wrong:
            raise ValueError(
                f"within: the plane is that of {PAIRS[fixed[0]]}, which has no {wrong[0]}"
            )
        return self

    @property
    def fixed(self) -> str:
        return self.given[0]


class Atlas(ZonesTask):
    """Zone diagrams whose curves make surfaces: all their points in one file, too."""


class Figure(Table):
    """What is drawn together."""

    draws: list[Named] = Field(min_length=1)
    file: str | None = None
    x: str | None = None
    y: str | None = None
    over: str | None = None
    at: dict[str, float] = Field(default_factory=dict)

    def path(self, name: str) -> str:
        """The file it is drawn to, in the folder of the study."""
        return self.file or f"{name}.png"


class Study(Table):
    """All of it."""

    title: str = ""
    chain: Chain = Chain()
    branch: dict[str, BranchTask] = Field(default_factory=dict)
    arms: dict[str, Arms] = Field(default_factory=dict)
    boundary: dict[str, Boundary] = Field(default_factory=dict)
    zones: dict[str, ZonesTask] = Field(default_factory=dict)
    atlas: dict[str, Atlas] = Field(default_factory=dict)
    figure: dict[str, Figure] = Field(default_factory=dict)

    @property
    def results(self) -> dict[str, Table]:
        """Everything that is computed, by its name."""
        return {name: table for kind in KINDS for name, table in getattr(self, kind).items()}
