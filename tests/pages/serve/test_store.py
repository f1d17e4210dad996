"""What the server holds, for how long, what is dropped first; and the live view of a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import warpsplat
from tests.files.test_formats import ENDLESS
from tests.pages.serve.helpers import held
from warpsplat.errors import ImageError
from warpsplat.fit.progress import Progress, Snapshot
from warpsplat.fit.settings import Settings
from warpsplat.pages.serve.live import SHARE, LiveRun
from warpsplat.pages.serve.runs import Limits, Order, QueuedRun, Refused
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.uploads import Upload, plain_name, read_upload


@dataclass
class SlowClock:
    """A clock; reading its shapes takes half a second."""

    now: float = 0.0
    cost: float = 0.5

    def __call__(self) -> float:
        return self.now

    def scene(self) -> Any:
        self.now += self.cost
        return warpsplat.starting_scene(np.zeros((16, 16, 3), np.float32), 2)


@dataclass
class Made:
    """The parts of a result that a store uses."""

    svg: str = "<svg/>"
    stopped: bool = False
    figures: dict[str, Any] = field(default_factory=lambda: {"psnr": 20.0})

    def as_dict(self) -> dict[str, Any]:
        return self.figures


def upload(size: int = 100) -> Upload:
    return Upload("photo.png", bytes(size), 8, 8, b"", "image/png")


def add(store: Store, image: str) -> str:
    return store.add_run(image, Order({}, Settings(), None, "warpsplat"))


def begin(store: Store) -> QueuedRun:
    run = store.next()
    assert run
    return run


def do(store: Store, svg: str = "<svg/>") -> QueuedRun:
    """Do the next run."""
    run = begin(store)
    store.finish(run, Made(svg))
    return run


def test_everything_is_forgotten_a_while_after_the_page_was_closed() -> None:
    clock = SlowClock()
    store = Store(Limits(grace=10), clock)
    image = store.add_upload(upload())
    add(store, image)
    running = begin(store)
    add(store, store.add_upload(upload()))
    clock.now = 9
    with store.attended():
        clock.now = 30
        assert store.is_attended() and not store.expire()
    clock.now = 39
    assert not store.is_attended() and not store.expire() and store.is_wanted(running)
    clock.now = 40
    assert store.expire() and not store.expire()
    assert running.stopping.is_set() and not store.is_wanted(running)
    store.finish(running, Made())  # it ends later, and nobody wants it
    assert not any(held(store).values())
    with pytest.raises(Refused, match="no such image"):
        store.upload(image)


def test_images_give_way_to_new_ones_but_not_while_they_are_needed() -> None:
    store = Store(Limits(upload=100, images=250))
    first, second = (store.add_upload(upload()) for _ in range(2))
    add(store, first)
    with store.reserved(100):
        assert [image["id"] for image in store.state()["images"]] == [first]
        add(store, store.add_upload(upload(50)))
        with pytest.raises(Refused, match="try again when a run is done") as refused, store.reserved(100):
            pass
        assert refused.value.status == 503
    with store.reserved(100):
        assert held(store)["images"] == 150 and held(store)["uploading"] == 100
    with pytest.raises(Refused):
        store.upload(second)


def test_the_oldest_results_go_first() -> None:
    store = Store(Limits(results=25, runs=3))

    def kept() -> list[str]:
        return [run["id"] for run in store.state()["runs"]]

    image = store.add_upload(upload())
    runs = []
    for _ in range(3):
        add(store, image)
        runs.append(do(store, "x" * 10))
    assert kept() == [runs[1].id, runs[2].id]
    assert held(store)["results"] == 20
    large = add(store, image)
    do(store, "x" * 40)  # a result above the limit is held alone
    assert kept() == [large]
    unfinished = [add(store, store.add_upload(upload())) for _ in range(4)]
    assert kept() == unfinished


def test_an_image_goes_with_its_runs() -> None:
    store = Store(Limits())
    one, other = (store.add_upload(upload()) for _ in range(2))
    add(store, one)
    running = begin(store)
    kept = add(store, other)
    store.remove_upload(one)
    assert running.stopping.is_set()
    (run,) = store.state()["runs"]
    assert (run["id"], run["place"]) == (kept, 0)
    store.remove_run(kept)
    assert held(store)["waiting"] == held(store)["runs"] == 0
    for missing in (lambda: store.run(kept), lambda: store.remove_upload(one)):
        with pytest.raises(Refused):
            missing()


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


def reports(live: LiveRun, slow: SlowClock, count: int = 400, step: float = 0.1) -> None:
    snapshot = Snapshot(slow.scene, lambda: np.zeros((16, 16, 3), np.float32))
    for number in range(1, count + 1):
        slow.now += step
        live(Progress(number, count, 20.0, slow.now, number / count, True, 2, snapshot))


def test_pictures_take_a_small_share_of_the_time() -> None:
    slow = SlowClock()
    live = LiveRun(clock=slow)
    reports(live, slow)
    spent = live.number * slow.cost
    assert live.number > 3 and live.picture.startswith(b"<svg")
    assert spent <= SHARE * slow.now + slow.cost  # the first one comes at once
    assert spent > 0.8 * SHARE * slow.now
