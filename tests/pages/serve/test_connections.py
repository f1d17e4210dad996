"""Idle connections are closed, and there are never more than the process may open files."""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import socket
import subprocess
import sys
from urllib.parse import urlsplit

import httpx
import pytest

from tests.pages.serve.helpers import LONGEST, Visitor, picture
from warpsplat.pages.serve import connections

resource = pytest.importorskip("resource")

FILES, HELD = 48, 60

PROGRAM = f"""
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, ({FILES}, {FILES}))
from warpsplat.cli.main import main
main(["serve", "--port", "0", "--device", "cpu"])
"""


def is_closed(client: socket.socket, seconds: float) -> bool:
    """Return whether the server closes a connection within some time; without a request it says nothing."""
    with selectors.DefaultSelector() as selector:
        selector.register(client, selectors.EVENT_READ)
        if not selector.select(seconds):
            return False
    with contextlib.suppress(ConnectionError):
        assert client.recv(1) == b""
    return True


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="has no limit of open files")
def test_more_connections_than_files() -> None:
    program = [sys.executable, "-c", PROGRAM]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout
        address = process.stdout.readline().split()[1]
        parts = urlsplit(address)
        assert parts.hostname and parts.port
        with contextlib.ExitStack() as held:
            server = (parts.hostname, parts.port)
            idle = [held.enter_context(socket.create_connection(server)) for _ in range(HELD)]
            assert is_closed(idle[0], LONGEST)
        answer = httpx.get(address, follow_redirects=True, timeout=LONGEST)
        assert answer.text.startswith("<!doctype html>")
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=LONGEST)
    assert len(errors) < 500 and "Traceback" not in errors


def test_connections_wait_until_others_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "most_connections", lambda: 2)
    with Visitor() as visitor:
        visitor.client.close()
        server = ("127.0.0.1", visitor.server.port)
        request = f"GET / HTTP/1.1\r\nHost: {server[0]}\r\n\r\n".encode()
        held = [socket.create_connection(server) for _ in range(3)]
        for each in held[:2]:
            each.sendall(request)
            assert each.recv(1)
        held[2].sendall(request)
        held[2].settimeout(0.3)
        with pytest.raises(TimeoutError):
            held[2].recv(1)
        held[0].close()
        held[2].settimeout(LONGEST)
        assert held[2].recv(1)
        for each in held:
            each.close()


@pytest.mark.parametrize("sent", [b"", b"GET / HT", b"POST /sessions HTTP/1.1\r\nContent-Length: 9\r\n\r\nx"])
def test_an_idle_connection_is_closed(sent: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HEAD_TIME", 0.2)
    monkeypatch.setattr(connections, "BODY_TIME", 0.2)
    with Visitor() as visitor, socket.create_connection(("127.0.0.1", visitor.server.port)) as idle:
        idle.settimeout(LONGEST)
        idle.sendall(sent)
        with contextlib.suppress(ConnectionError):
            while idle.recv(1000):  # perhaps the refusal of an unknown client
                pass


def test_a_stream_of_events_is_not_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HEAD_TIME", 0.1)
    monkeypatch.setattr(connections, "BODY_TIME", 0.1)
    with Visitor() as visitor, visitor.client.stream("GET", visitor.at("events")) as answer:
        lines = answer.iter_lines()
        next(lines)
        with socket.create_connection(("127.0.0.1", visitor.server.port)) as idle:
            assert is_closed(idle, LONGEST)
        visitor.upload(picture())
        assert any('"photo.png"' in line for line in lines)
