"""The live view of a run, and its cost."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import warpsplat
from warpsplat.fit.progress import Progress, Snapshot
from warpsplat.pages.serve.live import SHARE, LiveRun


@dataclass
class Slow:
    """A clock, and shapes that take half a second to read."""

    now: float = 0.0
    cost: float = 0.5

    def __call__(self) -> float:
        return self.now

    def scene(self) -> Any:
        self.now += self.cost
        return warpsplat.starting_scene(np.zeros((16, 16, 3), np.float32), 2)


def reports(live: LiveRun, slow: Slow, count: int = 400, step: float = 0.1) -> None:
    snapshot = Snapshot(slow.scene, lambda: np.zeros((16, 16, 3), np.float32))
    for number in range(1, count + 1):
        slow.now += step
        live(Progress(number, count, 20.0, slow.now, number / count, True, 2, snapshot))


def test_pictures_take_a_small_share_of_the_time() -> None:
    slow = Slow()
    live = LiveRun(clock=slow)
    reports(live, slow)
    spent = live.number * slow.cost
    assert live.number > 3 and live.picture.startswith(b"<svg")
    assert spent <= SHARE * slow.now + slow.cost  # the first one comes at once
    assert spent > 0.8 * SHARE * slow.now


def test_a_draft_is_shown_until_the_run_is_as_good() -> None:
    slow = Slow(cost=0.0)
    live = LiveRun(clock=slow)
    live.begin(is_draft=True)
    assert live.as_dict()["draft"]
    draft = warpsplat.vectorize(
        np.zeros((16, 16, 3), np.uint8), 2, subject="photo", iterations=4, device="cpu"
    )
    ends = Progress(4, 4, 21.0, 1.0, 1.0, True, 2)
    live.show_draft(replace(draft, history=(replace(ends, fine=False, psnr=25.0), ends)))
    live.begin()
    assert live.picture == draft.svg.encode() and live.number == 1 and not live.as_dict()["draft"]
    reports(live, slow, count=9)  # 20 dB
    assert live.number == 1 and live.as_dict()["work"] == 1
    live._least[True] = 20.0
    reports(live, slow, count=9)
    assert live.number > 1 and live.picture != draft.svg.encode()


def test_the_time_left() -> None:
    slow = Slow(cost=0.0)
    live = LiveRun(clock=slow)
    slow.now = 30.0  # kernels were compiled
    live.begin()
    live.notify("compiling kernels: 3 s")
    told = {"work": 0.0, "note": "compiling kernels: 3 s", "seconds": 0.0, "draft": False, "pictures": 0}
    assert live.as_dict() == told
    report = Progress(1, 10, math.inf, 1.0, 0.1, False, 5)
    live(report)
    told = live.as_dict()
    assert (told["left"], told["psnr"], told["shapes"], told["note"]) == (None, None, 5, "")
    slow.now += 2
    live(replace(report, psnr=21.234, work=0.3))
    assert live.left == pytest.approx(7.0) and live.as_dict()["psnr"] == 21.23
