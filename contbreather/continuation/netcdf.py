"""One netCDF-4 file: values by their names, each a group, and where they come from."""

from __future__ import annotations

import io
import platform
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import BadInput
from ..files import writable
from .contents import groups_of
from .groups import check_names, text
from .sealed import read_sealed, write_sealed

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

FORMAT, NUMBER = "run of contbreather", 3  # the number grows where older versions cannot read on


def target_of(path: str | Path) -> Path:
    """Where a file is to be, or what is wrong with that: a table is something else."""
    target = writable(path)
    if target.suffix.lower() == ".csv":
        raise BadInput(
            f"cannot write {target}: what is kept is a netCDF-4 file, call it {target.stem}.nc; "
            "tables are written by to_csv, or by --csv"
        )
    return target


def write(
    path: str | Path, values: Mapping[str, Any], *, alone: bool, recorded: bool | None = True
) -> Path:
    """Write all of a file at once; what was there stays until then.

    `alone` says whether its one value is what the file is, rather than the first of several.
    """
    from xarray import Dataset, DataTree

    target = target_of(path)
    check_names("branch", values)
    groups: dict[str, Any] = {}
    for name, value in values.items():
        groups |= groups_of(f"/{name}", value, recorded=recorded)
    tree = DataTree.from_dict({"/": Dataset(attrs={**_root(), "alone": int(alone)}), **groups})
    # in memory first: where a disk is full, HDF5 ends the interpreter
    return write_sealed(target, image(tree))


def image(data: Dataset | DataTree) -> bytes:
    """The bytes of a netCDF-4 file.

    Where Dask has a cluster, xarray would have that lock a file, and there is none.
    """
    dask = sys.modules.get("dask")
    with nullcontext() if dask is None else dask.config.set(scheduler="synchronous"):
        return bytes(data.to_netcdf(engine="h5netcdf"))


def _root() -> dict[str, Any]:
    """What others, and later versions, are told of the whole file."""
    made_by = ", ".join(
        [f"Python {platform.python_version()}", *map(_version, ("contbreather", "numpy", "scipy"))]
    )
    now = datetime.now(UTC).isoformat(timespec="seconds")
    said = {"format": FORMAT, "Conventions": "CF-1.11", "made_by": made_by, "created": now}
    return {**{name: text(value) for name, value in said.items()}, "format_number": NUMBER}


def _version(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # a tenth of a first breather

    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:  # run from its source
        return package


@contextmanager
def read(path: str | Path) -> Iterator[DataTree]:
    """The groups of a file that `write` wrote.

    Raises
    ------
    BadInput
        If it is something else, damaged, or of a later version.
    """
    import xarray

    image = io.BytesIO(read_sealed(path))
    with xarray.open_datatree(image, engine="h5netcdf", decode_cf=False) as tree:
        if tree.attrs.get("format") != FORMAT:
            raise BadInput(f"{path} holds nothing that this version's `save` wrote")
        number = int(tree.attrs["format_number"])
        if number > NUMBER:
            raise BadInput(
                f"{path} was written by a later version ({tree.attrs.get('made_by')}): its format "
                f"is {number}, this version reads {NUMBER}; update contbreather"
            )
        yield tree
