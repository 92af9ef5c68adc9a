"""Results in files, and back: `save` and `load`, and a folder of files as a `Run`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ...errors import BadInput, ContbreatherError
from ...files import named
from ...storage.netcdf import IsAtlas, check_names, read_file
from ...tables import Column, HtmlRepr, Sheet
from ..branches import diagram  # noqa: F401 - enters diagrams
from ..curve.point import Point
from ..curve.problem import Problem, problem_in
from ..walk.checkpoint import write_results
from .branch_from_dict import result_from_dict

if TYPE_CHECKING:
    from ..walk.trace import Startable

    Given = Problem | Startable | Sequence[Problem | Startable] | None

_SUFFIX = ".nc"
Contents = tuple[dict[str, Any], bool]  # results by name, whether the only one is the whole file


class Entry(NamedTuple):
    """A result, the file it is in, and its name there."""

    result: Any
    path: Path
    name: str


class Run(HtmlRepr, Mapping[str, Any]):
    """Results on disk under one path: read when asked for, and again where they have changed.

    ``run["arms"]`` is a result: of a folder by the name of its file, ``"arms/arm2"`` one of several
    in a file. ``run["PF2"]`` is a special point, if it is on one of the branches only, and
    ``run["arms/arm2/PF2"]`` that on a branch; those of a diagram have numbers, ``"tree/1/GR1"``.
    ``run.keep`` adds results to a folder, ``run.file("arms")`` is the path of one, as ``save=`` of
    `trace` takes it.

    Parameters
    ----------
    path : str or Path
        A file that `save` wrote, or a folder of such files, made with the first one kept in it.
    problem : Problem, or a sequence of them, optional
        The equations of branches of your own problem, as for `load`: files hold those alone that
        are made of numbers.

    Raises
    ------
    BadInput
        For files that cannot be read; names and labels that are not there, or not only once.

    Examples
    --------
    >>> import contbreather as cb, tempfile
    >>> run = cb.Run(f"{tempfile.mkdtemp()}/study")
    >>> branch = cb.trace(cb.symmetric(0.7, 0.04, 0.8), "a", within={"a": (0.5, 0.8)})
    >>> run.keep(symmetric=branch)
    >>> list(run), run["PF1"].label, round(run["PF1"]["a"], 9)
    (['symmetric'], 'PF1', 0.777632426)
    """

    def __init__(self, path: str | Path, *, problem: Given = None) -> None:
        self.path = named("read", path)
        listed = problem if isinstance(problem, list | tuple) else [problem]
        self.problems = [problem_in(owner) for owner in listed if owner is not None]
        self._cache: dict[Path, tuple[Any, Contents]] = {}

    @property
    def files(self) -> tuple[Path, ...]:
        if not os.path.isdir(self.path):
            return (self.path,) if os.path.exists(self.path) else ()
        paths = (*self.path.glob(f"*{_SUFFIX}"), *self.path.glob(f"*/*{_SUFFIX}"))
        return tuple(sorted(path for path in paths if not path.name.startswith(".")))

    def file(self, name: str) -> Path:
        """Name the file of a result, there or to be, in a folder."""
        check_names("result", [name])
        if os.path.isfile(self.path):
            raise BadInput(f"{self.path} is one file; a folder is expected for more of them")
        self.path.mkdir(parents=True, exist_ok=True)
        return self.path / f"{name}{_SUFFIX}"

    def keep(self, **results: Any) -> None:
        """Write results to files of their names, each whole or not at all."""
        _refuse_several(results, "keep", "cb.save(run.file(name), {}results)")
        for name, result in results.items():
            write_results(self.file(name), {name: result}, alone=True)

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries())

    def table(self) -> Sheet:
        results = list(self.values())
        labels = [", ".join(p.label for p in getattr(result, "special", ())) for result in results]
        what = [getattr(r, "describe", r.__repr__)().strip("<>") for r in results]
        return Sheet([Column("name", list(self)), Column("what", what), Column("points", labels)])

    def _ipython_key_completions_(self) -> list[str]:
        return [*self]

    def __len__(self) -> int:
        return len(self._entries())

    def __getitem__(self, key: str) -> Any:
        entries = self._entries()
        if not isinstance(key, str):
            raise BadInput(f"[{key!r}]: results have names; {self.path} has {list(entries)}")
        if key in entries:
            return entries[key].result
        on, _, label = key.rpartition("/")
        branches = getattr(entries[on].result, "branches", ()) if on in entries else ()
        if label.isdecimal() and int(label) < len(branches):
            return branches[int(label)]
        places = [(name, p) for name, p in self.points() if p.label == label and on in ("", name)]
        if len(places) == 1:
            return places[0][1]
        if places:
            where = ", ".join(name for name, _ in places)
            raise BadInput(
                f"{key!r} is a point of several: {where}; say which, "
                f"{places[0][0] + '/' + label!r} for instance"
            )
        labels = sorted({p.label for _, p in self.points() if p.kind})
        raise BadInput(f"no {key!r} in {self.path}; there are {list(entries)} and points {labels}")

    def __contains__(self, key: object) -> bool:
        """Tell whether there is such a result, or a special point with this label."""
        return key in self._entries() or any(
            key in (on, point.label, f"{on}/{point.label}") for on, point in self.points()
        )

    def get(self, key: str, default: Any = None) -> Any:
        return self[key] if key in self else default  # noqa: SIM401 - it would call itself

    def place(self, name: str) -> tuple[Path, str]:
        return self._entries()[name][1:]

    def points(self) -> Iterator[tuple[str, Point]]:
        """Special points, with the names of what they are on: of diagrams branches by number."""
        for name, entry in self._entries().items():
            branches = enumerate(getattr(entry.result, "branches", ()))
            curves = {f"{name}/{i}": branch for i, branch in branches} or {name: entry.result}
            for on, curve in curves.items():
                for point in getattr(curve, "special", ()):
                    yield on, point

    def _entries(self) -> dict[str, Entry]:
        entries = {}
        for path in self.files:
            try:
                results, alone = self.inside(path)
            except IsAtlas:
                if path == self.path:
                    raise
                continue
            for name, result in results.items():
                key = name
                if path != self.path:
                    stem = path.relative_to(self.path).with_suffix("").as_posix()
                    key = stem if alone else f"{stem}/{name}"
                entries[key] = Entry(result, path, name)
        return entries

    def inside(self, path: Path) -> Contents:
        """Read what is in a file, once as long as it stays the same."""
        state = None
        with suppress(OSError, ValueError):  # reading says what is wrong
            stat = path.stat()
            state = (stat.st_mtime_ns, stat.st_size, stat.st_ino)
        if path not in self._cache or self._cache[path][0] != state:
            try:
                self._cache[path] = state, self._read(path)
            except ContbreatherError:  # which NotConverged is, and a RuntimeError, too
                raise
            except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError,
                    ValueError) as error:  # fmt: skip
                if self.problems:  # whose equations may have failed
                    raise
                raise BadInput(
                    f"cannot read {path}: its contents are not as `save` writes them "
                    f"({type(error).__name__}: {error}); restore a copy"
                ) from error
        return self._cache[path][1]

    def _read(self, path: Path) -> Contents:
        contents, alone = read_file(path)
        try:
            return {n: result_from_dict(c, self.problems) for n, c in contents.items()}, alone
        except BadInput as error:
            raise BadInput(f"{path}: {error}") from error

    def __repr__(self) -> str:
        return f"<Run {self.path}: {', '.join(self) or 'nothing yet'}>"


def _refuse_several(results: Mapping[str, Any], verb: str, instead: str) -> None:
    for result in results.values():
        if isinstance(result, list | tuple | dict):
            kind, stars = ("dict", "**") if isinstance(result, dict) else ("list", "*")
            named = ", with names of their own **{f'arm{i}': arm for i, arm in enumerate(results)}"
            raise BadInput(
                f"{verb} takes results one by one, got a {type(result).__name__}; those of a "
                f"{kind} are {instead.format(stars)}{'' if kind == 'dict' else named}"
            )


def save(path: str | Path, *results: Any, **named: Any) -> None:
    """Write results to one netCDF-4 file, readable by anything that reads netCDF or HDF5.

    Parameters
    ----------
    path : str or Path
        The file. It is written beside `path` and then moved there, so that an interruption leaves
        what was there before; its last line is the checksum of the rest.
    *results, **named
        Branches and boundaries, diagrams, zones, simulated runs: each is a group, ``branch1``,
        ``branch2``, ..., or the name it is given here. The page on files of the documentation says
        what is in a group.

    Raises
    ------
    BadInput
        If there is nothing to write, a name is none for netCDF, or `path` cannot be written.

    Examples
    --------
    >>> import contbreather as cb, tempfile, pathlib
    >>> branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.5, 0.6)})
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "run.nc"
    >>> cb.save(path, branch)
    >>> again = cb.load(path)
    >>> bool((again["p"] == branch["p"]).all()), again[3].stability().stable
    (True, True)
    """
    every = {**{f"branch{i}": result for i, result in enumerate(results, start=1)}, **named}
    _refuse_several(every, "save", "save(path, {}results)")
    if not every or len(every) < len(results) + len(named):
        raise BadInput(f"results with different names are expected, got {list(every) or 'none'}")
    write_results(path, every, alone=len(every) == 1)


def load(path: str | Path, *, problem: Given = None) -> Any:
    """Read what `save` wrote.

    Parameters
    ----------
    path : str or Path
        A file, or a folder of files.
    problem : Problem, Orbit or Point, or a sequence of them, optional
        The equations of the branches (of a boundary: those of the original problem); of several
        each branch takes the first that it solves, as equilibria and their cycles do. What this
        package has built comes back with its equations. A problem of your own is made of functions,
        which no file holds: without it a branch has its columns and special points, with it
        it can be continued, traced as a boundary, and asked for ``point.solution``.

    Returns
    -------
    Branch, or what else was saved
        Of a file with several results, and of a folder, a `Run`, which has them by name.

    Raises
    ------
    BadInput
        If the file cannot be read, is not one of ours, is damaged or of a later version, or if
        `problem` has other names or is not solved by the points.
    """
    run = Run(path, problem=problem)
    if os.path.isdir(run.path):
        if not run.files:
            raise BadInput(f"cannot read {path}: there is no file in it that `save` wrote")
        return run
    results, alone = run.inside(run.path)
    return next(iter(results.values())) if alone else run
