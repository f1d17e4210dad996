"""What is held, for how long, and what gives way to what."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from warpsplat.fit.settings import Settings
from warpsplat.pages.serve.limits import Limits, Refused
from warpsplat.pages.serve.pictures import Picture, plain_name
from warpsplat.pages.serve.runs import ServedRun
from warpsplat.pages.serve.store import Store


@dataclass
class Clock:
    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Made:
    """What a store takes of a result."""

    svg: str = "<svg/>"
    stopped: bool = False
    figures: dict[str, Any] = field(default_factory=lambda: {"psnr": 20.0})

    def as_dict(self) -> dict[str, Any]:
        return self.figures


def picture(size: int = 100) -> Picture:
    return Picture("photo.png", bytes(size), 8, 8, b"", "image/png", transparent=False)


def add(store: Store, session: str, image: str) -> str:
    return store.add_run(session, image, {}, Settings(), "warpsplat")


def do(store: Store, svg: str = "<svg/>") -> ServedRun:
    """The run whose turn it is, done."""
    run = store.next()
    assert run
    store.finish(run, Made(svg))
    return run


def test_a_page_that_is_closed_is_forgotten_after_a_while() -> None:
    clock = Clock()
    store = Store(Limits(grace=10), clock)
    read, unread = store.open(), store.open()
    image = store.add_picture(unread, picture())
    add(store, unread, image)
    running = store.next()
    add(store, unread, image)
    store.attend(read)
    clock.now = 9
    assert not store.expire() and store.is_attended(read) and not store.is_attended(unread)
    clock.now = 10
    assert store.expire() and not store.expire()
    assert running and running.stopping.is_set()
    store.finish(running, Made())  # it ends later, and nobody wants it
    assert store.held() == {"sessions": 1, "runs": 0, "waiting": 0, "images": 0, "results": 0, "coming": 0}
    with pytest.raises(Refused, match="load it anew") as refused:
        store.told(unread)
    assert refused.value.status == 404
    store.leave(read)
    clock.now = 19
    assert not store.expire()
    clock.now = 20
    assert store.expire() and not store.held()["sessions"]
    store.leave(read)  # whose stream ends last


def test_images_give_way_to_new_ones_but_not_while_they_are_needed() -> None:
    store = Store(Limits(upload=100, images=250))
    session = store.open()
    first, second = (store.add_picture(session, picture()) for _ in range(2))
    add(store, session, first)
    store.reserve(100)
    assert [image["id"] for image in store.told(session)["images"]] == [first]
    add(store, session, store.add_picture(session, picture(50)))
    with pytest.raises(Refused, match="try again when a run is done") as refused:
        store.reserve(100)
    assert refused.value.status == 503
    store.unreserve(100)
    store.reserve(100)
    with pytest.raises(Refused):
        store.picture(session, second)
    assert store.held()["images"] == 150 and store.held()["coming"] == 100


def test_two_of_the_largest_images_fit() -> None:
    assert Limits(upload=10**9).room == 2 * 10**9


def test_the_oldest_results_go_first() -> None:
    store = Store(Limits(results=25, runs=3))
    session = store.open()
    image = store.add_picture(session, picture())
    for _ in range(3):
        add(store, session, image)
    runs = [do(store, "x" * 10) for _ in range(3)]
    assert list(store._sessions[session].runs) == [runs[1].id, runs[2].id]
    assert store.held()["results"] == 20
    large = add(store, session, image)
    do(store, "x" * 40)  # what is larger than all that may be held is held alone
    assert [run["id"] for run in store.told(session)["runs"]] == [large]
    for _ in range(4):
        add(store, session, image)
    assert store.held()["runs"] == 4 and large not in store._sessions[session].runs


def test_sessions_are_limited() -> None:
    store = Store(Limits(sessions=1))
    store.open()
    with pytest.raises(Refused, match="1 pages are open"):
        store.open()


def test_an_image_goes_with_its_runs() -> None:
    store = Store()
    session = store.open()
    one, other = (store.add_picture(session, picture()) for _ in range(2))
    add(store, session, one)
    running = store.next()
    add(store, session, one)
    kept = add(store, session, other)
    store.remove_picture(session, one)
    assert running and running.stopping.is_set()
    assert [run["id"] for run in store.told(session)["runs"]] == [kept]
    assert store.told(session)["runs"][0]["place"] == 0
    store.remove_run(session, kept)
    assert store.held()["waiting"] == store.held()["runs"] == 0
    for missing in (lambda: store.run(session, kept), lambda: store.remove_picture(session, one)):
        with pytest.raises(Refused):
            missing()


def test_the_end() -> None:
    store = Store()
    session = store.open()
    image = store.add_picture(session, picture())
    add(store, session, image)
    running = store.next()
    add(store, session, image)
    version = store.version
    store.close()
    assert store.next() is None and running and running.stopping.is_set() and store.version > version
    assert not any(store.held().values())


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("photo.jpg", "photo.jpg"),
        ("../../etc/passwd", "passwd"),
        ("C:\\fakepath\\a b.png", "a b.png"),
        ("a\x1b[31m\n.png", "a\\x1b[31m\\n.png"),
        ("..", "image"),
        ("", "image"),
        ("x" * 300 + ".jpeg", "x" * 90 + ".jpeg"),
        ("x" * 300, "x" * 100),
    ],
)
def test_names_of_images(given: str, name: str) -> None:
    assert plain_name(given) == name
