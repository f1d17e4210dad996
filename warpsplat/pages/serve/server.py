"""The server: its socket, its address, and its end."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import ipaddress
import logging
import os
import secrets
import socket
from collections.abc import Callable

import uvicorn

from warpsplat.errors import UsageError, printable
from warpsplat.pages.serve.app import Service
from warpsplat.pages.serve.connections import Protocol, accept
from warpsplat.pages.serve.guard import TOKEN, Guard
from warpsplat.pages.serve.runs import Limits
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.worker import Machine


def listening_socket(host: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Raises:
        UsageError: the address cannot be used; the message says why.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        socket.getaddrinfo(host, port, family)
    except (OSError, UnicodeError) as error:
        raise UsageError(f"--host {printable(host)}: {getattr(error, 'strerror', None) or error}") from error
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        other = "; --port 0 finds a free one" if port else ""
        cause = os.strerror(error.errno) if error.errno else error
        raise UsageError(f"port {port} of {printable(host)}: {cause}{other}") from error


def is_loopback(host: str) -> bool:
    """Return whether only this machine can connect to an address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


class WarpsplatServer:
    """A server that listens from the beginning, and answers during ``run``."""

    def __init__(self, host: str, port: int, machine: Machine, limits: Limits) -> None:
        """Listen; a ``port`` of 0 is any that is free.

        Raises:
            UsageError: the address cannot be used.
        """
        self._host, self._socket = host, listening_socket(host, port)
        self.port = int(self._socket.getsockname()[1])
        self._token = secrets.token_urlsafe(24)
        self.store = Store(limits)
        self._guard = Guard(Service(self.store, machine).app(), self._token, host)

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()

    def address(self, token: str | None = None) -> str:
        """Return the address of the page; ``token``: in place of the permanent one."""
        host = {"0.0.0.0": "127.0.0.1", "": "127.0.0.1", "::": "::1"}.get(self._host, self._host)
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/?{TOKEN}={token or self._token}"

    def ticket(self) -> str:
        """Return an address of the page that can be used once."""
        return self.address(self._guard.ticket())

    def run(self, stop: Callable[[], bool], ready: Callable[[], None] = lambda: None) -> None:
        """Answer requests until ``stop()``, which is polled, is true; ``ready`` is called at the start."""
        logging.getLogger("uvicorn").setLevel(logging.CRITICAL)  # its messages are about faulty clients
        self._socket.setblocking(False)
        asyncio.run(self._serve(stop, ready))

    async def _serve(self, stop: Callable[[], bool], ready: Callable[[], None]) -> None:
        config = uvicorn.Config(
            self._guard,
            http=Protocol,
            ws="none",
            lifespan="on",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=2,
        )
        server = uvicorn.Server(config)
        # Our own handlers of signals make ``stop`` true, and also handle a second Ctrl-C.
        server.capture_signals = contextlib.nullcontext  # type: ignore[method-assign, assignment]
        serving = asyncio.create_task(server.serve([]))
        while not (server.started or serving.done()):
            await asyncio.sleep(0.01)
        stop()  # from the first call on a signal is a request to stop
        state = server.server_state
        make = functools.partial(Protocol, config, state, server.lifespan.state)
        accepting = asyncio.create_task(accept(self._socket, make))
        ready()
        while not (self.store.closed or stop() or serving.done()):
            for connection in list(state.connections):
                assert isinstance(connection, Protocol)
                connection.close_if_idle()
            await asyncio.sleep(0.1)
        self.store.close()  # ends the streams of events, which uvicorn would wait for
        accepting.cancel()
        self._socket.close()
        server.should_exit = True
        await serving
