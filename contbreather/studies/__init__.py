"""Studies: one TOML file says what is computed and drawn, and it is, over all cores there are.

What is finished is on disk, a file for each part; a study that was interrupted, or killed, goes on
with the rest.
"""

from __future__ import annotations

from contbreather.studies.run import Report, cluster, run
from contbreather.studies.schema import read
from contbreather.studies.tasks import DryRun, dry_run

__all__ = ["DryRun", "Report", "cluster", "dry_run", "read", "run"]
