"""What has columns gives them to others: as tables of pandas and xarray, as text with commas."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from contbreather.files import write_csv

if TYPE_CHECKING:
    from xarray import Dataset

Array = NDArray[Any]
Variable = tuple[tuple[str, ...], Any]  # dimensions, values


class Columns:
    """A value with columns of one length, `columns`, each along the dimension `along`."""

    __slots__ = ()
    along: ClassVar[str] = "point"

    def columns(self) -> dict[str, Array]:
        """The columns by name, each with one row for each point; a row may be an array."""
        raise NotImplementedError

    def tabulated(self) -> dict[str, Array]:
        """The columns of tables of single numbers: all, unless there are some that say nothing by
        themselves."""
        return self.columns()

    def to_xarray(self) -> Dataset:
        """Make a dataset of xarray of all columns; those that are arrays have dimensions of their
        own.

        Examples
        --------
        >>> import contbreather as cb
        >>> branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.5, 0.6)})
        >>> branch.to_xarray()["p"].dims
        ('point',)
        """
        from xarray import Dataset

        return Dataset(self.variables(), attrs=self.attributes())

    def attributes(self) -> dict[str, Any]:
        """Words and numbers that say what the columns are of."""
        return {}

    def variables(self) -> dict[str, Variable]:
        """Columns with their dimensions, as datasets and files have them."""
        return {
            name: ((self.along, *(f"{name}_{i}" for i in range(1, column.ndim))), column)
            for name, column in self.columns().items()
        }

    def to_dataframe(self) -> Any:
        """The columns as a `DataFrame` of pandas: those that are arrays number by number, complex
        ones as real and imaginary part.

        Examples
        --------
        >>> import contbreather as cb
        >>> branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.5, 0.6)})
        >>> list(branch.to_dataframe())[:5]
        ['label', 'a', 'gamma', 'k', 'unstable']
        """
        from xarray import Dataset

        table = {name: (self.along, column) for name, column in _flat(self.tabulated()).items()}
        frame = Dataset(table).to_dataframe().reset_index()  # a column may be named as the rows
        return frame[list(table)].rename_axis(self.along)

    def to_csv(self, path: str | Path) -> Path:
        """Write the table as comma-separated text, each number in the fewest digits that read back
        as the same; what is no number is left empty.

        Examples
        --------
        >>> import contbreather as cb, tempfile
        >>> branch = cb.trace(cb.symmetric(0.5, 0.04, 0.8), "a", within={"a": (0.5, 0.6)})
        >>> path = branch.to_csv(f"{tempfile.mkdtemp()}/branch.csv")
        >>> path.read_text().splitlines()[0]
        'label,a,gamma,k,unstable,t1,t2,c,asymmetry,arclength,residual,p,phi'
        """
        table = _flat(self.tabulated())
        return write_csv(
            path, list(table), zip(*(column.tolist() for column in table.values()), strict=True)
        )


def _flat(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns of single real numbers, or words."""
    flat: dict[str, Array] = {}
    for name, column in columns.items():
        parts = {name: column}
        if column.dtype.kind == "c":
            parts = {f"{name}.real": column.real, f"{name}.imag": column.imag}
        for label, part in parts.items():
            if part.ndim == 1:
                flat[label] = part
            for i, place in enumerate(np.ndindex(part.shape[1:]) if part.ndim > 1 else ()):
                index = ",".join(map(str, place))
                flat[f"{label}[{index}]"] = part.reshape(len(part), -1)[:, i]
    return flat


def stacked(tables: Iterable[tuple[Mapping[str, Any], Mapping[str, Array]]]) -> dict[str, Array]:
    """Tables one below the other, each with what is the same in all its rows; a column that a table
    lacks is NaN there."""
    full = []
    for head, columns in tables:
        length = len(next(iter(columns.values())))
        same = {name: np.full(length, value) for name, value in head.items()}
        full.append({**same, **{n: c for n, c in columns.items() if c.ndim == 1}})
    names = dict.fromkeys(name for table in full for name in table)
    empty = [np.full(len(next(iter(table.values()))), math.nan) for table in full]
    return {
        name: np.concatenate([table.get(name, nan) for table, nan in zip(full, empty, strict=True)])
        for name in names
    }
