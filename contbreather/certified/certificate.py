"""What is proved of a breather, of a special point, of a branch; and what is not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby

from contbreather.certified.balls import Interval
from contbreather.tables import Cell, Column, HtmlRepr, Sheet, yes_or_no

NAMES = {"LP": "a fold", "PF": "a pitchfork"}


@dataclass(frozen=True, repr=False)
class Certificate(HtmlRepr):
    """Proof about the symmetric breather next to a point; parameters are exact floats.

    Attributes
    ----------
    conditions : dict
        The parameters that are given, by name: a, gamma, k and coefficients of the forcing.
    within : float
        How far from the point a breather was looked for, in each unknown.
    kind : str
        ``"PF"`` or ``"LP"`` for a special point, whose parameter is then an unknown like p and phi.
    exists : bool or None
        True: the equations have a zero in the enclosure. False: they have none within `within` of
        the point. None: neither is proved.
    unique : bool
        It is their only zero in the enclosure, and in the box of half width `alone` around it.
    alone : float
    enclosure : dict of Interval
        Of each unknown, by name, and of what follows: chi, and b of the saltation matrix.
    admissible : bool or None
        True: no site, however far, is at a wall at any time, except site 0 at its impacts. False:
        one goes through a wall. None: neither is proved.
    reason : str
        Which site goes through a wall, and when.
    unstable : int or None
        Isolated multipliers of the half map outside the unit circle, a pair counting two; None
        where their number is not proved, or where the chain has no such motion.
    unproved : tuple of str
        Each says what is not proved, and why.
    """

    conditions: Mapping[str, float]
    within: float
    kind: str = ""
    exists: bool | None = None
    unique: bool = False
    alone: float = 0.0
    enclosure: Mapping[str, Interval] = field(default_factory=dict)
    admissible: bool | None = None
    reason: str = ""
    unstable: int | None = None
    unproved: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """True if an exact breather is proved to be there, and to keep off the walls."""
        return bool(self.exists and self.unique and self.admissible)

    def table(self) -> Sheet:
        """Tabulate what is proved, with its enclosures, and what is not."""
        rows: list[tuple[str, Cell]] = [
            ("exists", yes_or_no(self.exists)),
            ("the only one within", self.alone if self.unique else None),
            *((name, interval.text) for name, interval in self.enclosure.items()),
            ("admissible", yes_or_no(self.admissible)),
            ("multipliers of QS outside", self.unstable),
        ]
        if self.reason:
            rows.append(("why not", self.reason))
        rows += [("not proved", why) for why in self.unproved]
        return Sheet.of(rows, title="What is proved")

    def describe(self) -> str:
        """Say in sentences what is proved, and what is not."""
        return " ".join([*self._proved(), *(f"Not proved: {why}." for why in self.unproved)])

    def _proved(self) -> Iterator[str]:
        breather = "a solution of (11)" if self.admissible is False else "a breather"
        what = f"{NAMES[self.kind]} of breathers" if self.kind else breather
        if self.exists:
            yield f"Proved: {what} exists, the only one within {self.alone:g}."
        elif self.exists is False:
            yield f"Proved: {what} does not exist within {self.within:g} of this point."
        if self.admissible:
            yield "It keeps off all walls except at its impacts."
        elif self.admissible is False:
            yield f"{self.reason[0].upper()}{self.reason[1:]}: the chain has no such motion."
        if self.unstable is not None:
            several = f"{self.unstable or 'No'} isolated multiplier{'s' * (self.unstable > 1)}"
            yield f"{several} of the half map outside the unit circle."

    def __repr__(self) -> str:
        return f"<Certificate: {self.describe()}>"


@dataclass(frozen=True)
class Tile:
    """Proof about all breathers of a piece of a branch, in an interval of one coordinate.

    Attributes
    ----------
    along : str
        That coordinate: the parameter, or near folds p or phi.
    box : dict of Interval
        For each value of that coordinate there is exactly one breather in the box; empty where that
        is not proved.
    covers : Interval
        Values of the parameter that its breathers have.
    admissible, unstable
        Of all of them, as for a `Certificate`.
    why : str
        What is not proved, and why.
    """

    along: str
    box: Mapping[str, Interval]
    covers: Interval
    admissible: bool | None
    unstable: int | None
    why: str = ""

    def __bool__(self) -> bool:
        return self.admissible is True


@dataclass(frozen=True, repr=False)
class Covering(HtmlRepr):
    """A branch proved by tiles.

    Attributes
    ----------
    free : str
        The parameter of the branch.
    tiles : tuple of Tile
        In order along the branch, each with exactly one breather for each value of its coordinate.
    connected : bool
        Neighbours share a breather, so all are on one smooth curve, from the first to the last.
    unproved : tuple of str
        Each says what is not proved, where, and why.

    Examples
    --------
    >>> import contbreather as cb
    >>> from contbreather.certified import certify
    >>> b = cb.symmetric(a=0.5, gamma=0.02, k=0.8)
    >>> branch = cb.trace(b, "gamma", within={"gamma": (0.02, 0.03)}, towards="up")
    >>> proof = certify(branch)
    >>> proof.connected, proof.covered, proof.unproved
    (True, (Interval(low=0.02, high=0.03),), ())
    """

    free: str
    tiles: tuple[Tile, ...]
    connected: bool
    unproved: tuple[str, ...] = ()

    @property
    def covered(self) -> tuple[Interval, ...]:
        """The values of the parameter over which breathers are proved to exist, unique in their
        tiles, and to keep off the walls: intervals in order along the branch, joined."""
        return self._joined(bool)

    def counted(self, unstable: int | None) -> tuple[Interval, ...]:
        """Tiles over which they are proved to have so many multipliers outside the circle; None:
        where their number is not proved."""
        return self._joined(lambda tile: bool(tile) and tile.unstable == unstable)

    def _joined(self, which: Callable[[Tile], bool]) -> tuple[Interval, ...]:
        runs = [[t.covers for t in run] for yes, run in groupby(self.tiles, which) if yes]
        return tuple(Interval(min(run)[0], max(interval.high for interval in run)) for run in runs)

    def table(self) -> Sheet:
        """A line for each interval over which breathers have so many multipliers outside, and one
        for each gap."""
        counts = dict.fromkeys(tile.unstable for tile in self.tiles if tile)
        proved = [(n, interval.text) for n in counts for interval in self.counted(n)]
        where = [*(shown for _, shown in proved), *("not proved" for _ in self.unproved)]
        outside = [*(n for n, _ in proved), *self.unproved]
        return Sheet([Column(self.free, where), Column("multipliers of QS outside", outside)])

    def describe(self) -> str:
        parts = ", ".join(interval.text for interval in self.covered) or "nowhere"
        whole = "one smooth curve" if self.connected else "not proved to be one curve"
        lines = [
            f"Proved over {self.free} in {parts} by {len(self.tiles)} tiles ({whole}): breathers "
            "exist, unique in their tiles, and keep off all walls except at their impacts.",
            *(f"Not proved: {why}." for why in self.unproved),
        ]
        return " ".join(lines)

    def __repr__(self) -> str:
        return f"<Covering: {self.describe()}>"
