"""Studies: one TOML file says what is computed and drawn, and it is, over all cores there are.

What is finished is on disk, a file for each part; a study that was interrupted, or killed, goes on
with the rest.
"""

from __future__ import annotations

from contbreather.studies.plan import Plan, plan
from contbreather.studies.report import Report
from contbreather.studies.run import run
from contbreather.studies.validation import read

__all__ = ["Plan", "Report", "plan", "read", "run"]
