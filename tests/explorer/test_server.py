"""The server of the explorer: where it listens, to whom it talks, and how it ends."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from base64 import b64encode
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from contbreather import explorer
from contbreather.errors import BadInput
from contbreather.explorer import server_for

from ..apart import HUNG, begun

Run = Callable[[str], tuple[int, str, str]]


def port_of(url: str) -> int:
    found = re.search(r":(\d+)/", url)
    assert found
    return int(found[1])


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The command itself, and where it says that it is. Ctrl-C ends it with 130 and one line."""
    with begun("-m", "contbreather", "explore", "--headless") as process:
        assert process.stdout is not None
        yield process, process.stdout.readline().split()[4]
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 130
    assert errors.splitlines()[-1] == "contbreather: interrupted"
    assert "KeyboardInterrupt" not in errors


def answer(url: str, request: str) -> str:
    """The first line that a server answers to a request."""
    with socket.create_connection(("127.0.0.1", port_of(url)), timeout=HUNG) as line:
        line.sendall(request.replace("\n", "\r\n").encode() + b"\r\n\r\n")
        return line.recv(100).decode(errors="replace").splitlines()[0]


def handshake(origin: str) -> str:
    key = b64encode(os.urandom(16)).decode()
    return (
        f"GET /ws HTTP/1.1\nHost: 127.0.0.1\nUpgrade: websocket\nConnection: Upgrade\n"
        f"Sec-WebSocket-Key: {key}\nSec-WebSocket-Version: 13\nOrigin: {origin}"
    )


def test_it_serves_a_page_on_this_machine_alone(served: Any) -> None:
    process, url = served
    assert url.startswith("http://127.0.0.1:")
    assert answer(url, "GET / HTTP/1.1\nHost: x") == "HTTP/1.1 200 OK"
    listening = Path(f"/proc/{process.pid}/net/tcp")
    if listening.exists():
        here = f"0100007F:{port_of(url):04X}"  # 127.0.0.1
        rows = [row.split()[1] for row in listening.read_text().splitlines()[1:]]
        assert here in rows
        assert f"00000000:{port_of(url):04X}" not in rows


def test_pages_from_elsewhere_may_not_talk_to_it(served: Any) -> None:
    _, url = served
    own = url.rstrip("/")
    assert answer(url, handshake("http://evil.example")).split()[1] == "403"
    assert answer(url, handshake("http://evil.example:80")).split()[1] == "403"
    # its own origin is let in; what is missing then is the token of a session
    assert answer(url, handshake(own)).split()[1] != "403"


@pytest.mark.parametrize(("more", "opened"), [("", ["/"]), (" --headless", [])])
def test_a_browser_is_opened_once_it_serves(
    more: str, opened: list[str], run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []
    later: list[Callable[[], None]] = []
    loop = SimpleNamespace(
        add_callback=lambda do, *given: later.append(partial(do, *given)),
        start=lambda: [do() for do in later],
    )
    server = SimpleNamespace(io_loop=loop, show=seen.append, start=lambda: None)
    monkeypatch.setattr(explorer, "server_for", lambda *given, **options: (server, "http://x/"))
    assert run(f"explore{more}")[0] == 130
    assert seen == opened


def test_a_port_that_is_taken_is_refused(run: Run) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        status, out, err = run(f"explore --headless --port {other.getsockname()[1]}")
    assert (status, out) == (2, "")
    assert re.fullmatch(r"contbreather: cannot listen at 127\.0\.0\.1, port \d+: .*\n", err)
    assert "choose another port" in err


def test_a_damaged_file_is_a_sentence_and_status_2(run: Run, tmp_path: Path) -> None:
    (tmp_path / "run.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(500))
    status, out, err = run("explore --headless run.nc")
    assert (status, out) == (2, "")
    assert "run.nc" in err


def test_without_panel_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "panel", None)
    with pytest.raises(BadInput, match=r"pip install 'contbreather\[explorer\]'"):
        server_for(None)  # type: ignore[arg-type]  # it is not asked for anything before that
