"""Refusals that carry what they are about, so that a program need not read the sentence."""

from __future__ import annotations

import math
from typing import Any

from contbreather.errors import BadInput, NoSolution


class Inadmissible(NoSolution):
    """What solves the equations is no orbit: `orbit` is that solution, and `site` (None: the far
    field) is at or behind a wall at `time` without an impact."""

    def __init__(self, message: str, *, orbit: Any = None) -> None:
        super().__init__(message)
        self.orbit, self.site, self.time = orbit, None, math.nan
        if orbit is not None:
            margins = orbit.admissibility()
            self.site, self.time = margins.site, margins.time


class ImpossibleSequence(BadInput):
    """No orbit has these impacts: `sequence` is what was asked for, `met` what was seen instead."""

    def __init__(self, message: str, *, sequence: Any = None, met: Any = None) -> None:
        super().__init__(message)
        self.sequence = sequence
        self.met = met
