"""What lies beyond GR in a zone diagram: the orbits with impacts more, followed there."""

from __future__ import annotations

from contbreather.continuation.branches.switching import NothingToSwitch, switch
from contbreather.continuation.curve.branch import Stop
from contbreather.continuation.walk.trace import trace
from contbreather.errors import ContbreatherError
from contbreather.orbits.orbit import Orbit


def beyond_grazing(breather: Orbit, threshold: float) -> str:
    """Say which orbit is there in place of a breather that passes walls, and whether it is stable:
    the one `switch` leads to from the GR at a smaller amplitude, and from the next ones on the way.
    Empty where there is no such GR.
    """
    a, window = breather.a, {"a": (0.0, breather.a)}
    problem = breather.problem_beyond(threshold)
    # with its walls lifted, to where it is one
    down = trace(
        problem, "a", towards="down", within=window, events=(), inadmissible=True, progress=False
    )
    inside = next((point for point in down if point["margin"] > 0.0), None)
    if inside is None:
        return ""
    branch = trace(inside.solution, "a", towards="up", within=window, events=(), progress=False)
    try:
        while branch[-1].kind == "GR":
            (branch,) = switch(branch[-1], within=window, events=(), progress=False)
            orbit: Orbit = branch[-1].solution
            sites, hits = orbit.section.hit, len(orbit.hits) // orbit.section.turns
            words = f"{len(sites)} sites impact"
            if len(sites) == 1:
                words = f"site {sites[0]} impacts {hits} times a period"
            if branch.stop is Stop.BOUND and orbit.a == a:
                return f"{words}: {'un' * (orbit.map.unstable(threshold) > 0)}stable"
            if branch[-1].kind != "GR":
                return f"{words}, nearer to GR only"
    except NothingToSwitch as error:
        return str(error.__cause__)
    except ContbreatherError as error:
        return f"what begins at GR is not followed: {error}"
    return ""
