"""`contbreather explore`: zones, branches and breathers to click through, in a browser."""

from __future__ import annotations

from contbreather.cli.interrupts import computing
from contbreather.cli.options import Whole
from contbreather.cli.output import say


def explore(
    run: str | None = None,
    /,
    *,
    k: float = 0.8,
    port: Whole = 0,
    address: str = "127.0.0.1",
    origin: tuple[str, ...] = (),
    headless: bool = False,
) -> None:
    """Zones, branches and breathers to click through, in a browser; Ctrl-C ends it.

    Parameters
    ----------
    run
        A file with curves to begin with.
    k
        Restitution of the first zone diagram.
    port
        Where to listen; any free port unless given.
    address
        Of this machine, on which others may reach it; 127.0.0.1, this machine alone, unless given.
    origin
        HOST:PORT of a page from elsewhere that may talk to it, behind a proxy for instance.
    headless
        Do not open a browser.
    """
    from contbreather.explorer import Explorer
    from contbreather.explorer.server import server_for

    with computing():
        explorer = Explorer(run=run, k=k)
        server, url = server_for(explorer, port=port, address=address, origins=origin)
        say(f"The explorer is at {url} (Ctrl-C ends it).")
        if not headless:
            server.io_loop.add_callback(server.show, "/")
        server.start()
        server.io_loop.start()  # Ctrl-C stops it between two callbacks, not in the middle of one
        raise KeyboardInterrupt
