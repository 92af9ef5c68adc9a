"""Breathers and special points proved one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from flint import arb

from contbreather.certified import averages
from contbreather.certified.averages import check_forcing, equations, fold, pitchfork, saltation
from contbreather.certified.balls import (
    Ball,
    Equations,
    Interval,
    about,
    interval,
    krawczyk,
    newton_step,
    working,
)
from contbreather.certified.certificate import Certificate
from contbreather.certified.inside_walls import admissible
from contbreather.certified.winding import unstable_count
from contbreather.errors import BadInput
from contbreather.lattice import InfiniteChain
from contbreather.lattice.conditions import Conditions, Walls

UNKNOWNS = ("p", "phi")
DEFINING = {"LP": fold, "PF": pitchfork}
FARTHEST = 0.3  # half width of the largest box in which a zero is tried to be the only one


def parameters(on: Conditions) -> dict[str, float]:
    """Those that are exactly what they are given as, by name; or why there is no proof.

    Raises
    ------
    BadInput
        Unless this is about the infinite chain without springs, driven by exact harmonics.
    """
    if on.lattice != InfiniteChain() or on.spring or on.damping or on.walls != Walls():
        raise BadInput(
            "certify() is about breathers of the infinite chain, without springs or damping, walls "
            f"at -1 and 1; this one is on the {on.lattice.describe()} with spring = {on.spring}, "
            f"damping = {on.damping}: take it to the chain, orbit.on(InfiniteChain())."
        )
    check_forcing(on.forcing)
    return {name: x for name, x in on.params.items() if name not in ("damping", "spring")}


def checked(orbit: Any) -> Any:
    """An orbit that these proofs are about."""
    section = getattr(orbit, "section", None)
    if section is None:
        raise BadInput(f"{orbit!r}: certify() takes a breather, a point or a branch of breathers.")
    if not (section.symmetric and section.count == 1):
        raise BadInput(
            "certify() is about symmetric breathers with one impacting site; this one has the "
            f"{section.describe()}."
        )
    return orbit


def box_around(point: Sequence[float], radius: float) -> list[Ball]:
    return [about(x, radius) for x in point]


def zero_near(equations: Equations, point: Sequence[float], within: float) -> list[Ball] | None:
    """An enclosure of the one zero in a box around a point, or None if none is found."""
    step = newton_step(equations, [arb(x) for x in point])
    if step is None:
        return None
    radius = min(within, 4.0 * max(step) + 1e-30)
    while radius <= within:
        box = krawczyk(equations, box_around(point, radius))
        if box is not None:
            return krawczyk(equations, box) or box
        radius *= 16.0
    return None


def alone_within(equations: Equations, zero: Sequence[Ball]) -> float:
    """Half the width of a box around a zero in which there is no other."""
    middle, radius = [float(x.mid()) for x in zero], FARTHEST
    while radius > 1e-15:
        box = box_around(middle, radius)
        if all(x.contains_interior(y) for x, y in zip(box, zero, strict=True)) and krawczyk(
            equations, box
        ):
            return radius
        radius *= 0.5
    return 0.0


def excluded(equations: Equations, point: Sequence[float], within: float) -> bool:
    """Whether there is surely no zero in the box around a point."""
    return any(not value.contains(0) for value in equations(box_around(point, within)))


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
            none = excluded(system, point, within)
            why = () if none else (f"that there is a breather within {within:g} of this point",)
            return replace(certificate, exists=False if none else None, unproved=why)
        values = {**fixed, **dict(zip(names, zero, strict=True))}
        return replace(
            certificate,
            exists=True,
            unique=True,
            alone=alone_within(system, zero),
            enclosure=_enclosure(values, names),
            **_judged(values, kind),
        )


def _judged(values: Mapping[str, Ball], kind: str) -> dict[str, Any]:
    """Whether it keeps off the walls; if it may, its multipliers."""
    verdict = admissible(values)
    entries: dict[str, Any] = {"admissible": verdict.holds}
    if verdict.holds is False:
        return {**entries, "reason": verdict.reason}
    missing = [] if verdict.holds else [f"whether it is admissible: {verdict.reason}"]
    if kind:
        missing.append("how many multipliers are outside the circle: one is on it")
    else:
        entries["unstable"], why = unstable_count(values)
        missing += [f"how many multipliers are outside the circle: {why}"] if why else []
    return {**entries, "unproved": tuple(missing)}


def _enclosure(values: Mapping[str, Ball], names: Sequence[str]) -> dict[str, Interval]:
    follows = {"chi": averages.chi(values["gamma"]), "b": saltation(values)}
    return {name: interval(x) for name, x in [*((n, values[n]) for n in names), *follows.items()]}
