"""Connections that are only held: they take no more files than there are, and not for long."""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from urllib.parse import urlsplit

import httpx
import pytest

from tests.pages.serve.helpers import LONGEST, Visitor, picture, until
from warpsplat.pages.serve import connections
from warpsplat.pages.serve.connections import Protocol

resource = pytest.importorskip("resource")

FILES, HELD = 48, 60

PROGRAM = f"""
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, ({FILES}, {FILES}))
from warpsplat.cli.main import main
main(["serve", "--port", "0", "--device", "cpu"])
"""


@contextlib.contextmanager
def served() -> Iterator[tuple[str, subprocess.Popen[str], list[str]]]:
    """The address of a server that may open few files, its process, and what it says on stderr."""
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout and process.stderr
        said: list[str] = []
        listening = threading.Thread(target=lambda: said.extend(process.stderr or ()))
        listening.start()
        try:
            yield process.stdout.readline().split()[1], process, said
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(LONGEST)
            listening.join()


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="has no limit of open files")
def test_more_connections_than_files() -> None:
    with served() as (address, process, said), contextlib.ExitStack() as held:
        parts = urlsplit(address)
        assert parts.hostname and parts.port
        idle = [
            held.enter_context(socket.create_connection((parts.hostname, parts.port))) for _ in range(HELD)
        ]
        with selectors.DefaultSelector() as selector:  # those that were let in are sent away
            selector.register(idle[0], selectors.EVENT_READ)
            assert selector.select(LONGEST)
            with contextlib.suppress(ConnectionError):
                assert idle[0].recv(1) == b""
        held.close()
        answer = httpx.get(address, follow_redirects=True, timeout=LONGEST)
        assert answer.text.startswith("<!doctype html>")
        assert process.poll() is None
    assert len("".join(said)) < 500 and "Traceback" not in "".join(said)


def test_no_more_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes then waits in the system, and is let in when another one goes."""
    counts = [0]
    made, lost = Protocol.connection_made, Protocol.connection_lost

    def coming(self: Protocol, transport: object) -> None:
        counts.append(counts[-1] + 1)
        made(self, transport)

    def going(self: Protocol, error: Exception | None) -> None:
        counts.append(counts[-1] - 1)
        lost(self, error)

    monkeypatch.setattr(connections, "most_connections", lambda: 2)
    monkeypatch.setattr(Protocol, "connection_made", coming)
    monkeypatch.setattr(Protocol, "connection_lost", going)
    with Visitor() as visitor:
        visitor.client.close()
        until(lambda: counts[-1] == 0)
        server = ("127.0.0.1", visitor.server.port)
        held = [socket.create_connection(server) for _ in range(5)]
        until(lambda: counts[-1] == 2)
        for each in held:
            each.close()
        answer = httpx.get(visitor.server.address(), follow_redirects=True, timeout=LONGEST)
        assert answer.status_code == 200
    assert max(counts) == 2


@pytest.mark.parametrize("sent", [b"", b"GET / HT", b"POST /sessions HTTP/1.1\r\nContent-Length: 9\r\n\r\nx"])
def test_what_does_not_go_on_is_ended(sent: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HEAD_TIME", 0.2)
    monkeypatch.setattr(connections, "BODY_TIME", 0.2)
    with Visitor() as visitor, socket.create_connection(("127.0.0.1", visitor.server.port)) as idle:
        idle.settimeout(LONGEST)
        idle.sendall(sent)
        with contextlib.suppress(ConnectionError):
            while idle.recv(1000):  # an answer to a stranger, perhaps
                pass


def test_a_stream_of_events_is_not_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[float] = []
    close = Protocol.close_if_idle

    def looked(self: Protocol) -> None:
        looks.append(self.loop.time())
        close(self)

    monkeypatch.setattr(connections, "HEAD_TIME", 0.1)
    monkeypatch.setattr(connections, "BODY_TIME", 0.1)
    monkeypatch.setattr(Protocol, "close_if_idle", looked)
    with Visitor() as visitor, visitor.client.stream("GET", visitor.at("events")) as answer:
        lines = answer.iter_lines()
        next(lines)
        until(lambda: looks and looks[-1] > looks[0] + 1)
        visitor.upload(picture())
        assert any('"photo.png"' in line for line in lines)


def test_a_limit_says_how_many(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = len(os.listdir("/dev/fd"))
    for limit, most in ((10_000, connections.MOST), (taken, connections.LEAST)):
        monkeypatch.setattr(resource, "getrlimit", lambda _, limit=limit: (limit, limit))
        assert connections.most_connections() == most
    monkeypatch.setattr(resource, "getrlimit", lambda _: (taken + 100, 0))
    assert abs(connections.most_connections() - 100 + connections.OTHERS) < 5
