"""Whether what a study asks for fits together: names, what comes from what, what is drawn."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

from contbreather.checks import combinations
from contbreather.errors import BadInput
from contbreather.lattice.conditions import Conditions, Walls
from contbreather.orbits.section import Section, check_walls
from contbreather.orbits.zone_search import PAIRS
from contbreather.orbits.zones import model_of
from contbreather.stability.verdict import THRESHOLD
from contbreather.studies.schema import Chain, Figure, FromPoint, GridTask, Study, part

Place = tuple[str, ...]
Fault = tuple[Place, str]  # where it is said, and what is wrong
KINDS = ("branch", "arms", "boundary", "zones", "atlas")
FIGURES = (".png", ".pdf", ".svg")
EVENTS = {"arms": ("PF", "PD", "BP"), "boundary": ("LP", "PF", "PD", "NS", "GR", "VI", "BP")}
MEASURES = ("p", "phi", "c", "asymmetry", "unstable", "condition", "nu", "arclength", "residual")
NUMBERED = re.compile(r"[tpJc]\d*|norm\([qr]\)")  # columns that some branches have more than one of


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
        yield from _of_the_forcing(study)
        yield from _parameters(study)
    for name, figure in study.figure.items():
        yield from _drawn(study, name, figure, unread)


def _names(study: Study) -> Iterator[Fault]:
    taken: dict[str, str] = {}
    for kind in KINDS:
        for name in getattr(study, kind):
            if not name.replace("-", "").replace("_", "").isalnum():
                yield (kind, name), "a name of letters, digits, - and _ was expected"
            if name in taken:
                yield (kind, name), f"{name!r} is there already, as {taken[name]}"
            taken[name] = kind
    written: dict[str, str] = {}
    for name, figure in study.figure.items():
        first = written.setdefault(figure.file or f"{name}.png", name)
        if first != name:
            yield ("figure", name, "file"), f"figure {first} is written to this file already"


def _references(study: Study, unread: Collection[str]) -> Iterator[Fault]:
    sources = {**study.branch, **study.arms, **study.boundary}
    for kind in ("arms", "boundary"):
        for name, table in getattr(study, kind).items():
            source, _, arm = part(table.of)
            if source in unread:
                continue
            if source not in sources:
                have = _names_there(sources, unread)
                yield (
                    (kind, name, "of"),
                    f"no branch, arms or boundary {source!r}; there are {have}",
                )
            elif (source in study.arms) != bool(arm):
                wanted = f"{source}/arm1" if source in study.arms else source
                yield (kind, name, "of"), f"{wanted!r} was expected, got {table.of!r}"
            elif name in _origins(study, source):
                yield (kind, name, "of"), f"it comes from itself, by way of {source!r}"
            else:
                yield from _no_member(study, (kind, name, "of"), table.of, unread)
                yield from _no_event(study, kind, name)


def _no_member(study: Study, place: Place, named: str, unread: Collection[str]) -> Iterator[Fault]:
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
    """What the library cannot do with its keys: nothing that is said there is passed over."""
    chain = study.chain
    motion = [name for name in ("damping", "spring", "site", "walls") if getattr(chain, name)]
    if chain.place.sites is None:
        for name in {*motion} - {"spring"}:
            yield (
                ("chain", name),
                "on the infinite chain site 0 impacts, between walls at -1 and 1, without "
                f"damping; leave {name} out, or name a lattice, 'ring:20'",
            )
    else:
        yield from _impacting(chain)
        yield from _of_lower_breathers(study)
    asked = [kind for kind in ("zones", "atlas") if getattr(study, kind) or kind in unread]
    if asked and chain.place.sites is None and chain.spring:
        yield (
            ("chain", "spring"),
            f"{' and '.join(asked)}: diagrams on the infinite chain are without springs; leave "
            "spring out, or name a lattice, 'ring:20'",
        )
    if not (study.arms or "arms" in unread):
        return
    if chain.place.sites is None and chain.spring:
        yield (
            ("chain", "spring"),
            "arms on the infinite chain are without springs; leave spring out, or name a lattice, "
            "'ring:200'",
        )
    if chain.verge != THRESHOLD:
        yield (
            ("chain", "threshold"),
            f"arms are judged by the paper's {THRESHOLD}; leave threshold out, or keep the arms "
            "in a study of their own",
        )


def _impacting(chain: Chain) -> Iterator[Fault]:
    """A site that is not there, or walls that it cannot hit in turn."""
    try:
        section = Section(((chain.site, 1),), sign=-1).placed(chain.place)
    except BadInput as error:
        yield ("chain", "site"), str(error)
        return
    try:
        walls = Walls.given(chain.on.get("walls"))
        check_walls(section, Conditions(1.0, 0.0, 1.0, walls=walls, lattice=chain.place))
    except BadInput as error:
        yield ("chain", "walls"), str(error)


def _of_lower_breathers(study: Study) -> Iterator[Fault]:
    """Zone diagrams past the folds of what is evaluated by exact modes."""
    for kind in ("zones", "atlas"):
        for name, table in getattr(study, kind).items():
            if table.past_folds:
                try:
                    model_of(**study.chain.on, past_folds=True)
                except BadInput as error:
                    yield (kind, name, "past_folds"), str(error).removeprefix("past_folds: ")


def _of_the_forcing(study: Study) -> Iterator[Fault]:
    params = study.chain.drive.params
    for kind in ("branch", "zones", "atlas"):
        for name, table in getattr(study, kind).items():
            for parameter in set(table.over) - set(params):
                have = ", ".join(params) or "none"
                yield (kind, name, "over"), f"the forcing has no {parameter!r}; it has {have}"


def _parameters(study: Study) -> Iterator[Fault]:
    extra = {"spring"} if study.chain.place.sites is None else {"damping", "spring"}
    names = sorted({*PAIRS, *extra, *study.chain.drive.params})
    for name, branch in study.branch.items():
        if branch.free not in names:
            yield (
                ("branch", name, "free"),
                f"one of {', '.join(names)} was expected, {branch.free!r} is none",
            )
    for name, line in study.boundary.items():
        if len({*line.pair} & {*names}) < 2:
            yield (
                ("boundary", name, "pair"),
                f"two of {', '.join(names)} were expected, got {line.pair}",
            )


def _drawn(study: Study, name: str, figure: Figure, unread: Collection[str]) -> Iterator[Fault]:
    if figure.file is not None and not figure.file.lower().endswith(FIGURES):
        yield (
            ("figure", name, "file"),
            f"one of {', '.join(FIGURES)} was expected, got {figure.file!r}",
        )
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
    for key in sorted({"x", "y"} & fit & figure.model_fields_set):
        column = getattr(figure, key)
        if column not in columns and not NUMBERED.fullmatch(column):
            yield (
                ("figure", name, key),
                f"no branch of a study has a column {column!r}; there are "
                f"{', '.join(sorted(columns))}, and of each impact t1, p1",
            )
    for key in sorted({"x", "y", "over", "at"} & figure.model_fields_set - fit):
        yield (
            ("figure", name, key),
            "x and y are columns of branches, over and at choose surfaces of an atlas; leave "
            f"{key} out of a figure of {' and '.join(sorted(kinds)).lower()}",
        )
