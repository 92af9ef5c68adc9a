"""Whether what a study asks for fits together: names, what comes from what, what is drawn."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from contbreather.breathers.zones import PAIRS
from contbreather.studies.plan import Figure, Study

Fault = tuple[tuple[str, ...], str]  # where it is said, and what is wrong
KINDS = ("branch", "arms", "boundary", "zones", "atlas")
FIGURES = (".png", ".pdf", ".svg")


def faults(study: Study, unread: Collection[str] = ()) -> Iterator[Fault]:
    """What does not fit together; `unread` are tables that are there, but have mistakes of their
    own."""
    if not (study.results or unread):
        wanted = "a table [branch.NAME], [zones.NAME] or [atlas.NAME] is expected"
        yield (), f"nothing is asked for: {wanted}"
    yield from _names(study)
    yield from _references(study, unread)
    if "chain" not in unread:
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


def _references(study: Study, unread: Collection[str]) -> Iterator[Fault]:
    sources = {**study.branch, **study.arms, **study.boundary}
    for kind in ("arms", "boundary"):
        for name, table in getattr(study, kind).items():
            source, _, member = table.of.partition("/")
            if source in unread:
                continue
            if source not in sources:
                have = _names_there(sources, unread)
                yield (
                    (kind, name, "of"),
                    f"no branch, arms or boundary {source!r}; there are {have}",
                )
            elif (source in study.arms) != bool(member):
                wanted = f"{source}/arm1" if source in study.arms else source
                yield (kind, name, "of"), f"{wanted!r} was expected, got {table.of!r}"
            elif name in _origins(study, source):
                yield (kind, name, "of"), f"it comes from itself, by way of {source!r}"


def _names_there(read: Collection[str], unread: Collection[str]) -> str:
    return ", ".join([*read, *sorted({*unread} - {*KINDS, "chain", "figure"})]) or "none"


def _origins(study: Study, name: str) -> list[str]:
    """What a result comes from, itself first."""
    found: list[str] = []
    while name in study.results and name not in found:
        found.append(name)
        name = study.results[name].source
    return found


def _of_the_forcing(study: Study) -> Iterator[Fault]:
    own = study.chain.drive.params
    for kind in ("branch", "zones", "atlas"):
        for name, table in getattr(study, kind).items():
            for other in set(table.over) - set(own):
                have = ", ".join(own) or "none"
                yield (kind, name, "over"), f"the forcing has no {other!r}; it has {have}"


def _parameters(study: Study) -> Iterator[Fault]:
    known = sorted({*PAIRS, "damping", "spring", *study.chain.drive.params})
    for name, branch in study.branch.items():
        if branch.free not in known:
            yield (
                ("branch", name, "free"),
                f"one of {', '.join(known)} was expected, {branch.free!r} is none",
            )
    for name, line in study.boundary.items():
        if len({*line.pair} & {*known}) < 2:
            yield (
                ("boundary", name, "pair"),
                f"two of {', '.join(known)} were expected, got {line.pair}",
            )


def _drawn(study: Study, name: str, figure: Figure, unread: Collection[str]) -> Iterator[Fault]:
    if figure.file is not None and not figure.file.lower().endswith(FIGURES):
        yield (
            ("figure", name, "file"),
            f"one of {', '.join(FIGURES)} was expected, got {figure.file!r}",
        )
    draws = [one.partition("/")[0] for one in figure.draws]
    if set(draws) & set(unread):
        return
    for one in draws:
        if one not in study.results:
            have = _names_there(study.results, unread)
            yield ("figure", name, "draws"), f"nothing is called {one!r}; there are {have}"
            return
    kinds = {type(study.results[one]).__name__ for one in draws}
    alone = kinds == {"Atlas"} and len(draws) == 1
    if not (alone or kinds == {"Zones"} or not kinds & {"Zones", "Atlas"}):
        wanted = "zone diagrams, one atlas, or branches, arms and boundaries"
        yield ("figure", name, "draws"), f"{wanted} were expected, not some of each"
