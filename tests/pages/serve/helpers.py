"""A client of the server, and images to upload."""

from __future__ import annotations

import io
import json
import threading
import time
from typing import Any

import httpx
import numpy as np
from PIL import Image

from warpsplat.pages.serve.runs import Limits
from warpsplat.pages.serve.server import WarpsplatServer
from warpsplat.pages.serve.store import Store
from warpsplat.pages.serve.worker import Machine

LONGEST = 60.0
"""Longest wait for anything [s]."""


def picture(width: int = 40, height: int = 32, kind: str = "PNG") -> bytes:
    """Return an image file with grain, so that it is detected as a photograph."""
    y, x = np.mgrid[:height, :width]
    smooth = np.stack([4 * x, 5 * y, 0 * x + 90], axis=2)
    grain = np.random.default_rng(0).normal(0, 4, smooth.shape)
    buffer = io.BytesIO()
    Image.fromarray(np.clip(smooth + grain, 0, 255).astype(np.uint8)).save(buffer, kind)
    return buffer.getvalue()


def until(condition: Any) -> Any:
    """Wait until ``condition()`` is true, and return its value."""
    ends = time.monotonic() + LONGEST
    while not (found := condition()):
        assert time.monotonic() < ends
        time.sleep(0.02)
    return found


def held(store: Store) -> dict[str, int]:
    """Return the numbers of runs, and the sizes of images and results [bytes]."""
    return {
        "runs": len(store._runs),
        "waiting": len(store._queue),
        "images": store._image_bytes(),
        "results": store._result_bytes(),
        "uploading": store._uploading,
    }


class Visitor:
    """A page's requests to a server, which it starts; a context manager."""

    def __init__(
        self, limits: Limits | None = None, max_memory: str | None = None, device: str = "cpu"
    ) -> None:
        self.server = WarpsplatServer("127.0.0.1", 0, Machine(device, 1, max_memory), limits or Limits())
        self.store = self.server.store
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.server.port}", timeout=LONGEST)
        self._ends, begun = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self.server.run, args=(self._ends.is_set, begun.set))
        self._thread.start()
        assert begun.wait(LONGEST)

    def __enter__(self) -> Visitor:
        answer = self.client.get(self.server.address(), follow_redirects=True)
        assert answer.text.startswith("<!doctype html>")
        return self

    def __exit__(self, *_: object) -> None:
        self.client.close()
        self._ends.set()
        self._thread.join(LONGEST)
        assert not self._thread.is_alive()

    def at(self, *parts: str) -> str:
        return "/".join(["", *parts])

    def upload(self, data: bytes, name: str = "photo.png") -> str:
        answer = self.client.post(self.at("images"), params={"name": name}, content=data)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["image"])

    def start(self, image: str, **settings: Any) -> Any:
        return self.client.post(self.at("runs"), content=json.dumps({"image": image, "settings": settings}))

    def begin(self, image: str, **settings: Any) -> str:
        answer = self.start(image, **settings)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["run"])

    def state(self) -> dict[str, Any]:
        return self.store.state()

    def run(self, run: str) -> dict[str, Any]:
        return next(each for each in self.state()["runs"] if each["id"] == run)

    def over(self, run: str) -> dict[str, Any]:
        """Wait for the end of a run, and return its state."""
        until(lambda: self.run(run)["state"] not in {"waiting", "running"})
        return self.run(run)
