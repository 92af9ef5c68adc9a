"""Other contacts at a grazing point: what else may touch a wall where one crest of a site does.

The crest that grazes is a double zero of its margin. It is divided out, so that what is left
vanishes where a second one comes to the wall.
"""

from __future__ import annotations

import math

from contbreather.orbits.clearance import (
    Clearance,
    least,
    measure,
    of_flights,
    of_idle,
    within_a_period,
)
from contbreather.orbits.margins import MARGIN, WHEN
from contbreather.orbits.site_motion import SiteMotion

TELLING = 1e-12  # where margins vanish together, the least size of what still sets them apart
MIRRORED = 1e-13  # the margin of a crest that symmetry makes touch the other wall at the same place


def other_contacts(
    orbit: SiteMotion, site: int, t: float, *, mirrored: bool = False
) -> list[Clearance]:
    """Everything that may touch a wall besides the crest of one site at one time, which does.

    With `mirrored` the orbit is a symmetric one with its whole period written out: the crest at the
    other wall, half a period later, is the same again. On an arm it is not, and both come together
    at the pitchfork.

    The far field is not among them: its displacement lies between those of two neighbours far out,
    so it is never highest by more than rounding.

    Without coupling, or without an impact, all sites that do not hit follow the forcing alike, and
    margins vanish together, like the answer of the nearer of two sites to an impact. What is
    returned is ``m/(|m| + that)``, between -1 and 1, of the sign of each margin m and no zero that
    says nothing; 1 where rounding decides that sign.
    """
    idle = [*orbit.idle]
    size, near = orbit.influence(site), set(orbit.beside)
    if site not in orbit.hit:
        idle += [] if site in idle else [site]
        # margins are told apart by the larger of two influences: of those that feel the impacts
        # less the least is enough
        near |= {site, *(n for n in idle if orbit.influence(n) > size)}
    measured = measure(orbit, idle, near, touching=site, time=t)
    gaps = [*of_flights(orbit, measured), *of_idle(orbit, measured)]
    if site not in orbit.hit:
        here, other = measured.rows[-2:, : WHEN + 1].tolist()
        crests = [Clearance(here[MARGIN], site, within_a_period(orbit, here[WHEN]))]
        if other[MARGIN] < math.inf and not (mirrored and abs(other[MARGIN]) < MIRRORED):
            crests.append(Clearance(other[MARGIN], site, within_a_period(orbit, other[WHEN])))
        gaps = crests + gaps
    return [
        gap._replace(margin=_told_apart(gap.margin, max(size, orbit.influence(gap.site))))
        for gap in gaps
    ]


def closest_other(orbit: SiteMotion, site: int, t: float, *, mirrored: bool = False) -> Clearance:
    """The one of `other_contacts` with the least margin."""
    return least(other_contacts(orbit, site, t, mirrored=mirrored))


def _told_apart(margin: float, size: float) -> float:
    return 1.0 if size < TELLING else margin / (abs(margin) + size)
