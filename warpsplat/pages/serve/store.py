"""The images and runs that the server holds: in memory, bounded, and forgotten once the page is closed."""

from __future__ import annotations

import contextlib
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from warpsplat.pages.serve.live import LiveRun
from warpsplat.pages.serve.runs import Limits, Order, QueuedRun, Refused
from warpsplat.pages.serve.uploads import Upload
from warpsplat.run.result import Result

Item = TypeVar("Item")


def _find(items: dict[str, Item], name: str, kind: str) -> Item:
    if name not in items:
        raise Refused(404, f"no such {kind}: only the latest are kept")
    return items[name]


class Store:
    """The images, their runs, oldest first, and the queue of runs. Any thread may use it.

    Methods that take the name of an image or a run raise ``Refused`` if it does not exist.
    """

    def __init__(self, limits: Limits, clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits
        self.version = 0
        """Grows with every change that the page shows."""
        self.closed = False
        self._clock = clock
        self._uploads: dict[str, Upload] = {}
        self._runs: dict[str, QueuedRun] = {}
        self._queue: deque[QueuedRun] = deque()
        self._runs_started = 0
        self._readers = 0
        """Open streams of events: pages."""
        self._seen = clock()
        """Time at which the last page was closed [s]."""
        self._uploading = 0
        """Size of unfinished uploads [bytes]."""
        self._lock = threading.Condition(threading.RLock())

    # Pages

    @contextlib.contextmanager
    def attended(self) -> Iterator[None]:
        """Count a page in the block."""
        with self._lock:
            self._readers += 1
        try:
            yield
        finally:
            with self._lock:
                self._readers -= 1
                self._seen = self._clock()

    def is_attended(self) -> bool:
        """Return whether a page is open."""
        return self._readers > 0

    def expire(self) -> bool:
        """Forget everything if no page has been open for a while; return whether there was anything."""
        with self._lock:
            if self._readers or not self._uploads or self._clock() - self._seen < self.limits.grace:
                return False
            self._clear()
            return True

    def state(self) -> dict[str, Any]:
        """Return everything that a page shows, for JSON."""
        with self._lock:
            busy = any(run.state == "running" for run in self._runs.values())
            places = {run: place + busy for place, run in enumerate(self._queue)}
            return {
                "images": [{"id": name} | upload.as_dict() for name, upload in self._uploads.items()],
                "runs": [run.as_dict(places.get(run, 0)) for run in self._runs.values()],
            }

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

    def add_upload(self, upload: Upload) -> str:
        """Hold an image, and return its name.

        Raises:
            Refused: there is no memory for it.
        """
        with self._lock:
            self._make_room(upload.size)
            image = secrets.token_urlsafe(8)
            self._uploads[image] = upload
            self._changed()
            return image

    def upload(self, image: str) -> Upload:
        """Return an image."""
        with self._lock:
            return _find(self._uploads, image, "image")

    def remove_upload(self, image: str) -> None:
        """Forget an image and its runs."""
        with self._lock:
            self.upload(image)
            self._drop_upload(image)

    # Runs

    def add_run(self, image: str, order: Order) -> str:
        """Queue a run in place of one of this image that is not over, and return its name."""
        with self._lock:
            upload = self.upload(image)
            self._forget(run for run in self._runs_of(image) if not run.is_over)
            while len(self._runs) >= self.limits.runs and self._drop_oldest_run():
                pass
            self._runs_started += 1
            live = LiveRun(self.is_attended, self._changed)
            run = QueuedRun(self._runs_started, image, upload, order, live=live)
            self._runs[run.id] = run
            self._queue.append(run)
            self._changed()
            return run.id

    def run(self, run: str) -> QueuedRun:
        """Return a run."""
        with self._lock:
            return _find(self._runs, run, "run")

    def find_run(self, run: str) -> QueuedRun | None:
        """Return a run; None if there is none any more."""
        with self._lock:
            return self._runs.get(run)

    def stop_run(self, run: str) -> None:
        """End a run with its current shapes; one that waits leaves the queue."""
        with self._lock:
            found = self.run(run)
            if found.state == "waiting":
                self._forget([found])
            found.stopping.set()
            self._changed()

    def remove_run(self, run: str) -> None:
        """End and forget a run."""
        with self._lock:
            self._forget([self.run(run)])

    # The worker

    def next(self) -> QueuedRun | None:
        """Wait for the next run and return it; None once the store is closed."""
        with self._lock:
            self._lock.wait_for(lambda: self.closed or self._queue)
            if self.closed:
                return None
            run = self._queue.popleft()
            run.state = "running"
            self._changed()
            return run

    def is_wanted(self, run: QueuedRun) -> bool:
        """Return whether a run has not been forgotten."""
        return run.id in self._runs

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
            self._clear()

    # Capacity

    def _changed(self) -> None:
        with self._lock:
            self.version += 1
            self._lock.notify_all()

    def _clear(self) -> None:
        self._forget(self._runs.values())
        self._uploads.clear()
        self._changed()

    def _runs_of(self, image: str) -> list[QueuedRun]:
        return [run for run in self._runs.values() if run.image == image]

    def _image_bytes(self) -> int:
        return sum(upload.size for upload in self._uploads.values())

    def _result_bytes(self) -> int:
        return sum(len(run.svg) for run in self._runs.values())

    def _make_room(self, size: int) -> None:
        """Drop the oldest images without unfinished runs until ``size`` bytes are free."""
        capacity = self.limits.image_capacity - self._uploading - size
        for image in [each for each in self._uploads if all(run.is_over for run in self._runs_of(each))]:
            if self._image_bytes() <= capacity:
                return
            self._drop_upload(image)
        if self._image_bytes() > capacity:
            held = f"{self.limits.image_capacity / 1e6:.0f} MB of images are in use"
            raise Refused(503, f"{held}: try again when a run is done")

    def _drop_upload(self, image: str) -> None:
        self._forget(self._runs_of(image))
        del self._uploads[image]
        self._changed()

    def _drop_oldest_run(self, but: QueuedRun | None = None) -> bool:
        """Forget the oldest run that is over; return whether there was one."""
        for run in self._runs.values():
            if run.is_over and run is not but:
                self._forget([run])
                return True
        return False

    def _forget(self, runs: Iterable[QueuedRun]) -> None:
        for run in list(runs):
            run.stopping.set()
            if run in self._queue:
                self._queue.remove(run)
            self._runs.pop(run.id, None)
        self._changed()
