"""`contbreather warm`: machine code for the sessions that follow."""

from __future__ import annotations

from contbreather.cli.interrupts import computing
from contbreather.cli.output import say
from contbreather.errors import NotConverged


def warm() -> None:
    """Compile the steps of branches and boundaries now, about 20 s, for all later sessions.

    Without it none is compiled; results are the same.
    """
    from contbreather.breathers.ahead import compile_ahead

    with computing():
        sets = compile_ahead()
    if not sets:
        raise NotConverged("nothing could be compiled; run it with --verbose to see why")
    say(f"{sets} sets of equations are compiled and kept.")
