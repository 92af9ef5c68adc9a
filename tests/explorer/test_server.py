"""The server of the explorer: where it listens, to whom it talks, and how it ends."""

from __future__ import annotations

import asyncio
import gc
import os
import re
import signal
import socket
import subprocess
import sys
import time
from base64 import b64encode
from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest
from tornado.websocket import WebSocketClosedError

from contbreather.errors import BadInput
from contbreather.explorer import Session, server_for

from ..apart import HUNG, begun
from ..typed import Run


def port_of(url: str) -> int:
    found = re.search(r":(\d+)/", url)
    assert found
    return int(found[1])


def browser_of(folder: Path) -> tuple[dict[str, str], Path]:
    """A browser that writes down what it is to open, as the environment has it, and where."""
    opened, browser = folder / "opened", folder / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {opened}.part && mv {opened}.part {opened}\n')
    browser.chmod(0o755)
    return {"BROWSER": str(browser)}, opened


@pytest.fixture(scope="module")
def served(tmp_path_factory) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The command itself, with a name of its own and no browser, and where it says that it is.
    Ctrl-C ends it with 130 and one line."""
    env, opened = browser_of(tmp_path_factory.mktemp("served"))
    explore = ("-m", "contbreather", "explore", "--headless", "--origin", "Lab.example:80")
    with begun(*explore, env=env) as process:
        assert process.stdout is not None
        yield process, process.stdout.readline().split()[4]
        assert not opened.exists()
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


def handshake(origin: str, host: str = "127.0.0.1", token: str = "") -> str:
    key = b64encode(os.urandom(16)).decode()
    return (
        f"GET /ws HTTP/1.1\nHost: {host}\nUpgrade: websocket\nConnection: Upgrade\n"
        f"Sec-WebSocket-Key: {key}\nSec-WebSocket-Version: 13\nOrigin: {origin}"
    ) + f"\nSec-WebSocket-Protocol: bokeh, {token}" * bool(token)


def asked(url: str, path: str, host: str) -> tuple[int, str]:
    """What a client is answered that takes the server for this host, as a browser does whose name
    server says so."""
    with closing(HTTPConnection("127.0.0.1", port_of(url), timeout=HUNG)) as line:
        line.putrequest("GET", path, skip_host=True)
        line.putheader("Host", host)
        line.endheaders()
        response = line.getresponse()
        return response.status, response.read().decode(errors="replace")


def token_of(page: str) -> str:
    """The session that a page is given, by which its websocket is let in."""
    found = re.search(r'"token":"([^"]+)"', page)
    assert found
    return found[1]


@pytest.mark.slow
def test_it_serves_a_page_on_this_machine_alone(served: Any) -> None:
    process, url = served
    assert url.startswith("http://127.0.0.1:")
    assert answer(url, "GET / HTTP/1.1\nHost: localhost") == "HTTP/1.1 200 OK"
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


HANDLERS = (
    "/", "/static/js/bokeh.min.js", "/static/extensions/panel/panel.min.js", "/metadata",
    "/autoload.js?bokeh-autoload-element=1", "/favicon.ico", "/nothing",
)  # fmt: skip


@pytest.mark.slow
def test_under_a_name_of_somebody_else_nothing_is_answered(served: Any) -> None:
    """A page of evil.example whose name is later said to be 127.0.0.1 is of the same origin as the
    server for a browser: all that tells them apart is the name that it asks for."""
    _, url = served
    port = port_of(url)
    good = f"127.0.0.1:{port}"
    answers = [asked(url, path, good) for path in HANDLERS]
    assert [status for status, _ in answers] == [200] * 6 + [404]
    for own in (f"localhost:{port}", f"LOCALHOST:{port}"):
        assert asked(url, "/metadata", own)[0] == 200
    token = token_of(answers[0][1])
    assert answer(url, handshake(f"http://{good}", good, token)).split()[1] == "101"
    for evil in (f"evil.example:{port}", "evil.example", f"127.0.0.1.evil.example:{port}",
                 f"localhost.:{port}", f"xlocalhost:{port}", f"127a0a0a1:{port}"):  # fmt: skip
        for path in HANDLERS:
            status, said = asked(url, path, evil)
            assert (status, "--origin" in said) == (403, True), (evil, path)
        for origin in (evil, good):
            line = answer(url, handshake(f"http://{origin}", evil, token))
            assert line.split()[1] == "403", (evil, origin)


@pytest.mark.slow
def test_a_name_that_it_is_told_is_its_own(served: Any) -> None:
    _, url = served
    status, page = asked(url, "/", "lab.example")
    assert status == 200
    wanted = handshake("http://lab.example", "lab.example", token_of(page))
    assert answer(url, wanted).split()[1] == "101"
    assert asked(url, "/", "other.example")[0] == 403


@pytest.mark.slow
def test_a_browser_is_opened_once_it_serves(tmp_path: Path) -> None:
    env, opened = browser_of(tmp_path)
    with begun("-m", "contbreather", "explore", env=env) as process:
        assert process.stdout is not None
        url = process.stdout.readline().split()[4]
        while not opened.exists():
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
    assert opened.read_text().strip().replace("localhost", "127.0.0.1") == url


def test_a_port_that_is_taken_is_refused(run: Run) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        status, out, err = run(f"explore --headless --port {other.getsockname()[1]}")
    assert (status, out) == (2, "")
    assert re.fullmatch(r"contbreather: cannot listen at 127\.0\.0\.1, port \d+: .*\n", err)
    assert "choose another port" in err


@pytest.mark.slow
def test_a_page_that_is_closed_while_it_is_written_to_is_no_trouble(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def write(error: Exception) -> None:
        raise error

    async def forgotten(*errors: Exception) -> None:
        tasks = [asyncio.create_task(write(error)) for error in errors]
        await asyncio.wait(tasks)

    server_for(Session())[0].stop()
    asyncio.run(forgotten(WebSocketClosedError(), OSError("something else")))
    gc.collect()
    assert [record.exc_info[0] for record in caplog.records if record.exc_info] == [OSError]


def test_without_panel_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "panel", None)
    with pytest.raises(BadInput, match=r"pip install 'contbreather\[explorer\]'"):
        server_for(None)  # type: ignore[arg-type]  # it is not asked for anything before that
