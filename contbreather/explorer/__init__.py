"""The explorer: zones, branches and breathers to click through, in a browser or a notebook.

What is seen is one frozen value; an `Explorer` holds the present one and changes it, pages show it.
Panel and Bokeh, the extra `explorer`, are imported only where a page is made.
"""

from __future__ import annotations

from typing import Any

from contbreather.explorer.session import Session

__all__ = ["Explorer"]


class Explorer(Session):
    """Zones, branches and breathers to click through, in a notebook or in a browser.

    Parameters
    ----------
    *curves : Branch
        To begin with.
    run : str or Path, optional
        A file that `save` wrote, to begin with.
    k : float
        Restitution of the zone diagram.

    Raises
    ------
    BadInput
        If the file is not there or damaged, or k is not between 0 and 1.

    Examples
    --------
    In a notebook the object itself is shown. What is seen can be made again by a script:

    >>> from contbreather.explorer import Explorer
    >>> explorer = Explorer(k=0.8)
    >>> explorer.choose_at(a=0.5, gamma=0.08)
    >>> explorer.state.chosen.orbit.p
    0.8087491299885472
    >>> print(explorer.script())
    import contbreather as cb
    <BLANKLINE>
    zones = cb.zones(k=0.8)
    here = cb.symmetric(a=0.5, gamma=0.08, k=0.8)
    print(here.admissibility().reason)
    print(here.stability())
    mu = here.multipliers(sites=400, half=True)
    <BLANKLINE>
    cb.save_figure(cb.plotting.plot_zones(zones), "zones.pdf")
    <BLANKLINE>
    """

    def __panel__(self) -> Any:
        from contbreather.explorer.page import Page

        return Page(self).layout

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> Any:
        from contbreather.explorer.page import for_notebook

        return for_notebook(self, include, exclude)

    def __repr__(self) -> str:
        return f"<Explorer {self.state.title}: {len(self.state.curves)} curves>"
