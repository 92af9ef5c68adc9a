"""What became of a study."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Report:
    """What became of a study.

    Attributes
    ----------
    folder : Path
        Where everything is; `contbreather.load` reads it.
    computed, kept : list of str
        Names of the parts that were computed now, and of those that were there already.
    failed : dict
        Name of each part without a result, and the reason.
    absent : dict
        The same of what the study calls optional: there was nothing to start from.
    written : list of Path
        Figures, and atlases as datasets.
    interrupted : bool
        Whether it was stopped; it goes on with the next call.
    """

    folder: Path
    computed: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    absent: dict[str, str] = field(default_factory=dict)
    written: list[Path] = field(default_factory=list)
    interrupted: bool = False

    @property
    def missing(self) -> dict[str, str]:
        """All parts without a result, and why."""
        return self.failed | self.absent

    def enter(self, name: str, outcome: str, why: str = "") -> None:
        """A part that was computed or kept, or failed or is absent for a reason."""
        where = getattr(self, outcome)
        if isinstance(where, dict):
            where[name] = why
        else:
            where.append(name)

    def so_far(self) -> Report:
        """Where an interruption leaves it."""
        self.interrupted = True
        return self
