"""Answer the page's requests. Errors are one line of plain text with their status.

Everything is found by its name in the store: no part of an address is ever a path of the file system.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import traceback
from collections.abc import AsyncIterator
from typing import Any
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from warpsplat.errors import ImageError, UsageError, WarpsplatError, explain
from warpsplat.native import release_memory
from warpsplat.pages.serve.events import events
from warpsplat.pages.serve.form import settings_of
from warpsplat.pages.serve.guard import line
from warpsplat.pages.serve.limits import Refused
from warpsplat.pages.serve.pictures import DEFAULT_NAME, Picture, plain_name, read_picture
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.worker import Machine, Worker
from warpsplat.run.command_line import vectorize_command

MAX_REQUEST = 20_000
"""Maximum size of bodies that are not images [bytes]."""

UPLOAD_TIME = 300.0
"""Maximum time of an upload [s], for which space is reserved."""

TIDY_INTERVAL = 2.0
"""Time between two searches for closed pages [s]."""

LAST_WAIT = 10.0
"""Time for the current run to end with the server [s]."""


class Service:
    """Handlers of a page's requests."""

    def __init__(self, store: Store, machine: Machine, page: str, max_memory: str | None = None) -> None:
        """Do nothing yet.

        Args:
            store: what is held.
            machine: where runs are computed.
            page: as HTML.
            max_memory: of each run, as the command line has it.
        """
        self._store, self._machine, self._page, self._max_memory = store, machine, page, max_memory
        self._reading = asyncio.Semaphore(1)

    def app(self) -> Starlette:
        """Return the application, which does the runs while it lives."""
        session = "/sessions/{session}"
        image, run = session + "/images/{image}", session + "/runs/{run}"
        routes = (
            ("GET", "/", self.show_page),
            ("POST", "/sessions", self.open_session),
            ("GET", f"{session}/events", self.tell),
            ("POST", f"{session}/images", self.upload),
            ("GET", image, self.show_image),
            ("DELETE", image, self.remove_image),
            ("POST", f"{session}/runs", self.start),
            ("POST", f"{run}/stop", self.stop),
            ("DELETE", run, self.remove_run),
            ("GET", f"{run}/live.svg", self.show_live),
            ("GET", f"{run}/result.svg", self.show_result),
        )
        return Starlette(
            routes=[Route(path, answer, methods=[method]) for method, path, answer in routes],
            exception_handlers={
                Refused: _refused,
                HTTPException: _unknown,
                WarpsplatError: _failed,
                Exception: _failed,
            },
            lifespan=self._living,
        )

    @contextlib.asynccontextmanager
    async def _living(self, _: Starlette) -> AsyncIterator[None]:
        worker = Worker(self._store, self._machine)
        worker.start()
        tidying = asyncio.create_task(self._tidy())
        try:
            yield
        finally:
            tidying.cancel()
            self._store.close()
            await run_in_threadpool(worker.join, LAST_WAIT)

    async def _tidy(self) -> None:
        while True:
            await asyncio.sleep(TIDY_INTERVAL)
            if self._store.expire():
                await run_in_threadpool(release_memory)

    async def show_page(self, _: Request) -> Response:
        """Return the page. Its own head says what it may load and run."""
        return HTMLResponse(self._page, headers={"Content-Security-Policy": "frame-ancestors 'none'"})

    async def open_session(self, _: Request) -> Response:
        """Open a session for a page."""
        return JSONResponse({"session": self._store.open()}, 201)

    async def tell(self, request: Request) -> Response:
        """Stream the states of a session."""
        session = request.path_params["session"]
        self._store.state_of(session)  # refused before the stream begins
        return StreamingResponse(events(self._store, session), media_type="text/event-stream")

    async def upload(self, request: Request) -> Response:
        """Receive an image as the body of the request."""
        session = request.path_params["session"]
        self._store.state_of(session)
        name = plain_name(request.query_params.get("name", DEFAULT_NAME))
        limit = self._store.limits.upload
        size = _length(request)
        if size is None or size > limit:
            what = "says no size" if size is None else f"has {size / 1e6:.1f} MB"
            raise Refused(
                411 if size is None else 413, f"{name}: {what}; at most {limit / 1e6:g} MB are taken"
            )
        self._store.reserve(size)
        try:
            try:
                data = await asyncio.wait_for(_body(request, limit, name), UPLOAD_TIME)
            except asyncio.TimeoutError:
                raise Refused(408, f"{name}: did not come within {UPLOAD_TIME:g} s") from None
            async with self._reading:  # one at a time: pixels take many times the memory of their file
                picture = await run_in_threadpool(read_picture, data, name)
        finally:
            self._store.unreserve(size)
        return JSONResponse({"image": self._store.add_picture(session, picture)}, 201)

    async def show_image(self, request: Request) -> Response:
        """Return the displayed picture of an image."""
        picture = self._picture(request)
        return Response(picture.shown, media_type=picture.media, headers=KEPT)

    async def remove_image(self, request: Request) -> Response:
        """Delete an image and its runs."""
        self._store.remove_picture(request.path_params["session"], request.path_params["image"])
        await run_in_threadpool(release_memory)
        return Response(status_code=204)

    async def start(self, request: Request) -> Response:
        """Queue a run of ``image`` with ``settings``."""
        session = request.path_params["session"]
        given = _parsed(await _body(request, MAX_REQUEST, "the request"))
        image = given.get("image")
        picture = self._store.picture(session, image if isinstance(image, str) else "")
        values, settings = settings_of(given.get("settings", {}), self._max_memory)
        path = f"./{picture.name}" if picture.name.startswith("-") else picture.name
        command = vectorize_command(settings, path, f"{_stem(path)}.svg")
        run = self._store.add_run(session, str(image), values, settings, command)
        return JSONResponse({"run": run}, 201)

    async def stop(self, request: Request) -> Response:
        """Stop a run, with the shapes so far."""
        self._store.stop_run(request.path_params["session"], request.path_params["run"])
        return Response(status_code=204)

    async def remove_run(self, request: Request) -> Response:
        """Delete a run."""
        self._store.remove_run(request.path_params["session"], request.path_params["run"])
        await run_in_threadpool(release_memory)
        return Response(status_code=204)

    async def show_live(self, request: Request) -> Response:
        """Return the current shapes of a run."""
        run = self._store.run(request.path_params["session"], request.path_params["run"])
        return _svg(run.svg or run.live.picture, {})

    async def show_result(self, request: Request) -> Response:
        """Return the file of a run; as an attachment with ``download``."""
        run = self._store.run(request.path_params["session"], request.path_params["run"])
        if "download" not in request.query_params:
            return _svg(run.svg, KEPT)
        name = quote(_stem(run.picture.name), safe="")
        disposition = f"attachment; filename*=UTF-8''{name}.svg"
        return _svg(run.svg, {"Content-Disposition": disposition})

    def _picture(self, request: Request) -> Picture:
        return self._store.picture(request.path_params["session"], request.path_params["image"])


KEPT = {"Cache-Control": "private, max-age=3600, immutable"}
"""Headers of immutable responses."""


def _stem(name: str) -> str:
    """Return the name of the SVG for an image's file."""
    stem, _, ending = name.rpartition(".")
    return stem if stem and "/" not in ending else name


def _svg(data: bytes, headers: dict[str, str]) -> Response:
    if not data:
        raise Refused(404, "there is no picture of this run yet")
    return Response(data, media_type="image/svg+xml", headers=headers)


def _length(request: Request) -> int | None:
    """Return the declared size of a body [bytes], or None."""
    given = request.headers.get("content-length", "")
    return int(given) if given.isascii() and given.isdigit() else None


async def _body(request: Request, limit: int, name: str) -> bytes:
    """Return the body; refuse it as soon as it is too long: uvicorn discards the rest."""
    parts, size = [], 0
    async for part in request.stream():
        size += len(part)
        if size > limit:
            raise Refused(413, f"{name}: more than {limit / 1e6:g} MB")
        parts.append(part)
    return b"".join(parts)


def _parsed(body: bytes) -> dict[str, Any]:
    try:
        given = json.loads(body)
    except ValueError:  # of the encoding as well
        given = None
    if not isinstance(given, dict):
        raise Refused(400, "the request must be an object of JSON")
    return given


async def _refused(_: Request, error: Exception) -> Response:
    assert isinstance(error, Refused)
    headers = [("Retry-After", "5")] if error.status in {429, 503} else []
    return line(error.status, str(error), headers)


async def _failed(_: Request, error: Exception) -> Response:
    """Answer errors of the library: unreadable images, conflicting settings, or faults."""
    if os.environ.get("WARPSPLAT_TRACEBACK"):
        traceback.print_exception(error)
    status = 415 if isinstance(error, ImageError) else 400 if isinstance(error, UsageError) else 500
    return line(status, explain(error)[0])


async def _unknown(_: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return line(error.status_code, "there is nothing here" if error.status_code == 404 else error.detail)
