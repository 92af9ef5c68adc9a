"""Zones of existence and stability in two parameters, as in Fig. 2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, Unpack, overload

import numpy as np

from contbreather.checks import MOST, flag, whole
from contbreather.continuation.curve.settings import windows
from contbreather.continuation.walk.checkpoint import Inner, Save, checkpoint
from contbreather.errors import BadInput, add_partial_result
from contbreather.lattice.band_averages import UniformLattice
from contbreather.lattice.chain import lattice_of
from contbreather.lattice.finite import Lattice as Finite
from contbreather.lattice.finite import per_site
from contbreather.lattice.forcing import Drive, check_symmetric
from contbreather.lattice.formula import forcing_of
from contbreather.one_thread import one_thread
from contbreather.orbits.zone_diagram import ZoneDiagrams, Zones
from contbreather.orbits.zone_search import ZoneSearch, second_of
from contbreather.parameters import HEAVIEST, parameter
from contbreather.progress import Counter
from contbreather.stability.verdict import threshold_on


class ZoneArguments(TypedDict, total=False):
    """The keywords of `zones` besides the parameter that is fixed."""

    forcing: Drive | None
    lattice: UniformLattice | None
    within: Mapping[str, tuple[float, float]] | None
    progress: bool | Counter | None
    threshold: float | None
    past_folds: bool
    beyond: bool
    save: Save
    site: int
    damping: float
    spring: float | None
    walls: Any
    omega: float


@overload
def zones(
    *,
    k: float | None = None,
    gamma: float | None = None,
    a: float | None = None,
    **drawn: Unpack[ZoneArguments],
) -> Zones: ...


@overload
def zones(
    *,
    k: Sequence[float] | None = None,
    gamma: Sequence[float] | None = None,
    a: Sequence[float] | None = None,
    **drawn: Unpack[ZoneArguments],
) -> ZoneDiagrams: ...


@one_thread
def zones(
    *,
    k: float | Sequence[float] | None = None,
    gamma: float | Sequence[float] | None = None,
    a: float | Sequence[float] | None = None,
    forcing: Drive | None = None,
    lattice: UniformLattice | None = None,
    within: Mapping[str, tuple[float, float]] | None = None,
    progress: bool | Counter | None = None,
    threshold: float | None = None,
    past_folds: bool = False,
    beyond: bool = False,
    save: Save = None,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
    omega: float = 1.0,
) -> Zones | ZoneDiagrams:
    """Draw all curves of the zone diagram with one of k, gamma, a fixed; nobody supplies a seed.

    Parameters
    ----------
    k, gamma, a : float or sequence of float
        Exactly one: the plane is that of the other two, ``(gamma, a)`` for the paper's Fig. 2.
        Several values give as many diagrams. Or two of them: the plane is that of the frequency and
        the third, ``(omega, a)`` of ``zones(k=0.8, gamma=0.05)``, ``(omega, gamma)`` of ``zones(
        k=0.8, a=0.9)``.
    forcing : Forcing, str or function of t, optional
        `Harmonic` unless given.
    lattice : InfiniteChain, Ring or Lattice, optional
        The infinite chain unless given, or any finite lattice. On a `Ring` the NS curves follow the
        paper's rule: they are the pieces of one envelope, each of the wave that is first to pass
        the threshold.
    within : dict, optional
        Windows of the two parameters, narrower than the defaults.
    progress : bool, optional
        As for `trace`.
    threshold : float, optional
        Modulus over 2 pi beyond which a multiplier counts, the paper's 1.005 unless given; for
        finite lattices only.
    past_folds : bool, optional
        Whether the diagram is of the lower breathers, too: those behind a fold, of one harmonic the
        ones with the smaller p. Unless asked for it is of the upper ones, whatever the forcing: the
        lower ones are unstable throughout, and the fold ends the zone. But they may exist where no
        upper one does, at most up to a max|f| = 1 where their impacts vanish, p -> 0.
    beyond : bool, optional
        Whether regions beyond GR say which orbit is there: at some places of each the one is
        followed that `switch` leads to, with other sites that impact, or more impacts of the same.
    save : str or Path, optional
        As for `trace`.
    site, damping, spring, walls
        As for `symmetric`, on finite lattices. There curves are followed by exact modes, at seconds
        each and more; NS are then the curves on which a pair passes the threshold, without damping
        those of pairs that are somewhere the first to do so.
    omega : float
        Frequency of the drive, as for `symmetric`, where it is not in the plane.

    Returns
    -------
    Zones
        LP (lower limit of existence), GR (upper limit, or site 0 grazing for small k), PF and NS
        (limits of stability), each to the end of the region where breathers exist. For several
        values, ``k=[0.8, 0.4]``, a tuple of them in the same order, with one table.

    Raises
    ------
    BadInput
        If not exactly one parameter is fixed, or the window contains no breather.
    Interrupted
        On Ctrl-C; its ``partial`` is the diagram as far as it got, with ``interrupted`` set; for
        several values a tuple of those there are.

    Examples
    --------
    >>> diagram = zones(k=0.8, within={"gamma": (0.0, 0.1)})
    >>> {kind: len(diagram.curves[kind]) for kind in ("LP", "GR", "PF", "NS")}
    {'LP': 1, 'GR': 1, 'PF': 1, 'NS': 1}
    """
    every: dict[str, Any] = {"k": k, "gamma": gamma, "a": a}
    fixed = {name: v for name, v in every.items() if v is not None}
    held = {} if parameter("omega", omega) == 1.0 else {"omega": omega}
    if (second := second_of(fixed)) and not held:
        held[second] = fixed.pop(second)
    if len(fixed) != 1:
        raise BadInput(
            f"zones need exactly one of k, gamma and a fixed, got {fixed or 'none'}; "
            "zones(k=0.8) draws the plane (gamma, a), and zones(k=0.8, gamma=0.05), without "
            "omega=, that of omega and a"
        )
    ((name, value),) = fixed.items()
    # a diagram for each; a string is iterable too, but no values
    if np.iterable(value) and not isinstance(value, str):
        shared: dict[str, Any] = {
            "forcing": forcing, "lattice": lattice, "within": within, "progress": progress,
            "threshold": threshold, "past_folds": past_folds, "beyond": beyond, "site": site,
            "damping": damping, "spring": spring, "walls": walls, "omega": omega, **held,
        }  # fmt: skip
        return _several(name, value, save, **shared)
    value = fixed_value(name, value, lattice, omega)
    held = {n: parameter(n, x, high=HEAVIEST, why="") for n, x in held.items()}
    if past_folds and held:
        raise BadInput("past_folds: lower breathers are drawn at omega = 1; leave one of both out")
    model = model_of(lattice, flag("past_folds", past_folds), site, damping, spring, walls)
    model["forcing"] = drive = forcing_of(forcing)
    check_symmetric(drive)
    modulus = threshold_on(model["lattice"], threshold)
    search = ZoneSearch(
        name, value, model, windows(within), modulus, past_folds, held, flag("beyond", beyond)
    )
    with checkpoint(save, "zones", search.so_far) as search.kept, Counter(progress) as shown:
        search.run(shown)
        if search.kept:
            search.kept.finish(search.zones())
    return search.zones()


def fixed_value(name: str, raw: Any, lattice: Any, omega: float) -> float:
    """The value of the parameter that is fixed, or a sentence; a coupling at another frequency, or
    of a lattice that is no chain and no ring, may be above 1/4."""
    wide = name == "gamma" and (omega != 1.0 or isinstance(lattice, Finite))
    value = parameter(name, raw, **({"high": HEAVIEST, "why": ""} if wide else {}))
    if name == "k" and value in (0.0, 1.0):
        raise BadInput(
            f"k = {value:g}: zones need 0 < k < 1. At k = 1 the folds are at a = 0 and every "
            "multiplier on the arc is neutral; at k = 0 site 0 leaves its wall without velocity. "
            "Take k close to it, and symmetric() for single breathers at the edge"
        )
    return value


def model_of(
    lattice: UniformLattice | None = None,
    past_folds: bool = False,
    site: int = 0,
    damping: float = 0.0,
    spring: float | None = None,
    walls: Any = None,
) -> dict[str, Any]:
    """Lattice and losses of the breathers of a diagram, as `symmetric` takes and checks it but for
    the forcing: with `site` and the others they are evaluated by exact modes."""
    place = lattice if isinstance(lattice, Finite) else lattice_of(lattice)
    place, held = per_site(place, {"damping": damping, "spring": 0.0 if spring is None else spring})
    more: dict[str, Any] = {name: parameter(name, value) for name, value in held.items()}
    more |= {"site": whole("site", site, -MOST), "walls": walls}
    if place.sites is None and more["spring"]:
        raise BadInput(
            "zones of the infinite chain are without springs; name a lattice, Ring(20) or 'ring:20'"
        )
    # chain and ring without losses have closed forms
    if not (isinstance(place, Finite) or any(held.values()) or site) and walls is None:
        return {"lattice": place}
    if past_folds:
        raise BadInput(
            "past_folds: lower breathers are drawn on the infinite chain, or on a ring without "
            "damping, springs and walls of its own; leave it out"
        )
    return {"lattice": place, **more}


def _several(name: str, values: Any, save: Save, **shared: Any) -> ZoneDiagrams:
    # all before any diagram is drawn
    values = [fixed_value(name, value, shared["lattice"], shared["omega"]) for value in values]
    if not values:
        raise BadInput(f"zones need a value of {name}, or several; got none")
    done: list[Zones] = []
    with (
        checkpoint(save, "zones", lambda: tuple(done) or None) as kept,
        add_partial_result(done.append),
    ):
        for value in values:
            # a file then holds the diagrams that are done and as much of this one as there is
            inner = kept and Inner(kept, lambda piece: (*done, piece))
            done.append(zones(**{name: value}, **shared, save=inner))
        if kept:
            kept.finish(tuple(done))
    return ZoneDiagrams(done)
