"""What the server holds, for how long, and what is dropped first."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from tests.files.test_formats import ENDLESS
from tests.pages.serve.helpers import held
from warpsplat.errors import ImageError
from warpsplat.fit.settings import Settings
from warpsplat.pages.serve.sessions import Limits, QueuedRun, Refused
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.uploads import Upload, plain_name, read_upload


@dataclass
class Clock:
    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Made:
    """The parts of a result that a store uses."""

    svg: str = "<svg/>"
    stopped: bool = False
    figures: dict[str, Any] = field(default_factory=lambda: {"psnr": 20.0})

    def as_dict(self) -> dict[str, Any]:
        return self.figures


def upload(size: int = 100) -> Upload:
    return Upload("photo.png", bytes(size), 8, 8, b"", "image/png", transparent=False)


def add(store: Store, session: str, image: str) -> str:
    return store.add_run(session, image, {}, Settings(), "warpsplat")


def begin(store: Store) -> QueuedRun:
    run = store.next()
    assert run
    return run


def do(store: Store, svg: str = "<svg/>") -> QueuedRun:
    """Do the next run."""
    run = begin(store)
    store.finish(run, Made(svg))
    return run


def test_a_closed_page_is_forgotten_after_a_while() -> None:
    clock = Clock()
    store = Store(Limits(grace=10), clock)
    read, unread = store.open(), store.open()
    image = store.add_upload(unread, upload())
    add(store, unread, image)
    running = begin(store)
    add(store, unread, image)
    with store.attended(read):
        clock.now = 9
        assert not store.expire() and store.is_attended(read) and not store.is_attended(unread)
        clock.now = 10
        assert store.expire() and not store.expire()
        assert running.stopping.is_set()
        store.finish(running, Made())  # it ends later, and nobody wants it
        nothing = dict.fromkeys(held(store), 0)
        assert held(store) == {**nothing, "sessions": 1}
        with pytest.raises(Refused, match="reload it") as refused:
            store.state_of(unread)
        assert refused.value.status == 404
    clock.now = 19
    assert not store.expire()
    clock.now = 20
    assert store.expire() and not held(store)["sessions"]


def test_images_give_way_to_new_ones_but_not_while_they_are_needed() -> None:
    store = Store(Limits(upload=100, images=250))
    session = store.open()
    first, second = (store.add_upload(session, upload()) for _ in range(2))
    add(store, session, first)
    with store.reserved(100):
        assert [image["id"] for image in store.state_of(session)["images"]] == [first]
        add(store, session, store.add_upload(session, upload(50)))
        with pytest.raises(Refused, match="try again when a run is done") as refused, store.reserved(100):
            pass
        assert refused.value.status == 503
    with store.reserved(100):
        assert held(store)["images"] == 150 and held(store)["uploading"] == 100
    with pytest.raises(Refused):
        store.upload(session, second)


def test_two_of_the_largest_images_fit() -> None:
    assert Limits(upload=10**9).image_capacity == 2 * 10**9


def test_the_oldest_results_go_first() -> None:
    store = Store(Limits(results=25, runs=3))
    session = store.open()

    def kept() -> list[str]:
        return [run["id"] for run in store.state_of(session)["runs"]]

    image = store.add_upload(session, upload())
    for _ in range(3):
        add(store, session, image)
    runs = [do(store, "x" * 10) for _ in range(3)]
    assert kept() == [runs[1].id, runs[2].id]
    assert held(store)["results"] == 20
    large = add(store, session, image)
    do(store, "x" * 40)  # a result above the limit is held alone
    assert kept() == [large]
    for _ in range(4):
        add(store, session, image)
    assert held(store)["runs"] == 4 and large not in kept()


def test_sessions_are_limited() -> None:
    store = Store(Limits(sessions=1))
    store.open()
    with pytest.raises(Refused, match="1 pages are open"):
        store.open()


def test_an_image_goes_with_its_runs() -> None:
    store = Store(Limits())
    session = store.open()
    one, other = (store.add_upload(session, upload()) for _ in range(2))
    add(store, session, one)
    running = begin(store)
    add(store, session, one)
    kept = add(store, session, other)
    store.remove_upload(session, one)
    assert running.stopping.is_set()
    (run,) = store.state_of(session)["runs"]
    assert (run["id"], run["place"]) == (kept, 0)
    store.remove_run(session, kept)
    assert held(store)["waiting"] == held(store)["runs"] == 0
    for missing in (lambda: store.run(session, kept), lambda: store.remove_upload(session, one)):
        with pytest.raises(Refused):
            missing()


def test_the_end() -> None:
    store = Store(Limits())
    session = store.open()
    image = store.add_upload(session, upload())
    add(store, session, image)
    running = begin(store)
    add(store, session, image)
    version = store.version
    store.close()
    assert store.next() is None and running.stopping.is_set() and store.version > version
    assert not any(held(store).values())


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


def test_postscript_is_run_by_nothing(programs: list[str]) -> None:
    with pytest.raises(ImageError, match="not an image of a format that is read"):
        read_upload(ENDLESS, "x.png")
    assert programs == []
