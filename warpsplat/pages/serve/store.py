"""What pages gave and what was made of it: in memory, bounded, and forgotten with the page."""

from __future__ import annotations

import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from warpsplat.fit.settings import Settings
from warpsplat.pages.serve.limits import Limits, Refused
from warpsplat.pages.serve.live import Live
from warpsplat.pages.serve.pictures import Picture
from warpsplat.pages.serve.runs import ServedRun
from warpsplat.pages.serve.session import Session
from warpsplat.run.result import Result

Thing = TypeVar("Thing")


def _held(things: dict[str, Thing], name: str, what: str) -> Thing:
    """One of what a session has.

    Raises:
        Refused: there is none of that name.
    """
    if name not in things:
        raise Refused(404, f"no such {what}: only the latest are held")
    return things[name]


class Store:
    """All sessions, and the queue of runs. Any thread may use it."""

    def __init__(self, limits: Limits | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits or Limits()
        self.version = 0
        """Grows with everything that a page may want to be told."""
        self.closed = False
        self._clock = clock
        self._sessions: dict[str, Session] = {}
        self._queue: deque[ServedRun] = deque()
        self._coming = 0
        """Of uploads that are on their way [bytes]."""
        self._lock = threading.Condition(threading.RLock())

    # Sessions

    def open(self) -> str:
        """A new session's name.

        Raises:
            Refused: there are too many.
        """
        with self._lock:
            if len(self._sessions) >= self.limits.sessions:
                raise Refused(
                    503, f"{self.limits.sessions} pages are open; close some and try again in a while"
                )
            name = secrets.token_urlsafe(16)
            self._sessions[name] = Session(name, self._clock())
            return name

    def _session(self, name: str) -> Session:
        if name not in self._sessions:
            raise Refused(404, "this page was closed for a while and its images are gone: load it anew")
        return self._sessions[name]

    def attend(self, name: str) -> None:
        """Note that somebody reads a session's events."""
        with self._lock:
            self._session(name).readers += 1

    def leave(self, name: str) -> None:
        """Note that somebody does so no more."""
        with self._lock:
            if session := self._sessions.get(name):
                session.readers -= 1
                session.seen = self._clock()

    def is_attended(self, name: str) -> bool:
        """Whether anybody reads a session's events."""
        with self._lock:
            return name in self._sessions and self._sessions[name].readers > 0

    def expire(self) -> bool:
        """Forget sessions that nobody has read for a while; whether there were any."""
        with self._lock:
            before = self._clock() - self.limits.grace
            gone = [s for s in self._sessions.values() if s.readers <= 0 and s.seen <= before]
            for session in gone:
                self._forget(session, list(session.runs.values()))
                del self._sessions[session.id]
            return bool(gone)

    def told(self, name: str) -> dict[str, Any]:
        """A session as its page is told of it, for JSON."""
        with self._lock:
            session = self._session(name)
            busy = any(run.state == "running" for run in self._all_runs())
            return session.as_dict({run: place + busy for place, run in enumerate(self._queue)})

    # Images

    def reserve(self, size: int) -> None:
        """Make room for an upload; to be given back by ``unreserve``.

        Raises:
            Refused: there is none.
        """
        with self._lock:
            self._make_room(size)
            self._coming += size

    def unreserve(self, size: int) -> None:
        """Give up the room for an upload, which is over."""
        with self._lock:
            self._coming -= size

    def add_picture(self, name: str, picture: Picture) -> str:
        """Hold an image; the name by which the session knows it.

        Raises:
            Refused: there is no room for it, or no such session.
        """
        with self._lock:
            session = self._session(name)
            self._make_room(picture.size)
            image = secrets.token_urlsafe(8)
            session.pictures[image] = picture
            self._changed()
            return image

    def picture(self, name: str, image: str) -> Picture:
        """An image.

        Raises:
            Refused: there is none of that name.
        """
        with self._lock:
            return _held(self._session(name).pictures, image, "image")

    def remove_picture(self, name: str, image: str) -> None:
        """Forget an image and its runs.

        Raises:
            Refused: there is none of that name.
        """
        with self._lock:
            self.picture(name, image)
            self._drop_picture(self._session(name), image)

    # Runs

    def add_run(self, name: str, image: str, values: dict[str, Any], settings: Settings, command: str) -> str:
        """Put a run at the end of the queue; its name.

        Raises:
            Refused: too many wait, or there is no such image.
        """
        with self._lock:
            session, picture = self._session(name), self.picture(name, image)
            if len(self._queue) >= self.limits.waiting:
                raise Refused(429, f"{len(self._queue)} runs wait already: try again when one is done")
            while sum(1 for _ in self._all_runs()) >= self.limits.runs and self._drop_oldest_run():
                pass
            live = Live(lambda: self.is_attended(name), self._changed)
            session.begun += 1
            run = ServedRun(
                secrets.token_urlsafe(8), session.begun, image, picture, values, settings, command, live=live
            )
            session.runs[run.id] = run
            self._queue.append(run)
            self._changed()
            return run.id

    def run(self, name: str, run: str) -> ServedRun:
        """A run.

        Raises:
            Refused: there is none of that name.
        """
        with self._lock:
            return _held(self._session(name).runs, run, "run")

    def stop_run(self, name: str, run: str) -> None:
        """Have a run end with the shapes as they are; one that waits leaves the queue.

        Raises:
            Refused: there is none of that name.
        """
        with self._lock:
            found = self.run(name, run)
            if found.state == "waiting":
                self._forget(self._session(name), [found])
            found.stopping.set()
            self._changed()

    def remove_run(self, name: str, run: str) -> None:
        """Forget a run, which ends.

        Raises:
            Refused: there is none of that name.
        """
        with self._lock:
            self._forget(self._session(name), [self.run(name, run)])

    # The worker

    def next(self) -> ServedRun | None:
        """The run whose turn it is, waited for; None once the store is closed."""
        with self._lock:
            self._lock.wait_for(lambda: self.closed or self._queue)
            if self.closed:
                return None
            run = self._queue.popleft()
            run.state = "running"
            run.live.begin()
            self._changed()
            return run

    def finish(self, run: ServedRun, outcome: Result | str) -> None:
        """Take what a run made, or why it failed; the oldest results go where there is no room for it."""
        with self._lock:
            if isinstance(outcome, str):
                run.fail(outcome)
            else:
                run.finish(outcome)
            while self._result_bytes() > self.limits.results and self._drop_oldest_run(but=run):
                pass
            self._changed()

    def close(self) -> None:
        """End: no run begins, the one that goes on is asked to stop, streams of events end."""
        with self._lock:
            self.closed = True
            for session in self._sessions.values():
                self._forget(session, list(session.runs.values()))
            self._sessions.clear()
            self._changed()

    # Room

    def held(self) -> dict[str, int]:
        """How much of everything there is; images and results in bytes."""
        with self._lock:
            return {
                "sessions": len(self._sessions),
                "runs": sum(1 for _ in self._all_runs()),
                "waiting": len(self._queue),
                "images": self._image_bytes(),
                "results": self._result_bytes(),
                "coming": self._coming,
            }

    def _changed(self) -> None:
        with self._lock:
            self.version += 1
            self._lock.notify_all()

    def _all_runs(self) -> Iterator[ServedRun]:
        for session in self._sessions.values():
            yield from session.runs.values()

    def _image_bytes(self) -> int:
        return sum(p.size for session in self._sessions.values() for p in session.pictures.values())

    def _result_bytes(self) -> int:
        return sum(len(run.svg) for run in self._all_runs())

    def _make_room(self, size: int) -> None:
        """For an image: the oldest ones without a run that is to be done go."""
        room = self.limits.room - self._coming - size
        while self._image_bytes() > room:
            for session in self._sessions.values():
                idle = (i for i in session.pictures if all(run.is_over for run in session.runs_of(i)))
                if oldest := next(idle, None):
                    self._drop_picture(session, oldest)
                    break
            else:
                break
        if self._image_bytes() > room:
            held = f"{self.limits.room / 1e6:.0f} MB of images are held and in work"
            raise Refused(503, f"{held}: try again when a run is done")

    def _drop_picture(self, session: Session, image: str) -> None:
        self._forget(session, session.runs_of(image))
        del session.pictures[image]
        self._changed()

    def _drop_oldest_run(self, but: ServedRun | None = None) -> bool:
        """Forget the oldest run that is over; whether there was one."""
        for session in self._sessions.values():
            for run in session.runs.values():
                if run.is_over and run is not but:
                    self._forget(session, [run])
                    return True
        return False

    def _forget(self, session: Session, runs: list[ServedRun]) -> None:
        for run in runs:
            run.stopping.set()
            if run in self._queue:
                self._queue.remove(run)
            session.runs.pop(run.id, None)
        self._changed()
