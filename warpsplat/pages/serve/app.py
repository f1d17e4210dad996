"""The requests of the page. Errors are one line of plain text with their status.

Everything is looked up by its name in the store: no part of an address is ever a path of the file system.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from warpsplat.errors import ImageError, UsageError, WarpsplatError, explain
from warpsplat.native import release_memory
from warpsplat.pages.serve.form import serve_page, settings_of
from warpsplat.pages.serve.guard import line
from warpsplat.pages.serve.sessions import Refused
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.uploads import DEFAULT_NAME, plain_name, read_upload
from warpsplat.pages.serve.worker import Machine, start_worker
from warpsplat.run.command_line import vectorize_command

UPLOAD_TIME = 300.0
"""Longest upload [s]: others wait for the memory that is reserved for it."""

EVENT_INTERVAL = 0.15
"""Shortest time between two events [s]."""

PULSE = 5.0
"""Longest time between two events [s]: only writing reveals that a page was closed."""

CACHED = {"Cache-Control": "private, max-age=3600, immutable"}
"""Headers of what never changes."""


class Service:
    """The answers to a page's requests."""

    def __init__(self, store: Store, machine: Machine) -> None:
        """Start nothing yet."""
        self._store, self._machine = store, machine
        self._page = serve_page(store.limits)
        self._decoding = asyncio.Semaphore(1)

    def app(self) -> Starlette:
        """Return the application, which does the runs while it is served."""
        session = "/sessions/{session}"
        image, run = session + "/images/{image}", session + "/runs/{run}"
        routes = (
            ("GET", "/", self.show_page),
            ("POST", "/sessions", self.open_session),
            ("GET", f"{session}/events", self.stream_events),
            ("POST", f"{session}/images", self.upload),
            ("GET", image, self.show_image),
            ("DELETE", image, self._action(self._store.remove_upload)),
            ("POST", f"{session}/runs", self.start),
            ("POST", f"{run}/stop", self._action(self._store.stop_run)),
            ("DELETE", run, self._action(self._store.remove_run)),
            ("GET", f"{run}/live.svg", self.show_live),
            ("GET", f"{run}/result.svg", self.show_result),
        )
        return Starlette(
            routes=[Route(path, answer, methods=[method]) for method, path, answer in routes],
            exception_handlers=dict.fromkeys((Refused, HTTPException, WarpsplatError, Exception), _error),
            lifespan=self._lifespan,
        )

    @contextlib.asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        worker = start_worker(self._store, self._machine)
        expiring = asyncio.create_task(self._expire())
        try:
            yield
        finally:
            expiring.cancel()
            self._store.close()
            await run_in_threadpool(worker.join, 10.0)  # for the current run

    async def _expire(self) -> None:
        while True:
            await asyncio.sleep(2.0)
            if self._store.expire():
                await run_in_threadpool(release_memory)

    async def show_page(self, _: Request) -> Response:
        """Send the page, whose head has a policy of its own."""
        return HTMLResponse(self._page, headers={"Content-Security-Policy": "frame-ancestors 'none'"})

    async def open_session(self, _: Request) -> Response:
        """Open a session for a page."""
        return JSONResponse({"session": self._store.open()}, 201)

    async def stream_events(self, request: Request) -> Response:
        """Send the states of a session until it is forgotten."""
        session = request.path_params["session"]
        self._store.state_of(session)  # raises before the stream begins
        return StreamingResponse(self._events(session), media_type="text/event-stream")

    async def _events(self, session: str) -> AsyncIterator[str]:
        """Yield server-sent events, each the whole state, so that a page may miss some."""
        version, last, silent = -1, "", 0.0
        with contextlib.suppress(Refused), self._store.attended(session):  # a forgotten page opens a new one
            while not self._store.closed:
                if self._store.version != version:
                    version = self._store.version
                    text = json.dumps(self._store.state_of(session), allow_nan=False)
                    if text != last:
                        last, silent = text, 0.0
                        yield f"data: {text}\n\n"
                if silent >= PULSE:
                    silent = 0.0
                    yield ": still here\n\n"
                await asyncio.sleep(EVENT_INTERVAL)
                silent += EVENT_INTERVAL

    async def upload(self, request: Request) -> Response:
        """Take an image: the body of the request is its file."""
        session = request.path_params["session"]
        self._store.state_of(session)
        name = plain_name(request.query_params.get("name", DEFAULT_NAME))
        limit = self._store.limits.upload
        length = request.headers.get("content-length", "")
        if not (length.isascii() and length.isdigit()):
            raise Refused(411, f"{name}: the request has no Content-Length")
        size = int(length)
        if size > limit:
            raise Refused(413, f"{name}: has {size / 1e6:.1f} MB; the limit is {limit / 1e6:g} MB")
        with self._store.reserved(size):
            try:
                data = await asyncio.wait_for(_body(request, limit, name), UPLOAD_TIME)
            except asyncio.TimeoutError:
                raise Refused(408, f"{name}: the upload took more than {UPLOAD_TIME:g} s") from None
            async with self._decoding:  # one at a time: pixels take many times the memory of their file
                upload = await run_in_threadpool(read_upload, data, name)
        return JSONResponse({"image": self._store.add_upload(session, upload)}, 201)

    async def show_image(self, request: Request) -> Response:
        """Send the picture of an image."""
        upload = self._store.upload(*_names(request))
        return Response(upload.picture, media_type=upload.media_type, headers=CACHED)

    def _action(self, act: Callable[[str, str], None]) -> Callable[[Request], Awaitable[Response]]:
        """Return an answer that calls a method of the store with the names in the address."""

        async def answer(request: Request) -> Response:
            act(*_names(request))
            await run_in_threadpool(release_memory)
            return Response(status_code=204)

        return answer

    async def start(self, request: Request) -> Response:
        """Queue a run of ``image`` with ``settings``."""
        session = request.path_params["session"]
        try:
            given = json.loads(await _body(request, 20_000, "the request"))
        except ValueError:  # includes a wrong encoding
            given = None
        if not isinstance(given, dict):
            raise Refused(400, "the request must be a JSON object")
        image = str(given.get("image"))
        upload = self._store.upload(session, image)
        values, settings = settings_of(given.get("settings", {}), self._machine.max_memory)
        path = f"./{upload.name}" if upload.name.startswith("-") else upload.name
        command = vectorize_command(settings, path, f"{os.path.splitext(path)[0]}.svg")
        return JSONResponse({"run": self._store.add_run(session, image, values, settings, command)}, 201)

    async def show_live(self, request: Request) -> Response:
        """Send the current shapes of a run."""
        run = self._store.run(*_names(request))
        return _svg(run.svg or run.live.picture, {})

    async def show_result(self, request: Request) -> Response:
        """Send the file of a run; ``download`` in the query makes the browser save it."""
        run = self._store.run(*_names(request))
        if "download" not in request.query_params:
            return _svg(run.svg, CACHED)
        name = quote(os.path.splitext(run.upload.name)[0], safe="")
        return _svg(run.svg, {"Content-Disposition": f"attachment; filename*=UTF-8''{name}.svg"})


def _names(request: Request) -> tuple[str, str]:
    """Return the session of a request, and its image or run."""
    session, name = request.path_params.values()
    return session, name


def _svg(data: bytes, headers: dict[str, str]) -> Response:
    if not data:
        raise Refused(404, "there is no picture of this run yet")
    return Response(data, media_type="image/svg+xml", headers=headers)


async def _body(request: Request, limit: int, name: str) -> bytes:
    """Return the body, refused as soon as it is too long: uvicorn discards what follows an answer."""
    parts, size = [], 0
    async for part in request.stream():
        size += len(part)
        if size > limit:
            raise Refused(413, f"{name}: more than {limit / 1e6:g} MB")
        parts.append(part)
    return b"".join(parts)


async def _error(_: Request, error: Exception) -> Response:
    """Return the answer to a request that failed."""
    if isinstance(error, Refused):
        return line(error.status, str(error), {"Retry-After": "5"} if error.status in {429, 503} else {})
    if isinstance(error, HTTPException):
        return line(error.status_code, "not found" if error.status_code == 404 else error.detail)
    if os.environ.get("WARPSPLAT_TRACEBACK"):
        traceback.print_exception(error)
    status = 415 if isinstance(error, ImageError) else 400 if isinstance(error, UsageError) else 500
    return line(status, explain(error)[0])
