"""The server as a program: its events, its address, its end, and errors at its start."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
import webbrowser
from typing import Any

import pytest

import warpsplat.pages.serve.server as server_module
from tests.cli.helpers import Cli, one_line, run
from tests.pages.serve.helpers import Visitor, picture, until
from warpsplat.pages.serve.server import is_loopback


def states(visitor: Visitor) -> Any:
    """Yield the states that a page receives."""
    with visitor.client.stream("GET", visitor.at("events")) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        for line in answer.iter_lines():
            if line.startswith("data: "):
                yield json.loads(line.removeprefix("data: "))


def test_a_page_receives_the_progress(visitor: Visitor) -> None:
    image = visitor.upload(picture())
    visitor.begin(image, curves=4, subject="photo", quality="high")
    seen: list[dict[str, Any]] = []
    for state in states(visitor):
        (told,) = state["runs"]
        seen.append(told)
        live = told.get("live", {})
        if live.get("pictures") and live["work"] and not live["draft"]:
            svg = visitor.client.get(visitor.at("runs", told["id"], "live.svg"))
            assert svg.headers["content-type"] == "image/svg+xml" and svg.text.startswith("<svg")
            break
    until(lambda: not visitor.store.is_attended())
    (told,) = next(states(visitor))["runs"]  # a page that comes back
    assert told["live"]["work"] >= seen[-1]["live"]["work"] > 0 and told["live"]["shapes"] > 0


def test_streams_end_with_the_server(visitor: Visitor) -> None:
    page = states(visitor)
    next(page)
    visitor.store.close()
    assert list(page) == []


def test_ctrl_c_ends_it_and_its_worker(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def visit(address: str) -> None:
        opened.append(address)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(webbrowser, "open", visit)
    shown = cli("serve", "--port", 0, "--device", "cpu", "--open", code=128 + signal.SIGINT)
    address = shown.out.split()[1]
    assert shown.out == f"warpsplat: {address} (Ctrl-C ends it)\n" and shown.err == ""
    assert address.startswith("http://127.0.0.1:")
    assert opened[0].partition("=")[0] == address.partition("=")[0] and opened[0] != address
    assert not [thread for thread in threading.enumerate() if thread.name == "runs"]


def test_a_port_that_is_in_use(capfd: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert run("serve", "--port", port, "--device", "cpu") == 2
    said = one_line(capfd.readouterr().err)
    assert said == f"warpsplat: port {port} of 127.0.0.1: Address already in use; --port 0 finds a free one"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--host", "no.such.host.invalid"], "--host no.such.host.invalid: "),
        (["--max-upload", "much"], "not a size: 'much'"),
        (["--max-memory", "much"], "not a size: 'much'"),
        (["--device", "cuda:77"], "unknown device 'cuda:77'"),
    ],
)
def test_invalid_options(arguments: list[str], said: str, cli: Cli) -> None:
    assert cli("serve", "--port", 0, *arguments, code=2).line.startswith(f"warpsplat: {said}")


def test_without_its_packages(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "warpsplat.pages.serve.server")
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert cli("serve", code=2).line.endswith('; pip install "warpsplat[serve]" installs it')


def test_a_public_host_is_warned_of(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module.WarpsplatServer, "run", lambda *_: None)
    said = cli("serve", "--port", 0, "--host", "0.0.0.0", "--device", "cpu").line
    assert said.startswith("warpsplat: --host 0.0.0.0: others can reach it")
    for host in ("127.0.0.1", "127.1.2.3", "::1", "localhost"):
        assert is_loopback(host)
    for host in ("0.0.0.0", "::", "192.168.1.2", "example.org"):
        assert not is_loopback(host)
