"""Files that are as they were written, or are refused: netCDF-4 with a checksum behind it.

HDF5 does not look at what comes after its own last byte, so others read such a file as it is. We
read nothing from one with another checksum: of what is damaged HDF5 makes other numbers, or goes
on for ever.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from ..errors import BadInput
from ..files import opened, write_whole

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_SEAL = b"\nsha256 of all bytes before: %s\n"
_SEALED = len(_SEAL % bytes(64))


def write_sealed(path: str | Path, image: bytes) -> Path:
    """Write the bytes and their checksum, whole or not at all."""
    return write_whole(path, lambda file: file.writelines((image, _SEAL % _checksum(image))))


def read_sealed(path: str | Path) -> bytes:
    """The bytes that were written.

    Raises
    ------
    BadInput
        If there is no such file, it is not one of ours, or it is damaged.
    """
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
