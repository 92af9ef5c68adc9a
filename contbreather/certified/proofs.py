"""Breathers and special points proved one by one, and a branch of breathers piece by piece.

A tile of a branch is an interval of one coordinate of (p, phi, parameter) and a box of the other
two. Krawczyk's test with that coordinate a ball proves exactly one zero in the box for each of its
values; the zero depends smoothly on it. What cannot be proved of a tile is tried of its halves.
Neighbours share a point of the branch: where its own enclosure lies in both boxes, both hold the
same curve.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any

from flint import arb

from contbreather.certified import averages, winding
from contbreather.certified.averages import (
    check_forcing,
    equations,
    fold_condition,
    pitchfork_condition,
    saltation_enclosure,
    scaled_values,
)
from contbreather.certified.balls import (
    Ball,
    Equations,
    Interval,
    hull,
    interval,
    jacobian_enclosure,
    krawczyk,
    newton_step,
    working,
)
from contbreather.certified.certificate import Certificate, Covering, Tile
from contbreather.certified.inside_walls import admissible
from contbreather.errors import BadInput
from contbreather.lattice.chain import InfiniteChain
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.parameters import NUMBERS

DEFINING = {"LP": fold_condition, "PF": pitchfork_condition}


def parameters(orbit: Any) -> dict[str, float]:
    """Parameters of a symmetric breather with one impacting site on the infinite chain without
    springs, driven by exact harmonics, by name: exactly what they are given as."""
    section = getattr(orbit, "section", None)
    if section is None:
        raise BadInput(f"{orbit!r}: certify() takes a breather, a point or a branch of breathers.")
    if not (section.symmetric and section.count == 1):
        raise BadInput(
            "certify() is about symmetric breathers with one impacting site; this one has the "
            f"{section.describe()}."
        )
    on: Conditions = orbit.conditions
    plain = on.walls == Walls() and not (on.spring or on.damping)
    if on.lattice != InfiniteChain() or not plain:
        way = "take it to the chain, orbit.on(InfiniteChain())" if plain else "begin without these"
        raise BadInput(
            "certify() is about breathers of the infinite chain, without springs or damping, walls "
            f"at -1 and 1; this one is on the {on.lattice.describe()} with spring = {on.spring}, "
            f"damping = {on.damping}: {way}."
        )
    check_forcing(on.forcing)
    return {name: x for name, x in on.params.items() if name not in ("damping", "spring")}


def zero_near(equations: Equations, point: Sequence[float], within: float) -> list[Ball] | None:
    """An enclosure of the one zero in a box around a point, or None if none is found."""
    try:
        step = newton_step(equations, [arb(x) for x in point])
    except ZeroDivisionError:
        return None
    radius = min(within, 4.0 * max(abs(float(x.mid())) for x in step) + 1e-30)
    while radius <= within:
        box = krawczyk(equations, [arb(x, radius) for x in point])
        if box is not None:
            return krawczyk(equations, box) or box
        radius *= 16.0
    return None


def alone_within(equations: Equations, zero: Sequence[Ball]) -> float:
    """Half the width of a box around a zero in which there is no other."""
    middle, radius = [float(x.mid()) for x in zero], 0.3  # the widest box tried
    while radius > 1e-15:
        box = [arb(x, radius) for x in middle]
        if all(x.contains_interior(y) for x, y in zip(box, zero, strict=True)) and krawczyk(
            equations, box
        ):
            return radius
        radius *= 0.5
    return 0.0


def certify_point(
    params: Mapping[str, float], unknowns: Mapping[str, float], kind: str, within: float
) -> Certificate:
    """The proof for a breather (kind "") or a special point: parameters, a guess at unknowns."""
    names, point = tuple(unknowns), tuple(unknowns.values())
    certificate = Certificate(dict(params), within, kind)
    with working():
        fixed = {name: arb(x) for name, x in params.items()}
        system = equations(fixed, names, DEFINING.get(kind))
        zero = zero_near(system, point, within)
        if zero is None:
            box = [arb(x, within) for x in point]
            none = any(not value.contains(0) for value in system(box))  # surely no zero in it
            why = () if none else (f"that there is a breather within {within:g} of this point",)
            return replace(certificate, exists=False if none else None, unproved=why)
        found = dict(zip(names, zero, strict=True))
        values = scaled_values({**fixed, **found})
        follows = {"chi": averages.chi(values["gamma"]), "b": saltation_enclosure(values)}
        return replace(
            certificate,
            exists=True,
            unique=True,
            alone=alone_within(system, zero),
            enclosure={name: interval(x) for name, x in {**found, **follows}.items()},
            **_judged(values, kind),
        )


def _judged(values: Mapping[str, Ball], kind: str) -> dict[str, Any]:
    """Prove that it keeps off the walls; if it may, count its multipliers."""
    holds, reason = admissible(values)
    entries: dict[str, Any] = {"admissible": holds}
    if holds is False:
        return {**entries, "reason": reason}
    missing = [] if holds else [f"whether it is admissible: {reason}"]
    if kind:
        missing.append("how many multipliers are outside the circle: one is on it")
    else:
        b = saltation_enclosure(values)
        entries["unstable"], why = winding.count(values["gamma"], values["k"], b)
        missing += [why] if why else []
    return {**entries, "unproved": tuple(missing)}


# --- a branch, tile by tile -----------------------------------------------------------------------

OVERLAP = 1e-12  # by which tiles reach beyond the points that they share
DOMAIN = {name: (NUMBERS[name].low, NUMBERS[name].high) for name in ("gamma", "k")}

Place = tuple[float, ...]  # p, phi, parameter


@dataclass(frozen=True)
class BranchSheet:
    """The equations of a branch, in p, phi and its parameter."""

    fixed: Mapping[str, Ball]
    free: str

    @property
    def names(self) -> tuple[str, ...]:
        return ("p", "phi", self.free)

    @cached_property
    def system(self) -> Equations:
        return equations(self.fixed, self.names)

    def cut(self, along: int, x: Ball) -> Equations:
        """The equations in the other two coordinates, where this one is in a ball."""

        def at(point: Sequence[Ball]) -> list[Ball]:
            full = list(point)
            full.insert(along, x)
            return self.system(full)

        return at

    def on_curve(self, along: int, guess: Place) -> Place:
        """The point of the branch with this coordinate, by Newton's method from a guess."""
        here = self.cut(along, arb(guess[along]))
        point = [arb(x) for i, x in enumerate(guess) if i != along]
        for _ in range(4):
            step = newton_step(here, point)
            point = [arb((x - move).mid()) for x, move in zip(point, step, strict=True)]
        place = [float(x) for x in point]
        place.insert(along, guess[along])
        return tuple(place)

    def tangent(self, at: Place) -> list[float]:
        """Its direction, by size only: the cross product of both gradients, of length 1."""
        (x, y, z), (u, v, w) = (
            [float(ball.mid()) for ball in row]
            for row in jacobian_enclosure(self.system, [arb(coordinate) for coordinate in at])
        )
        cross = (y * w - z * v, z * u - x * w, x * v - y * u)
        return [abs(component) / math.hypot(*cross) for component in cross]

    def coordinate(self, ends: tuple[Place, Place], outer: bool) -> int:
        """The one to cut along: that in which the curve is steepest at both ends. At an end of the
        branch the parameter, which is exact there, unless the curve turns over in it."""
        least = [min(pair) for pair in zip(*map(self.tangent, ends), strict=True)]
        # with less of the unit tangent it turns over
        return 2 if outer and least[2] > 0.03 else least.index(max(least))


@dataclass(frozen=True)
class ProvenPiece:
    """A tile between two points of the branch, as it is worked on: the box in which a zero is the
    only one, and the smaller one it is in."""

    ends: tuple[Place, Place]
    along: int
    alone: tuple[Ball, ...] = ()
    box: tuple[Ball, ...] = ()
    admissible: bool | None = None
    unstable: int | None = None
    why: str = ""

    @property
    def width(self) -> float:
        return abs(self.ends[1][self.along] - self.ends[0][self.along])

    @property
    def done(self) -> bool:
        """Proved, or not worth halving."""
        if self.admissible is None:
            return self.width <= 1e-9  # that there are breathers, or clear ones, is not proved
        # 1e-5 where only the number of multipliers is not
        return not self.admissible or self.unstable is not None or self.width <= 1e-5


def _proved(sheet: BranchSheet, ends: tuple[Place, Place], outer: tuple[bool, bool]) -> ProvenPiece:
    """Prove as much as is possible between two points without halving; at an outer end of the
    branch a tile does not reach beyond it."""
    along = sheet.coordinate(ends, any(outer))
    piece = ProvenPiece(ends, along, why="that breathers exist")
    chord = _halfway(*ends)
    middle = sheet.on_curve(along, chord)
    tangent = sheet.tangent(middle)
    x, half = _reach(sheet, ends, along, outer), 0.5 * piece.width
    sizes = [
        1.2 * slope / tangent[along] * half + 4.0 * abs(here - there) + 4.0 * OVERLAP
        for slope, here, there in zip(tangent, middle, chord, strict=True)
    ]
    for wider in (1.0, 2.0, 4.0):
        alone = [arb(here, wider * size) for here, size in zip(middle, sizes, strict=True)]
        alone[along] = x
        box = krawczyk(sheet.system, alone, along)
        if box is not None:
            return _settled(sheet, replace(piece, alone=tuple(alone), box=tuple(box), why=""))
    return piece


def _reach(
    sheet: BranchSheet, ends: tuple[Place, Place], along: int, outer: Sequence[bool]
) -> Ball:
    first, last = (end[along] for end in ends)
    side = OVERLAP if last > first else -OVERLAP
    low, high = sorted((first - side * (not outer[0]), last + side * (not outer[1])))
    name = sheet.names[along]
    bottom, top = DOMAIN.get(name, (low, high))
    if name == "gamma" and "omega" in sheet.fixed:
        top *= float(sheet.fixed["omega"]) ** 2
    return hull(max(low, bottom), min(high, top))


def _settled(sheet: BranchSheet, piece: ProvenPiece) -> ProvenPiece:
    """Add the proofs about all breathers of a tile."""
    values = scaled_values({**sheet.fixed, **dict(zip(sheet.names, piece.box, strict=True))})
    holds, reason = admissible(values)
    if not holds:
        why = "" if holds is False else f"whether breathers are admissible: {reason}"
        return replace(piece, admissible=holds, why=why)
    unstable, why = winding.count(values["gamma"], values["k"], saltation_enclosure(values))
    return replace(piece, admissible=True, unstable=unstable, why=why)


def _cover(
    sheet: BranchSheet, ends: tuple[Place, Place], outer: tuple[bool, bool]
) -> list[ProvenPiece]:
    """Pieces from one point to the other: the widest that is not done is halved, until all are or
    there are 400."""
    pieces = [(_proved(sheet, ends, outer), outer)]
    while len(pieces) < 400 and (left := [i for i, (p, _) in enumerate(pieces) if not p.done]):
        i = max(left, key=lambda i: pieces[i][0].width)
        piece, outer = pieces[i]
        middle = sheet.on_curve(piece.along, _halfway(*piece.ends))
        halves = (
            ((piece.ends[0], middle), (outer[0], False)),
            ((middle, piece.ends[1]), (False, outer[1])),
        )
        pieces[i : i + 1] = [(_proved(sheet, half, edge), edge) for half, edge in halves]
    return [piece for piece, _ in pieces]


def _halfway(begin: Place, end: Place) -> Place:
    return tuple(0.5 * (x + y) for x, y in zip(begin, end, strict=True))


def _joined(sheet: BranchSheet, first: ProvenPiece, second: ProvenPiece) -> bool:
    """Test whether the point that two tiles share is proved to be in both."""
    place, along = first.ends[1], first.along
    if not (first.box and second.box):
        return False
    rest = [x for i, x in enumerate(place) if i != along]
    zero = zero_near(sheet.cut(along, arb(place[along])), rest, OVERLAP)
    if zero is None:
        return False
    zero.insert(along, arb(place[along]))
    return all(
        x.contains(z) for piece in (first, second) for x, z in zip(piece.alone, zero, strict=True)
    )


def _tile(sheet: BranchSheet, piece: ProvenPiece) -> Tile:
    first, last = (end[-1] for end in piece.ends)
    low, high = sorted((first, last))
    inner = 0.0 if piece.along == 2 else OVERLAP  # ends of other tiles are known to rounding
    boxes = {name: interval(x) for name, x in zip(sheet.names, piece.box, strict=False)}
    covers = Interval(low + inner, high - inner)
    along = sheet.names[piece.along]
    return Tile(along, boxes, covers, piece.admissible, piece.unstable, piece.why)


def certify_curve(params: Mapping[str, float], free: str, places: Sequence[Place]) -> Covering:
    """The proof of a branch through these points; `params` are its other parameters."""
    with working():
        sheet = BranchSheet({name: arb(x) for name, x in params.items() if name != free}, free)
        pieces: list[ProvenPiece] = []
        last = len(places) - 2
        for i, ends in enumerate(pairwise(places)):
            pieces += _cover(sheet, ends, (i == 0, i == last))
        joined = all(_joined(sheet, first, second) for first, second in pairwise(pieces))
        tiles = tuple(_tile(sheet, piece) for piece in pieces)
    return Covering(free, tiles, joined, tuple(_missing(free, tiles)))


def _missing(free: str, tiles: Sequence[Tile]) -> Iterator[str]:
    """One sentence for each run of tiles that lack the same."""
    for what, run in groupby(tiles, lambda tile: tile.why.split(":")[0]):
        if what:
            stretch = list(run)
            # of the narrowest tile the ends, known to rounding, may pass each other
            low, high = sorted(
                (min(t.covers.low for t in stretch), max(t.covers.high for t in stretch))
            )
            yield f"for {free} in {Interval(low, high).text}, {stretch[0].why}"
