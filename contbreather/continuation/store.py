"""Results in files, and back: `save` and `load`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import BadInput
from .netcdf import write
from .problem import Problem, problem_in
from .run import Run

if TYPE_CHECKING:
    from .trace import Startable


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
    every = {**{f"branch{i}": one for i, one in enumerate(results, start=1)}, **named}
    for one in results:
        if isinstance(one, list | tuple):
            raise BadInput(
                f"save takes results one by one, got a {type(one).__name__}; those of a list are "
                "save(path, *results)"
            )
    if not every or len(every) < len(results) + len(named):
        raise BadInput(f"results with different names are expected, got {list(every) or 'none'}")
    write(path, every, alone=len(every) == 1)


def load(path: str | Path, *, problem: Problem | Startable | None = None) -> Any:
    """Read what `save` wrote.

    Parameters
    ----------
    path : str or Path
        A file, or a folder of files.
    problem : Problem, Orbit or Point, optional
        The equations of the branches (of a boundary: those of the original problem). What this
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
    own = None if problem is None else problem_in(problem)
    run = Run(path, problem=own)
    if os.path.isdir(run.path):
        if not run.files:
            raise BadInput(f"cannot read {path}: there is no file in it that `save` wrote")
        return run
    found, alone = run.inside(run.path)
    return next(iter(found.values())) if alone else run
