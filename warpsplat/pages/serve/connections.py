"""Limits on connections: no more than the process may open files, and none that stays idle."""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import socket
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST = 500
"""Connections, where there are files for as many."""

LEAST = 2

OTHERS = 24
"""Open files kept in reserve: pipes to worker processes, compiled kernels, the system's own."""

HEAD_TIME = 5.0
"""Longest wait for a request, after connecting or after the last response [s]."""

BODY_TIME = 60.0
"""Longest pause within the body of a request [s]."""

RETRY = 1.0
"""Pause before accepting again when the system is out of files [s]."""

SHORT = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}
"""Errors that mean so."""


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
        taken = OTHERS
    return max(LEAST, min(MOST, limit - taken - OTHERS))


class Protocol(H11Protocol):
    """An HTTP connection that can tell whether its client is idle."""

    ended: Callable[[], object] = staticmethod(lambda: None)
    """Called when the connection is closed."""
    heard = 0.0
    """Time at which data last arrived [s, the loop's clock]."""
    since = 0.0
    """Time from which it has waited for a request [s, the loop's clock]."""

    def connection_made(self, transport: Any) -> None:
        """Start both clocks."""
        self.heard = self.since = self.loop.time()
        super().connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """Report that the connection is closed."""
        super().connection_lost(exc)
        self.ended()

    def data_received(self, data: bytes) -> None:
        """Note the time, and parse the data."""
        self.heard = self.loop.time()
        super().data_received(data)

    def on_response_complete(self) -> None:
        """Wait for the next request from now on."""
        self.since = self.loop.time()
        super().on_response_complete()

    def close_if_idle(self) -> None:
        """Close the connection if its client has kept it waiting for too long."""
        now = self.loop.time()
        if self.cycle is None or self.cycle.response_complete:
            late = now - self.since > HEAD_TIME
        else:
            late = self.cycle.more_body and now - self.heard > BODY_TIME
        if late:
            self.transport.abort()


class Acceptor:
    """Accepts connections while there are files for them; others wait in the system's queue."""

    def __init__(self, listener: socket.socket, make: Callable[[], Protocol]) -> None:
        """Start accepting, within a running loop. ``make`` returns the protocol of a new connection."""
        listener.setblocking(False)
        self._listener, self._make = listener, make
        self._room = asyncio.Semaphore(most_connections())
        self._has_warned = False
        self._task = asyncio.get_running_loop().create_task(self._accept())

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await self._room.acquire()
            try:
                connection, _ = await loop.sock_accept(self._listener)
            except OSError as error:
                self._room.release()
                if error.errno in SHORT:
                    self._warn(error)
                await asyncio.sleep(RETRY)
                continue
            protocol = self._make()
            protocol.ended = self._room.release
            try:
                await loop.connect_accepted_socket(lambda made=protocol: made, connection)  # type: ignore[misc]
            except OSError:  # it is gone already
                connection.close()
                self._room.release()

    def _warn(self, error: OSError) -> None:
        """Warn once that the system is out of files."""
        if not self._has_warned:
            self._has_warned = True
            logging.getLogger("warpsplat").warning("connections have to wait: %s", error.strerror)

    def close(self) -> None:
        """Stop accepting and close the listening socket."""
        self._task.cancel()
        self._listener.close()
