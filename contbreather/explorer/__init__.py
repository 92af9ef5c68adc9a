"""The explorer: zones, branches and breathers to click through, in a browser or a notebook.

What is seen is one frozen value; an `Explorer` holds the present one and changes it, pages show it.
Panel and Bokeh, the extra `explorer`, are imported only where a page is made.
"""

from __future__ import annotations

from contbreather.explorer.notebook import Explorer

__all__ = ["Explorer"]
