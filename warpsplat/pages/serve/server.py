"""The server: its socket, its address, and its shutdown."""

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
from warpsplat.pages.serve.connections import Acceptor, Protocol
from warpsplat.pages.serve.guard import TOKEN, Guard
from warpsplat.pages.serve.limits import Limits
from warpsplat.pages.serve.page import serve_page
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.worker import Machine

LAST_ANSWERS = 2
"""Time for responses in progress at shutdown [s]."""


def bound(host: str, port: int) -> socket.socket:
    """Return a listening socket.

    Raises:
        UsageError: it cannot be had; the message says why.
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
    """A server that listens from its creation, and answers during ``run``."""

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
            host: address, or name, of this machine.
            port: 0: any that is free.
            machine: where runs are computed.
            limits: of what it takes and holds.
            max_memory: of each run.

        Raises:
            UsageError: the port cannot be had.
        """
        self._host, self._socket = host, bound(host, port)
        self.port = int(self._socket.getsockname()[1])
        """Port that it listens on."""
        self._token = secrets.token_urlsafe(24)
        self.store = Store(limits)
        page = serve_page(self.store.limits)
        service = Service(self.store, machine or Machine(), page, max_memory)
        self._guard = Guard(service.app(), self._token, host)

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()

    def address(self, token: str | None = None) -> str:
        """Return the page's address; ``token``: another token than the server's."""
        shown = (
            "127.0.0.1" if self._host in {"0.0.0.0", ""} else "[::1]" if self._host == "::" else self._host
        )
        shown = f"[{shown}]" if ":" in shown and not shown.startswith("[") else shown
        return f"http://{shown}:{self.port}/?{TOKEN}={token or self._token}"

    def ticket(self) -> str:
        """Return the page's address with a token for one use."""
        return self.address(self._guard.ticket())

    def run(self, stop: Callable[[], bool], ready: Callable[[], None] = lambda: None) -> None:
        """Answer requests until ``stop`` returns true; call ``ready`` at the start."""
        logging.getLogger("uvicorn").setLevel(logging.CRITICAL)  # what it has to say is of clients' making
        config = uvicorn.Config(
            self._guard,
            http=Protocol,
            ws="none",
            lifespan="on",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_keep_alive=5,
            timeout_graceful_shutdown=LAST_ANSWERS,
        )
        asyncio.run(_Uvicorn(config, self._socket, self._is_over(stop), ready).serve([]))

    def _is_over(self, stop: Callable[[], bool]) -> Callable[[], bool]:
        def is_over() -> bool:
            if stop():
                self.store.close()  # streams of events end by it, which uvicorn would wait for
            return self.store.closed

        return is_over


class _Uvicorn(uvicorn.Server):
    """Polls ``stop`` instead of installing signal handlers, so that ours handle a second Ctrl-C."""

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
        """Install no handlers."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start answering."""
        await super().startup(sockets)
        self._door = Acceptor(self._listener, self._protocol)
        self._is_over()  # from the first question on a signal is a wish
        self._ready()

    def _protocol(self) -> Protocol:
        return Protocol(self.config, self.server_state, self.lifespan.state)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop answering."""
        self._door.close()
        await super().shutdown(sockets)

    async def on_tick(self, counter: int) -> bool:
        """Return whether to end; called ten times a second."""
        for connection in list(self.server_state.connections):
            assert isinstance(connection, Protocol)
            connection.close_if_idle()
        return self._is_over() or await super().on_tick(counter)
