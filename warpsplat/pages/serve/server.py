"""The server: its socket, its address, and its end."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import os
import secrets
import socket
from collections.abc import Callable, Generator

import uvicorn

from warpsplat.errors import UsageError, printable
from warpsplat.pages.serve.app import Service
from warpsplat.pages.serve.connections import Protocol, accept
from warpsplat.pages.serve.guard import TOKEN, Guard
from warpsplat.pages.serve.limits import Limits
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.worker import Machine

LAST_ANSWERS = 2
"""Longest wait for unfinished answers when the server ends [s]."""


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
    """Tell whether only this machine can connect to an address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


class WarpsplatServer:
    """A server that listens from the beginning, and answers during ``run``."""

    def __init__(
        self,
        host: str,
        port: int,
        *,
        machine: Machine | None = None,
        limits: Limits | None = None,
        max_memory: str | None = None,
    ) -> None:
        """Listen.

        Args:
            host: address or name of this machine.
            port: number of the port; 0: any that is free.
            machine: where runs are computed.
            limits: what it accepts and holds.
            max_memory: limit of each run.

        Raises:
            UsageError: the address cannot be used.
        """
        self._host, self._socket = host, listening_socket(host, port)
        self.port = int(self._socket.getsockname()[1])
        self._token = secrets.token_urlsafe(24)
        self.store = Store(limits)
        self._guard = Guard(Service(self.store, machine or Machine(), max_memory).app(), self._token, host)

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

        def is_over() -> bool:
            if stop():
                self.store.close()  # ends the streams of events, which uvicorn would wait for
            return self.store.closed

        logging.getLogger("uvicorn").setLevel(logging.CRITICAL)  # its messages are about faulty clients
        config = uvicorn.Config(
            self._guard,
            http=Protocol,
            ws="none",
            lifespan="on",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=LAST_ANSWERS,
        )
        self._socket.setblocking(False)
        asyncio.run(_PolledServer(config, self._socket, is_over, ready).serve([]))


class _PolledServer(uvicorn.Server):
    """Polls whether to end instead of handling signals: ours also handle a second Ctrl-C."""

    def __init__(
        self,
        config: uvicorn.Config,
        listener: socket.socket,
        is_over: Callable[[], bool],
        ready: Callable[[], None],
    ) -> None:
        super().__init__(config)
        self._listener, self._is_over, self._ready = listener, is_over, ready

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """Leave the handlers of signals as they are."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start to answer."""
        await super().startup(sockets)
        self._accepting = asyncio.create_task(accept(self._listener, self._protocol))
        self._is_over()  # from the first poll on a signal is a request to stop
        self._ready()

    def _protocol(self) -> Protocol:
        return Protocol(self.config, self.server_state, self.lifespan.state)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop answering."""
        self._accepting.cancel()
        self._listener.close()
        await super().shutdown(sockets)

    async def on_tick(self, counter: int) -> bool:
        """Close idle connections and return whether to end; called ten times a second."""
        for connection in list(self.server_state.connections):
            assert isinstance(connection, Protocol)
            connection.close_if_idle()
        return self._is_over() or await super().on_tick(counter)
