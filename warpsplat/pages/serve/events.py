"""Server-sent events of a page, each the whole state of its session.

A page that comes back, or missed some, is right with the next one.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator

from warpsplat.pages.serve.limits import Refused
from warpsplat.pages.serve.store import Store

INTERVAL = 0.15
"""Time between two checks for changes [s]."""

PULSE = 5.0
"""Maximum time between two events [s]: a closed connection is noticed by writing."""


async def events(store: Store, session: str) -> AsyncIterator[str]:
    """Yield the states of a session until it is deleted or the server ends, and count as its reader."""
    store.attend(session)
    version, last, silent = -1, "", 0.0
    try:
        while not store.closed:
            if store.version != version:
                version = store.version
                text = json.dumps(store.state_of(session), allow_nan=False)
                if text != last:
                    last, silent = text, 0.0
                    yield f"data: {text}\n\n"
            if silent >= PULSE:
                silent = 0.0
                yield ": still here\n\n"
            await asyncio.sleep(INTERVAL)
            silent += INTERVAL
    except Refused:
        pass  # it was forgotten: its page asks for another one
    finally:
        store.leave(session)
