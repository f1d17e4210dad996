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
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from warpsplat.errors import ImageError, UsageError, WarpsplatError, explain
from warpsplat.native import release_memory
from warpsplat.pages.environment import page
from warpsplat.pages.report import report
from warpsplat.pages.serve.form import CONTROLS, form_data, order_of, presets
from warpsplat.pages.serve.guard import line
from warpsplat.pages.serve.runs import QueuedRun, Refused
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.uploads import DEFAULT_NAME, plain_name, read_upload
from warpsplat.pages.serve.worker import Machine, start_worker
from warpsplat.run.formats import missing, named_bytes

UPLOAD_TIME = 300.0
"""Longest upload [s]: others wait for the memory that is reserved for it."""

EVENT_INTERVAL = 0.15
"""Shortest time between two events [s]."""

PULSE = 5.0
"""Longest time between two events [s]: only writing reveals that a page was closed."""

FORMATS = ("svg", "png", "pdf", "dxf", "eps")
"""Formats in which results are saved."""

CACHED = {"Cache-Control": "private, max-age=3600, immutable"}
"""Headers of what never changes."""


class Service:
    """The answers to a page's requests."""

    def __init__(self, store: Store, machine: Machine) -> None:
        """Start nothing yet."""
        self._store, self._machine = store, machine
        self._page = page(
            "serve.html.j2",
            assets=("viewer.css", "serve.css", "viewer.js", "serve.js"),
            connects=True,
            controls=CONTROLS,
            presets=presets(),
            formats={name: missing(Path(f"x.{name}")) for name in FORMATS},
            data={"upload": store.limits.upload, **form_data()},
        )
        self._decoding = asyncio.Semaphore(1)

    def app(self) -> Starlette:
        """Return the application, which does the runs while it is served."""
        image, run = "/images/{image}", "/runs/{run}"
        routes = (
            ("GET", "/", self.show_page),
            ("GET", "/events", self.stream_events),
            ("POST", "/images", self.upload),
            ("GET", image, self.show_image),
            ("DELETE", image, self._action(self._store.remove_upload)),
            ("POST", "/runs", self.start),
            ("POST", f"{run}/stop", self._action(self._store.stop_run)),
            ("DELETE", run, self._action(self._store.remove_run)),
            ("GET", f"{run}/live.svg", self.show_live),
            ("GET", f"{run}/report.html", self.show_report),
            ("GET", f"{run}/result.{{ending}}", self.show_result),
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

    async def stream_events(self, _: Request) -> Response:
        """Send the state whenever it changes."""
        return StreamingResponse(self._events(), media_type="text/event-stream")

    async def _events(self) -> AsyncIterator[str]:
        """Yield server-sent events, each the whole state, so that a page may miss some."""
        version, last, silent = -1, "", 0.0
        with self._store.attended():
            while not self._store.closed:
                if self._store.version != version:
                    version = self._store.version
                    text = json.dumps(self._store.state(), allow_nan=False)
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
        return JSONResponse({"image": self._store.add_upload(upload)}, 201)

    async def show_image(self, request: Request) -> Response:
        """Send the picture of an image."""
        upload = self._store.upload(request.path_params["image"])
        return Response(upload.picture, media_type=upload.media_type, headers=CACHED)

    def _action(self, act: Callable[[str], None]) -> Callable[[Request], Awaitable[Response]]:
        """Return an answer that calls a method of the store with the name in the address."""

        async def answer(request: Request) -> Response:
            act(*request.path_params.values())
            await run_in_threadpool(release_memory)
            return Response(status_code=204)

        return answer

    async def start(self, request: Request) -> Response:
        """Queue a run of ``image`` with ``settings``."""
        try:
            given = json.loads(await _body(request, 20_000, "the request"))
        except ValueError:  # includes a wrong encoding
            given = None
        if not isinstance(given, dict):
            raise Refused(400, "the request must be a JSON object")
        image = str(given.get("image"))
        name = self._store.upload(image).name
        order = order_of(given.get("settings", {}), self._machine.max_memory, name)
        return JSONResponse({"run": self._store.add_run(image, order)}, 201)

    def _run(self, request: Request) -> QueuedRun:
        return self._store.run(request.path_params["run"])

    async def show_live(self, request: Request) -> Response:
        """Send the current shapes of a run; nothing if it has none, or was replaced meanwhile."""
        run = self._store.find_run(request.path_params["run"])
        data = run.svg or run.live.picture if run else b""
        return _svg(data, {}) if data else Response(status_code=204)

    async def show_result(self, request: Request) -> Response:
        """Send the file of a run, in one of ``FORMATS``."""
        run, ending = self._run(request), request.path_params["ending"]
        if ending == "svg":
            return _svg(run.svg, CACHED)
        if ending not in FORMATS or not run.svg:
            raise HTTPException(404)
        path = Path(run.upload.name).with_suffix(f".{ending}")
        dxf = run.order.settings.dxf
        data = await run_in_threadpool(named_bytes, path, run.svg.decode(), dxf=dxf)
        return Response(data, media_type="application/octet-stream")

    async def show_report(self, request: Request) -> Response:
        """Send the report on a run, which is computed now."""
        run, machine = self._run(request), self._machine
        if run.result is None:
            raise HTTPException(404)
        text = await run_in_threadpool(
            report,
            run.result,
            run.upload.data,
            command=run.order.command,
            name=run.upload.name,
            device=machine.device,
            threads=machine.threads,
        )
        return Response(text, media_type="application/octet-stream")  # to be saved


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
