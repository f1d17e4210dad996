"""Connections: no more than there are files for, and none that is only held."""

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
"""Files that are left for all else: pipes to processes that draw, compiled kernels, what the system opens."""

HEAD_TIME = 5.0
"""For a request to come, from the connection or the last answer on [s]."""

BODY_TIME = 60.0
"""For more of what is being sent to come [s]."""

RETRY = 1.0
"""Between two tries to take a connection where the system gives no more files [s]."""

SHORT = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}
"""What the system says then."""


def most_connections() -> int:
    """How many connections this process has files for."""
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
    """HTTP on a connection that knows since when it waits for its client."""

    ended: Callable[[], object] = staticmethod(lambda: None)
    """Called when the connection is gone."""
    heard = 0.0
    """When something came, or was answered, last [s, of the loop]."""
    since = 0.0
    """Since when a request is waited for [s, of the loop]."""

    def connection_made(self, transport: Any) -> None:
        """It begins."""
        self.heard = self.since = self.loop.time()
        super().connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """It is gone."""
        super().connection_lost(exc)
        self.ended()

    def data_received(self, data: bytes) -> None:
        """Something came."""
        self.heard = self.loop.time()
        super().data_received(data)

    def on_response_complete(self) -> None:
        """A request is answered."""
        self.since = self.loop.time()
        super().on_response_complete()

    def close_if_idle(self) -> None:
        """End it where its client has taken too long."""
        now = self.loop.time()
        if self.cycle is None or self.cycle.response_complete:
            late = now - self.since > HEAD_TIME
        else:
            late = self.cycle.more_body and now - self.heard > BODY_TIME
        if late:
            self.transport.abort()


class Door:
    """Takes connections from a socket that listens, as long as there is room; others wait in the system."""

    def __init__(self, listener: socket.socket, make: Callable[[], Protocol]) -> None:
        """Within a running loop. ``make``: the other end of a connection."""
        listener.setblocking(False)
        self._listener, self._make = listener, make
        self._room = asyncio.Semaphore(most_connections())
        self._has_said = False
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
                    self._say(error)
                await asyncio.sleep(RETRY)
                continue
            protocol = self._make()
            protocol.ended = self._room.release
            try:
                await loop.connect_accepted_socket(lambda made=protocol: made, connection)  # type: ignore[misc]
            except OSError:  # it is gone already
                connection.close()
                self._room.release()

    def _say(self, error: OSError) -> None:
        """That there are no more files: once, as it may be so for long."""
        if not self._has_said:
            self._has_said = True
            logging.getLogger("warpsplat").warning("connections have to wait: %s", error.strerror)

    def close(self) -> None:
        """Take no more, and listen no more."""
        self._task.cancel()
        self._listener.close()
