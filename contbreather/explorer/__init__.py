"""The explorer: zones, branches and breathers to click through, in a browser or a notebook.

What is seen is one frozen value; an `Explorer` holds the present one and changes it, pages show it.
Panel and Bokeh, the extra `explorer`, are imported only where a page is made. In a browser it is a
server on this machine that ends with Ctrl-C.
"""

from __future__ import annotations

import logging
import re
import socket
from collections.abc import Sequence
from html import escape
from typing import Any

from contbreather.errors import BadInput
from contbreather.explorer.session import Session

__all__ = ["Explorer", "server_for"]

LOOPBACK = "127.0.0.1"


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
        If the file is not there or damaged, a curve is none, or k is not between 0 and 1.

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


def server_for(
    explorer: Session, *, port: int = 0, address: str = LOOPBACK, origins: Sequence[str] = ()
) -> tuple[Any, str]:
    """A server that is not running yet, and where a browser finds it.

    Parameters
    ----------
    explorer : Session
        The one that every page shows.
    port : int
        Any free one unless given.
    address : str
        This machine alone unless given.
    origins : sequence of str
        ``HOST:PORT`` of other names that it is reached by, and of pages from elsewhere that may
        talk to it. A request by any other name is refused: a page from elsewhere whose own name is
        made to mean this machine (DNS rebinding) would be let in by a browser.

    Raises
    ------
    BadInput
        If the port is taken or the address is not one of this machine, an origin is none, or Panel
        is missing.
    """
    panel = _panel()
    from bokeh.server.util import create_hosts_allowlist

    port = _free(address, port)
    own = (f"{host}:{port}" for host in dict.fromkeys((LOOPBACK, "localhost", address)))
    hosts = [host.lower() for host in (*own, *origins)]
    for host in hosts:
        try:
            create_hosts_allowlist([host], port)
        except ValueError as error:
            raise BadInput(
                f"origin {host!r}: HOST:PORT was expected, example.org:80 for instance"
            ) from error
    from contbreather.explorer.page import in_template

    # that a page was closed, or loaded again, while something was sent to it is no trouble
    logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)
    logging.getLogger("asyncio").addFilter(_of_no_closed_page)
    server = panel.io.server.get_server(
        {"/": lambda: in_template(explorer)}, port=port, address=address, start=False, show=False,
        websocket_origin=hosts, title="contbreather explorer", verbose=False,
    )  # fmt: skip
    _by_no_other_name(server._tornado, hosts)
    return server, f"http://{LOOPBACK if address == LOOPBACK else address}:{port}/"


def _of_no_closed_page(record: logging.LogRecord) -> bool:
    from tornado.websocket import WebSocketClosedError

    return not (record.exc_info and isinstance(record.exc_info[1], WebSocketClosedError))


def _by_no_other_name(application: Any, hosts: Sequence[str]) -> None:
    """Refuse requests under another name, before any handler of a page, a file or a websocket;
    ports do not matter, the request has come to this one."""
    from tornado.web import RequestHandler

    names = [re.escape(host.split(":")[0]).replace(r"\*", ".*") for host in hosts]

    class Refused(RequestHandler):
        def prepare(self) -> None:
            self.set_status(403)
            self.finish(
                f"The explorer does not answer as {escape(self.request.host)}. If it is to be "
                "reached by that name, start it with --origin HOST:PORT, as the browser shows it."
            )

    application.add_handlers(f"(?!({'|'.join(names)})$).*$", [(".*", Refused)])


def _panel() -> Any:
    try:
        import panel
    except ModuleNotFoundError as error:
        raise BadInput(
            f"the explorer needs {error.name}, which is not installed: "
            "pip install 'contbreather[explorer]'"
        ) from error
    return panel


def _free(address: str, port: int) -> int:
    try:
        info = socket.getaddrinfo(address, None, type=socket.SOCK_STREAM)[0]
        host, _, *more = info[4]
        with socket.socket(info[0], info[1]) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port, *more))
            return int(probe.getsockname()[1])
    except (OSError, OverflowError, TypeError) as error:
        reason = getattr(error, "strerror", None) or str(error).rstrip(".")
        raise BadInput(
            f"cannot listen at {address}, port {port}: {reason}; choose another port, or 0 for "
            "any that is free"
        ) from error
