"""One netCDF-4 file: values by their names, each a group, and behind them a checksum of it all.

HDF5 does not look at what comes after its own last byte, so others read such a file as it is. We
read nothing from one with another checksum: of what is damaged HDF5 makes other numbers, or goes
on for ever.
"""

from __future__ import annotations

import hashlib
import io
import os
import platform
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import BadInput
from ..files import opened, stream_of, writable, write_whole
from .contents import groups_of
from .groups import check_names, text

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

FORMAT, NUMBER = "run of contbreather", 3  # the number grows where older versions cannot read on
ATLAS = "atlas of contbreather"
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_SEAL = b"\nsha256 of all bytes before: %s\n"
_SEALED = len(_SEAL % bytes(64))


def target_of(path: str | Path) -> Path:
    """Where a file is to be, or what is wrong with that: a table is something else."""
    target = writable(path)
    if stream_of(target):
        raise BadInput(
            f"cannot keep results in {target}: they are written again and again; name a file"
        )
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
    return write_sealed(target, tree)


def write_sealed(path: str | Path, data: Dataset | DataTree) -> Path:
    """Write a netCDF-4 file with its checksum, whole or not at all."""
    # Where Dask has a cluster, xarray would have that lock a file, and there is none.
    dask = sys.modules.get("dask")
    with nullcontext() if dask is None else dask.config.set(scheduler="synchronous"):
        # in memory first: where a disk is full, HDF5 ends the interpreter
        image = bytes(data.to_netcdf(engine="h5netcdf"))
    return write_whole(path, lambda file: file.writelines((image, _SEAL % _checksum(image))))


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

    image = io.BytesIO(_read_sealed(path))
    with xarray.open_datatree(image, engine="h5netcdf", decode_cf=False) as tree:
        if tree.attrs.get("format") == ATLAS:
            raise BadInput(
                f"{path} is an atlas: xarray.open_dataset reads it, as does all that reads netCDF; "
                "read here are branches, boundaries, diagrams, zones and runs"
            )
        if tree.attrs.get("format") != FORMAT:
            raise BadInput(f"{path} holds nothing that this version's `save` wrote")
        number = int(tree.attrs["format_number"])
        if number > NUMBER:
            raise BadInput(
                f"{path} was written by a later version ({tree.attrs.get('made_by')}): its format "
                f"is {number}, this version reads {NUMBER}; update contbreather"
            )
        yield tree


def _read_sealed(path: str | Path) -> bytes:
    """The bytes in front of a checksum that is theirs."""
    with opened(path) as file:
        if file.read(len(_SIGNATURE)) != _SIGNATURE:
            raise BadInput(f"cannot read {path}: it is not a netCDF-4 file")
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - _SEALED))
        seal = file.read()
        if not (seal.startswith(_SEAL[:-3]) and seal.endswith(_SEAL[-1:])):
            raise BadInput(
                f"{path} holds nothing that `save` wrote, or it has lost its end: the checksum "
                "that should be there is not"
            )
        file.seek(0)
        image = file.read(size - _SEALED)
    if seal != _SEAL % _checksum(image):
        raise BadInput(
            f"{path} is damaged: its checksum is not the one that `save` wrote; restore a copy"
        )
    return image


def _checksum(image: bytes) -> bytes:
    return hashlib.sha256(image).hexdigest().encode()
