"""From what is measured in a laboratory to the numbers of the model, and back.

``M x_n'' + C x_n' + K x_n + S (2 x_n - x_(n-1) - x_(n+1)) = A shape(t)``, with stops at
``|x_n| = d``, is the model once lengths are in gaps d and times in 1/Omega of the drive: then
``a = A/(M d Omega^2)``, ``gamma = S/(M Omega^2)``, ``spring = K/(M Omega^2)`` and
``damping = C/(M Omega)``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from contbreather.checks import brief, numbers, one_of
from contbreather.errors import BadInput
from contbreather.tables import Sheet

LARGEST = 1e30  # of what is measured, and its inverse the smallest: products of it stay finite
MEASURED_ROWS = {"mass": "masses", "force": "drive", "ground": "springs", "damping": "dampings"}


@dataclass(frozen=True, kw_only=True)
class Units:
    """A chain as it was measured, in SI or any other units that fit each other.

    Parameters
    ----------
    mass : float or array_like, shape (N,)
        Of a site.
    stiffness : float
        Of the spring between neighbours; of other lattices, of a bond whose entry is 1.
    gap : float
        From rest to a stop.
    frequency : float
        Of the drive, in periods per unit of time: hertz for seconds. Omega is 2 pi times that.
    ground : float or array_like, shape (N,), optional
        Stiffness of the spring that holds a site.
    damping : float or array_like, shape (N,), optional
        Force per velocity: twice the damping ratio times the root of mass times stiffness.
    force : float or array_like, shape (N,), optional
        What the shape of the forcing is multiplied by; mass times acceleration of a shaken base.

    Raises
    ------
    BadInput
        For what is no finite number, negative, or zero where it must not be, and for rows of
        different lengths.

    Examples
    --------
    >>> units = Units(mass=0.025, stiffness=10, gap=1e-3, frequency=12, ground=40, force=0.07)
    >>> {name: round(value, 4) for name, value in units.parameters.items()}
    {'a': 0.4925, 'gamma': 0.0704, 'spring': 0.2814}
    >>> round(0.4925 * units.scale("a"), 4), round(1e3 * units.scale("time"), 2)  # N, ms
    (0.07, 13.26)
    """

    mass: Any
    stiffness: float
    gap: float
    frequency: float
    ground: Any = None
    damping: Any = None
    force: Any = None

    def __post_init__(self) -> None:
        sizes = dict[str, int]()
        for field in fields(self):
            name, given = field.name, getattr(self, field.name)
            if given is None and field.default is None:
                continue
            values, everywhere = numbers(name, given), name in ("mass", "gap", "frequency")
            inside = (values == 0.0) | ((values >= 1.0 / LARGEST) & (values <= LARGEST))
            there = values.all() if everywhere else values.any() or name != "force"
            if values.ndim > (name in MEASURED_ROWS) or not (
                values.size and inside.all() and there
            ):
                above = "above 0" if everywhere or name == "force" else "at least 0"
                several = ", or one for each site," if name in MEASURED_ROWS else ""
                raise BadInput(
                    f"{name} = {brief(given)}: a number {above}{several} and up to {LARGEST:g} "
                    "was expected; take units in which it is one."
                )
            sizes |= {name: values.size} if values.ndim else {}
            object.__setattr__(self, name, tuple(values.tolist()) if values.ndim else float(values))
        if len({*sizes.values()}) > 1:
            given = ", ".join(f"{size} of {name}" for name, size in sizes.items())
            raise BadInput(f"{given}: as many as there are sites were expected of each.")

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameters of `symmetric`, those that were measured, all but k; means over the sites."""
        given = {"a": self.force, "gamma": self.stiffness, "spring": self.ground,
                 "damping": self.damping}  # fmt: skip
        known = {name: value for name, value in given.items() if value is not None}
        return {name: float(np.mean(value)) / self.scale(name) for name, value in known.items()}

    @property
    def rows(self) -> dict[str, Any]:
        """Masses, drive, springs and dampings of a lattice, where they differ from site to site:
        ``OpenChain(9, **units.rows)``."""
        heavy = np.asarray(self.mass) / np.mean(self.mass)
        found = {"masses": heavy}
        for name in ("force", "ground", "damping"):  # these are per unit mass
            value = getattr(self, name)
            if value is not None and np.any(value):
                found[MEASURED_ROWS[name]] = np.asarray(value) / np.mean(value) / heavy
        # parts that differ by rounding alone are alike
        return {name: row for name, row in found.items() if row.ndim and np.ptp(row) > 1e-12}

    def scale(self, name: str) -> float:
        """Size of 1 of our numbers: a number times that was measured, what was measured over that
        is a number.

        Parameters
        ----------
        name : str
            ``"length"``, ``"time"``, ``"velocity"``, ``"acceleration"``, ``"force"``,
            ``"stiffness"``, ``"damping"``, ``"frequency"``, or a parameter or column: ``"a"``,
            ``"p"``, ``"t1"``.
        """
        M, d, T = float(np.mean(self.mass)), self.gap, 0.5 / math.pi / self.frequency
        ones = {"length c u": d, "time t phi": T, "velocity p J v": d / T,
                "acceleration": d / T**2, "force a": M * d / T**2,
                "stiffness gamma spring": M / T**2, "damping": M / T,
                "frequency omega": self.frequency}  # fmt: skip
        scales = {word: one for words, one in ones.items() for word in words.split()}
        column = str(name).rstrip("0123456789") if str(name)[:1] in "tJ" else name
        return scales[one_of("name", column, [*scales])]

    def table(self) -> Sheet:
        """Which length, time, force ... is 1, and the parameters."""
        ones = ("length", "time", "velocity", "force", "stiffness", "damping")
        rows = [(f"1 of {name}", self.scale(name)) for name in ones]
        return Sheet.of([*rows, *self.parameters.items()], "in the units of what was measured")
