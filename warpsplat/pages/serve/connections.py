"""Limits on connections: no more than the process may open files, and none that stays idle."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST, LEAST = 500, 2
"""Range of the number of connections."""

RESERVE = 24
"""Open files kept for other purposes: pipes to worker processes, compiled kernels, the system's own."""

HEAD_TIME = 5.0
"""Longest wait for a request, after connecting or after the last response [s]."""

BODY_TIME = 60.0
"""Longest pause within the body of a request [s]."""


def most_connections() -> int:
    """Return how many connections this process has open files for."""
    try:
        import resource
    except ImportError:  # Windows
        return MOST
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if limit == resource.RLIM_INFINITY:
        return MOST
    try:
        taken = len(os.listdir("/dev/fd"))
    except OSError:
        taken = RESERVE
    return max(LEAST, min(MOST, limit - taken - RESERVE))


class Protocol(H11Protocol):
    """An HTTP connection that is closed if its client stays idle, also before the first request."""

    on_close: Callable[[], object] = staticmethod(lambda: None)
    last_data = 0.0
    """Time at which data last arrived [s, the loop's clock]."""
    waiting_since = 0.0
    """Time since which it has waited for a request [s, the loop's clock]."""

    def connection_made(self, transport: Any) -> None:
        """Start both clocks."""
        self.last_data = self.waiting_since = self.loop.time()
        super().connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """Report that the connection is closed."""
        super().connection_lost(exc)
        self.on_close()

    def data_received(self, data: bytes) -> None:
        """Note the time, and parse the data."""
        self.last_data = self.loop.time()
        super().data_received(data)

    def on_response_complete(self) -> None:
        """Start to wait for the next request."""
        self.waiting_since = self.loop.time()
        super().on_response_complete()

    def close_if_idle(self) -> None:
        """Close the connection if the server has waited for its client too long."""
        now = self.loop.time()
        if self.cycle is None or self.cycle.response_complete:
            late = now - self.waiting_since > HEAD_TIME
        else:
            late = self.cycle.more_body and now - self.last_data > BODY_TIME
        if late:
            self.transport.abort()


async def accept(listener: socket.socket, make: Callable[[], Protocol]) -> None:
    """Accept connections while there are files for them; further ones wait in the system's queue.

    ``listener``: a listening socket that does not block; ``make``: returns the protocol of a new connection.
    """
    loop = asyncio.get_running_loop()
    free = asyncio.Semaphore(most_connections())
    has_warned = False
    while True:
        await free.acquire()
        protocol = make()
        try:
            connection, _ = await loop.sock_accept(listener)
            protocol.on_close = free.release
            await loop.connect_accepted_socket(lambda made=protocol: made, connection)  # type: ignore[misc]
        except OSError as error:  # out of files, or the client is gone
            free.release()
            if not has_warned:
                logging.getLogger("warpsplat").warning("connections have to wait: %s", error.strerror)
            has_warned = True
            await asyncio.sleep(1.0)
