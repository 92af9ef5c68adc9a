"""`contbreather warm`: what is compiled in time anyway, compiled now."""

from __future__ import annotations

from contbreather.cli.interrupts import computing
from contbreather.cli.output import note, say
from contbreather.errors import NotConverged


def warm() -> None:
    """Compile the steps of branches and boundaries now, about 20 s, for all later sessions.

    Without it they are compiled once they have taken as long as that would; results are the same.
    """
    from contbreather.breathers.ahead import compile_ahead

    note("compiling the steps of branches and boundaries, about 20 s")
    with computing():
        sets = compile_ahead()
    if not sets:
        raise NotConverged("nothing could be compiled; run it with --verbose to see why")
    say(f"{sets} sets of equations are compiled and kept.")
