"""The explorer: zones, branches and breathers to click through, in a browser or a notebook.

What is seen is a frozen `State`; an `Explorer` holds the present one and changes it, pages show it.
Panel and Bokeh, the extra `explorer`, are imported only where a page is made.
"""

from __future__ import annotations

from contbreather.explorer.notebook import Explorer
from contbreather.explorer.state import State

__all__ = ["Explorer", "State"]
