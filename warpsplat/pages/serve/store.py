"""All that the server holds: in memory, bounded, and forgotten with the page."""

from __future__ import annotations

import contextlib
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from warpsplat.fit.settings import Settings
from warpsplat.pages.serve.live import LiveRun
from warpsplat.pages.serve.sessions import Limits, QueuedRun, Refused, Session
from warpsplat.pages.serve.uploads import Upload
from warpsplat.run.result import Result

Item = TypeVar("Item")


def _find(items: dict[str, Item], name: str, kind: str) -> Item:
    if name not in items:
        raise Refused(404, f"no such {kind}: only the latest are kept")
    return items[name]


class Store:
    """All sessions, and the queue of runs. Any thread may use it.

    Methods that take the name of a session, an image or a run raise ``Refused`` if it does not exist.
    """

    def __init__(self, limits: Limits, clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits
        self.version = 0
        """Grows with every change that a page shows."""
        self.closed = False
        self._clock = clock
        self._sessions: dict[str, Session] = {}
        self._queue: deque[QueuedRun] = deque()
        self._uploading = 0
        """Size of unfinished uploads [bytes]."""
        self._lock = threading.Condition(threading.RLock())

    # Sessions

    def open(self) -> str:
        """Return the name of a new session.

        Raises:
            Refused: there are too many.
        """
        with self._lock:
            if len(self._sessions) >= self.limits.sessions:
                raise Refused(503, f"{self.limits.sessions} pages are open; close some and try again later")
            name = secrets.token_urlsafe(16)
            self._sessions[name] = Session(name, self._clock())
            return name

    def _session(self, name: str) -> Session:
        if name not in self._sessions:
            raise Refused(404, "this page was closed for a while and its images are gone: reload it")
        return self._sessions[name]

    @contextlib.contextmanager
    def attended(self, name: str) -> Iterator[None]:
        """Count a reader of a session's events in the block."""
        with self._lock:
            session = self._session(name)
            session.readers += 1
        try:
            yield
        finally:
            with self._lock:
                session.readers -= 1
                session.seen = self._clock()

    def is_attended(self, name: str) -> bool:
        """Return whether anybody reads a session's events."""
        with self._lock:
            return name in self._sessions and self._sessions[name].readers > 0

    def expire(self) -> bool:
        """Forget sessions that nobody has read for a while; return whether there were any."""
        with self._lock:
            before = self._clock() - self.limits.grace
            expired = [s for s in self._sessions.values() if s.readers <= 0 and s.seen <= before]
            for session in expired:
                self._forget(session, session.runs.values())
                del self._sessions[session.id]
            return bool(expired)

    def state_of(self, name: str) -> dict[str, Any]:
        """Return the state of a session for JSON."""
        with self._lock:
            session = self._session(name)
            busy = any(run.state == "running" for run in self._all_runs())
            return session.as_dict({run: place + busy for place, run in enumerate(self._queue)})

    # Images

    @contextlib.contextmanager
    def reserved(self, size: int) -> Iterator[None]:
        """Reserve memory for an upload of ``size`` bytes in the block.

        Raises:
            Refused: there is none.
        """
        with self._lock:
            self._make_room(size)
            self._uploading += size
        try:
            yield
        finally:
            with self._lock:
                self._uploading -= size

    def add_upload(self, name: str, upload: Upload) -> str:
        """Hold an image, and return its name in the session.

        Raises:
            Refused: there is no memory for it.
        """
        with self._lock:
            session = self._session(name)
            self._make_room(upload.size)
            image = secrets.token_urlsafe(8)
            session.uploads[image] = upload
            self._changed()
            return image

    def upload(self, name: str, image: str) -> Upload:
        """Return an image."""
        with self._lock:
            return _find(self._session(name).uploads, image, "image")

    def remove_upload(self, name: str, image: str) -> None:
        """Forget an image and its runs."""
        with self._lock:
            self.upload(name, image)
            self._drop_upload(self._session(name), image)

    # Runs

    def add_run(self, name: str, image: str, values: dict[str, Any], settings: Settings, command: str) -> str:
        """Queue a run, and return its name.

        Raises:
            Refused: the queue is full.
        """
        with self._lock:
            session, upload = self._session(name), self.upload(name, image)
            if len(self._queue) >= self.limits.waiting:
                raise Refused(429, f"{len(self._queue)} runs are waiting: try again when one is done")
            while sum(1 for _ in self._all_runs()) >= self.limits.runs and self._drop_oldest_run():
                pass
            live = LiveRun(lambda: self.is_attended(name), self._changed)
            session.runs_started += 1
            number = session.runs_started
            run = QueuedRun(number, image, upload, values, settings, command, live=live)
            session.runs[run.id] = run
            self._queue.append(run)
            self._changed()
            return run.id

    def run(self, name: str, run: str) -> QueuedRun:
        """Return a run."""
        with self._lock:
            return _find(self._session(name).runs, run, "run")

    def stop_run(self, name: str, run: str) -> None:
        """End a run with its current shapes; one that waits leaves the queue."""
        with self._lock:
            found = self.run(name, run)
            if found.state == "waiting":
                self._forget(self._session(name), [found])
            found.stopping.set()
            self._changed()

    def remove_run(self, name: str, run: str) -> None:
        """End and forget a run."""
        with self._lock:
            self._forget(self._session(name), [self.run(name, run)])

    # The worker

    def next(self) -> QueuedRun | None:
        """Wait for the next run and return it; None once the store is closed."""
        with self._lock:
            self._lock.wait_for(lambda: self.closed or self._queue)
            if self.closed:
                return None
            run = self._queue.popleft()
            run.state = "running"
            run.live.begin()
            self._changed()
            return run

    def finish(self, run: QueuedRun, outcome: Result | str) -> None:
        """Take the result or the error of a run; the oldest results go if there are too many."""
        with self._lock:
            run.finish(outcome)
            while self._result_bytes() > self.limits.results and self._drop_oldest_run(but=run):
                pass
            self._changed()

    def close(self) -> None:
        """Forget everything, ask the current run to stop, and end the streams of events."""
        with self._lock:
            self.closed = True
            for session in self._sessions.values():
                self._forget(session, session.runs.values())
            self._sessions.clear()
            self._changed()

    # Capacity

    def _changed(self) -> None:
        with self._lock:
            self.version += 1
            self._lock.notify_all()

    def _all_runs(self) -> Iterator[QueuedRun]:
        for session in self._sessions.values():
            yield from session.runs.values()

    def _image_bytes(self) -> int:
        return sum(u.size for session in self._sessions.values() for u in session.uploads.values())

    def _result_bytes(self) -> int:
        return sum(len(run.svg) for run in self._all_runs())

    def _make_room(self, size: int) -> None:
        """Drop the oldest images without unfinished runs until ``size`` bytes are free."""
        capacity = self.limits.image_capacity - self._uploading - size
        idle = [
            (session, image)
            for session in self._sessions.values()
            for image in session.uploads
            if all(run.is_over for run in session.runs_of(image))
        ]
        for session, image in idle:
            if self._image_bytes() <= capacity:
                return
            self._drop_upload(session, image)
        if self._image_bytes() > capacity:
            held = f"{self.limits.image_capacity / 1e6:.0f} MB of images are in use"
            raise Refused(503, f"{held}: try again when a run is done")

    def _drop_upload(self, session: Session, image: str) -> None:
        self._forget(session, session.runs_of(image))
        del session.uploads[image]
        self._changed()

    def _drop_oldest_run(self, but: QueuedRun | None = None) -> bool:
        """Forget the oldest run that is over; return whether there was one."""
        for session in self._sessions.values():
            for run in session.runs.values():
                if run.is_over and run is not but:
                    self._forget(session, [run])
                    return True
        return False

    def _forget(self, session: Session, runs: Iterable[QueuedRun]) -> None:
        for run in list(runs):
            run.stopping.set()
            if run in self._queue:
                self._queue.remove(run)
            session.runs.pop(run.id, None)
        self._changed()
