"""Nested dicts in one netCDF-4 file, and behind them a checksum of it all.

Each dict is a group: its columns are variables, what JSON takes is one text, the variable `ABOUT`.
Text is bytes everywhere, truth is 0 or 1 and a complex number a pair: netCDF's own strings and
booleans are lost on Octave. HDF5 does not look at what comes after its own last byte, so others
read such a file as it is. We read nothing from one with another checksum: of what is damaged HDF5
makes other numbers, or goes on for ever.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from contbreather.checks import brief
from contbreather.errors import BadInput
from contbreather.files import opened, refused, stream_of, writable, write_whole

if TYPE_CHECKING:
    import h5py

Array = NDArray[Any]
Values = Mapping[Any, Any]
Column = tuple[tuple[str, ...], Any, dict[str, Any]]  # dimensions, values, attributes

FORMAT, NUMBER = "run of contbreather", 3  # the number grows where older versions cannot read on
ATLAS = "atlas of contbreather"
ABOUT = "about_in_json"
RESERVED = {ABOUT, "point", "doubtful"}  # names that no column has
LONGEST = 200  # bytes of a name: netCDF takes 256, and some get an ending here
_OTHERS = {".csv", ".json", ".mat", ".npy", ".npz", ".pdf", ".pkl", ".png", ".svg", ".txt"}
_NAMESAKE = "_nc4_non_coord_"  # before the name of a variable that bears that of a dimension
_HELD = "?bBhHiIlLqQefdFDSU"  # characters of dtypes: truth, numbers, bytes and words
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_CHECKSUM = b"\nsha256 of all bytes before: %s\n"
_LENGTH = len(_CHECKSUM % bytes(64))
_BLOCK = 2**20  # bytes that are copied at once
_CHUNK = 2**13  # numbers of a column that grows which are stored together


def target_of(path: str | Path) -> Path:
    """Path of a file to be written, or a refusal: a table is something else."""
    target = writable(path)
    if stream_of(target):
        raise BadInput(
            f"cannot keep results in {target}: they are written again and again; name a file"
        )
    if target.suffix.lower() in _OTHERS:
        raise BadInput(
            f"cannot write {target}: what is kept is a netCDF-4 file, call it {target.stem}.nc; "
            "tables are written by to_csv, or by --csv"
        )
    return target


def write_file(
    path: str | Path,
    contents: Mapping[str, Mapping[str, Any]],
    *,
    alone: bool,
    growing: Collection[str] = (),
) -> Path:
    """Write dicts by their names, all of a file at once; what was there stays until then.

    `alone` says whether the one value is what the file is, rather than the first of several; to
    columns along dimensions that are `growing` a `GrowingFile` can append.
    """
    target = target_of(path)
    check_names("branch", contents)
    with checked_file(target) as file:
        _describe(file, {**_root(), "alone": int(alone)})
        for name, content in contents.items():
            _fill(file.create_group(name, track_order=True), growing=growing, **content)
    return target


def _fill(
    group: h5py.Group,
    prefix: str = "",
    *,
    kind: str,
    columns: Mapping[str, Column] | None = None,
    groups: Mapping[str, Any] | None = None,
    attributes: Mapping[str, str] | None = None,
    growing: Collection[str] = (),
    **plain: Any,
) -> None:
    """Write a dict and those in it, with this before the names of their dimensions."""
    columns, groups = columns or {}, groups or {}
    check_names("column", columns)
    dimensions = {dimension for column in columns.values() for dimension in column[0]}
    within = {f"{name}_{dimension}" for name in groups for dimension in dimensions}
    if taken := sorted((RESERVED | dimensions | within | set(groups)) & set(columns)):
        raise BadInput(f"{taken[0]!r} is a name that the file needs itself; choose another")
    about = {"content": kind, **plain, "parts": [*groups]}
    image = np.array(json.dumps(about, separators=(",", ":")).encode())
    words = {name: value for name, value in (attributes or {"content": kind}).items() if value}
    fill_group(group, {**columns, ABOUT: ((), image, {})}, words, prefix, growing)
    # xarray wants dimensions of one name to have one size in a group and in those inside it
    for name, inner in groups.items():
        longer = f"{prefix}{name}_" if columns else prefix
        _fill(group.create_group(name, track_order=True), longer, **inner)


def fill_group(
    group: h5py.Group,
    columns: Values,
    attributes: Values,
    prefix: str = "",
    growing: Collection[str] = (),
) -> None:
    """Write columns and attributes, with this before the names of dimensions."""
    _describe(group, attributes)
    variables = {name: _variable(name, prefix, *column) for name, column in columns.items()}
    rows = (zip(names, values.shape, strict=True) for names, values, _ in variables.values())
    sizes = {name: size for row in rows for name, size in row}
    scales = {
        name: _made(group, name, (size,), name in growing, dtype=">f4")
        for name, size in sizes.items()
    }
    for scale in scales.values():  # the words are netCDF's
        scale.make_scale(b"This is a netCDF dimension but not a netCDF variable.%10d" % scale.size)
    for name, (dimensions, values, flags) in variables.items():
        label = f"{_NAMESAKE}{name}" if name in scales else name
        grows, fill = dimensions[:1] in [(one,) for one in growing], flags.get("_FillValue")
        variable = _made(group, label, values.shape, grows, data=values, fillvalue=fill)
        _describe(variable, flags)
        for axis, dimension in zip(variable.dims, dimensions, strict=True):
            axis.attach_scale(scales[dimension])


def _made(
    group: h5py.Group, name: str, shape: tuple[int, ...], grows: bool, **more: Any
) -> h5py.Dataset:
    if grows:
        row = shape[1:]
        more |= {"maxshape": (None, *row), "chunks": (max(1, _CHUNK // math.prod(row)), *row)}
    elif 0 in shape:  # as netCDF has length 0
        more["maxshape"] = tuple(size or None for size in shape)
    return group.create_dataset(name, shape, track_order=True, **more)


def _describe(one: h5py.Group | h5py.Dataset, attributes: Values) -> None:
    for name, value in attributes.items():  # numbers are arrays, as netCDF itself writes them
        one.attrs[name] = text(value) if isinstance(value, str) else np.atleast_1d(value)


def _variable(name: str, prefix: str, along: Iterable[str], values: Any, flags: Values) -> Column:
    """Text as characters, truth as 0 and 1, complex numbers as pairs, and None as NaN or ""."""
    values, dimensions = _held(name, np.asarray(values)), tuple(f"{prefix}{one}" for one in along)
    if values.dtype.kind == "c":
        values = np.stack([values.real, values.imag], axis=-1)
        dimensions = (*dimensions, f"{prefix}complex")
    elif values.dtype.kind == "b":
        values = values.astype("i1")
        flags = {**flags, "flag_meanings": "false true", "flag_values": np.arange(2, dtype="i1")}
    elif values.dtype.kind == "U":
        values = np.array([text(word) for word in values.flat], "S").reshape(values.shape)
    if values.dtype.kind == "S":
        values = values[..., None].view("S1")
        dimensions = (*dimensions, f"string{values.shape[-1]}")
    elif values.dtype.kind == "f":
        flags = {**flags, "_FillValue": np.full(1, np.nan, values.dtype)}
    return dimensions, values, dict(flags)


def _held(name: Any, values: Array) -> Array:
    """A column as files hold it: what is not there is NaN among numbers, "" among words."""
    if values.dtype.char in _HELD:
        return values.astype("f4") if values.dtype == "f2" else values  # netCDF has no halves
    there = np.array([value is not None for value in values.flat], bool).reshape(values.shape)
    for value in values[there]:
        if not (np.isscalar(value) and np.asarray(value).dtype.char in _HELD):
            raise BadInput(
                f"the column {name!r} has {brief(value)}, which no file holds: numbers of up to 64 "
                "bits, words and truth values were expected, or arrays of these, all of one shape; "
                "record another"
            )
    own = np.array(values[there].tolist())
    kind = own.dtype if own.dtype.kind in "SU" else np.result_type(own, float)
    filled = np.full(values.shape, "" if own.dtype.kind in "SU" else np.nan, dtype=kind)
    filled[there] = own
    return filled


def _decoded(variable: h5py.Dataset) -> Array:
    values: Array = np.asarray(variable[()])
    # pairs along a dimension `complex`, named after its group too in a group within another
    if values.shape[-1:] == (2,) and variable.dims[values.ndim - 1][0].name.endswith("complex"):
        values = values[..., 0] + 1j * values[..., 1]
    if values.dtype.kind == "S" and variable.name.rpartition("/")[2] != ABOUT:
        words = values.view(f"S{values.shape[-1]}")[..., 0]  # one byte each along a last axis
        values = np.char.decode(words, "utf-8")
    truth = _plain(variable.attrs.get("flag_meanings")) == "false true"
    return values.astype(bool) if truth else values


def check_names(what: str, names: Iterable[str]) -> None:
    """Refuse what netCDF takes for a path, or for its own, or not at all."""
    for name in names:
        good = isinstance(name, str) and name.isprintable() and name == name.strip()
        good = good and "/" not in name and name not in ("", ".", "..")
        good = good and len(name.encode()) <= LONGEST and not name.startswith("_nc4_")
        if not good:
            raise BadInput(
                f"{name!r} cannot be the name of a {what} in a file: at most {LONGEST} printable "
                "bytes without / were expected, and not . or ..; choose another name"
            )


def check_lengths(columns: Mapping[str, Array], names: Sequence[str], what: str) -> None:
    """Refuse columns whose length is not that of the first one named, the number of `what`."""
    count = columns[names[0]].size
    for name in names:
        if (length := len(np.atleast_1d(columns[name]))) != count:
            raise BadInput(
                f"the column {name!r} has length {length}, and there are {count} {what}; restore a "
                "copy of the file"
            )


def text(words: str) -> np.bytes_:
    """Text as HDF5 and all that read it take it, neither null bytes nor what is no character."""
    image = words.replace("\0", r"\0").encode(errors="backslashreplace")
    # HDF5 takes attributes of 64 kB
    return np.bytes_(image[:20_000].decode(errors="ignore").encode())


@contextmanager
def checked_file(path: str | Path) -> Iterator[h5py.Group]:
    """A netCDF-4 file to fill: written after that with its checksum, whole or not at all."""
    import h5py

    with _spooled(path) as stream:
        with h5py.File(stream, "w", track_order=True) as file:
            yield file
        _keep(path, stream)


class GrowingFile:
    """A copy of a file of one dict, whose columns grow; `save` puts it in the place of the file."""

    def __init__(self, path: str | Path, root: h5py.File, stream: _Spool) -> None:
        self.path, self.root, self.stream = path, root, stream
        (self.group,) = root.values()

    def append(self, columns: Mapping[str, Array]) -> None:
        for name, rows in columns.items():
            variable = self.group[name]
            before = len(variable)
            variable.resize(before + len(rows), axis=0)
            variable[before:] = rows.astype(variable.dtype)
            variable.dims[0][0].resize(len(variable), axis=0)
        self.stream.check()

    def describe(self, **about: Any) -> None:
        image = np.array(json.dumps({**about_of(self.group), **about}).encode())
        del self.group[ABOUT]
        fill_group(self.group, {ABOUT: ((), image, {})}, {})

    def save(self) -> None:
        """Write all of it anew: what is appended to a file in place may be lost with its writer."""
        self.root.flush()
        _keep(self.path, self.stream)


@contextmanager
def growing_file(path: str | Path) -> Iterator[GrowingFile]:
    """A file that `write_file` wrote, to append to."""
    import h5py

    with _spooled(path) as stream:
        with opened(path) as file:
            _check(path, file, stream)
        with h5py.File(stream, "r+") as root:
            yield GrowingFile(path, root, stream)


class _Spool:
    """A file for HDF5, which ends the interpreter where a disk is full: it is not told of the first
    refusal, and from there on nothing is written."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self.refusal: OSError | None = None

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def tried(*given: Any) -> Any:
            try:
                return 0 if self.refusal else getattr(self.stream, name)(*given)
            except OSError as error:
                self.refusal = error
                return 0

        return tried

    def check(self) -> None:
        if self.refusal:
            raise self.refusal


@contextmanager
def _spooled(path: str | Path) -> Iterator[_Spool]:
    """Gather what a file is to hold, on the same disk; nothing is left, however it ends."""
    try:
        # a larger one is on disk while it is filled
        with SpooledTemporaryFile(2**24, dir=str(Path(path).parent)) as stream:
            file = _Spool(stream)
            yield file
    except (OSError, RuntimeError) as error:  # HDF5 may stumble over what was not written
        if file.refusal is None:
            raise
        raise refused("write", Path(path), file.refusal) from error


def _keep(path: str | Path, image: _Spool) -> None:
    """Write a file from its image, with its checksum behind that."""

    image.flush()
    image.check()
    write_whole(path, lambda file: file.write(_copied(image, file)))


def _copied(source: Any, target: Any, left: float = math.inf) -> bytes:
    """Copy a file from its beginning, if there is a target; what stands behind it, its checksum."""
    digest = hashlib.sha256()
    source.seek(0)
    while block := source.read(min(left, _BLOCK)):
        left -= len(block)
        digest.update(block)
        if target is not None:
            target.write(block)
    return _CHECKSUM % digest.hexdigest().encode()


def _root() -> dict[str, Any]:
    """Attributes of the whole file, for others and for later versions."""
    from importlib.metadata import PackageNotFoundError, version  # a tenth of a first breather

    made_by = [f"Python {platform.python_version()}"]
    for package in ("contbreather", "numpy", "scipy"):
        try:
            made_by.append(f"{package} {version(package)}")
        except PackageNotFoundError:  # run from its source
            made_by.append(package)
    return {
        "format": FORMAT,
        "Conventions": "CF-1.11",
        "made_by": ", ".join(made_by),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "format_number": NUMBER,
    }


def read_file(path: str | Path) -> tuple[dict[str, dict[str, Any]], bool]:
    """The dicts of a file that `write_file` wrote, and whether the one there is what the file is.
    What somebody else has changed, with its checksum, may raise anything."""
    import h5py

    with checked_image(path) as root:
        contents = {n: _content(one) for n, one in _all(root) if isinstance(one, h5py.Group)}
        alone = bool(_plain(root.attrs["alone"]))
        if alone and len(contents) != 1:
            raise ValueError(f"{len(contents)} results in place of one")
        return contents, alone


def _all(group: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """List a group. h5py holds its lock until it has named all of it: if reading fails before that,
    every other thread waits for ever."""
    return list(group.items())


def _plain(attribute: Any) -> Any:
    (value,) = np.ravel(attribute).tolist()
    return value.decode() if isinstance(value, bytes) else value


def about_of(group: h5py.Group) -> dict[str, Any]:
    """Take of the dict of a group what JSON takes."""
    about: dict[str, Any] = json.loads(group[ABOUT][()].tobytes())
    return about


def _content(group: h5py.Group) -> dict[str, Any]:
    import h5py

    columns, groups = {}, {}
    for name, one in _all(group):
        if isinstance(one, h5py.Group):
            groups[name] = _content(one)
        elif not h5py.h5ds.is_scale(one.id):  # a dimension, which has a size and no values
            columns[name.removeprefix(_NAMESAKE)] = _decoded(one)
    del columns[ABOUT]
    about = about_of(group)
    about.pop("parts", None)
    parts = {"columns": columns, "groups": groups}
    return {"kind": str(about.pop("content")), **about, **{n: p for n, p in parts.items() if p}}


class IsAtlas(BadInput):
    """A file that xarray reads: in a folder of results it is passed over."""


@contextmanager
def checked_image(path: str | Path) -> Iterator[h5py.File]:
    """A file to read, once its checksum has shown that it is as it was written."""
    import h5py  # without xarray, which asks for each variable thirty times

    with opened(path) as file:
        _check(path, file)
        with h5py.File(file, "r") as root:
            about = {name: _plain(value) for name, value in _all(root.attrs)}
            if about.get("format") == ATLAS:
                raise IsAtlas(
                    f"{path} is an atlas: xarray.open_dataset reads it, as does all that reads "
                    "netCDF; read here are branches, boundaries, diagrams, zones and runs"
                )
            if about.get("format") != FORMAT:
                raise BadInput(f"{path} holds nothing that this version's `save` wrote")
            if (number := about["format_number"]) > NUMBER:
                raise BadInput(
                    f"{path} was written by a later version ({about.get('made_by')}): its format "
                    f"is {number}, this version reads {NUMBER}; update contbreather"
                )
            yield root


def _check(path: str | Path, file: BinaryIO, copy: BinaryIO | _Spool | None = None) -> None:
    """Refuse a file whose checksum is not its own; copy what is before that."""
    if file.read(len(_SIGNATURE)) != _SIGNATURE:
        raise BadInput(f"cannot read {path}: it is not a netCDF-4 file")
    left = max(0, file.seek(0, os.SEEK_END) - _LENGTH)
    file.seek(left)
    last = file.read()
    if not (last.startswith(_CHECKSUM[:-3]) and last.endswith(_CHECKSUM[-1:])):
        raise BadInput(
            f"{path} holds nothing that `save` wrote, or it has lost its end: the checksum "
            "that should be there is not"
        )
    if last != _copied(file, copy, left):
        raise BadInput(
            f"{path} is damaged: its checksum is not the one that `save` wrote; restore a copy"
        )
