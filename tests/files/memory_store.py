"""A store of images: fsspec's file system in memory."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from warpsplat.files import remote as module


def png(seed: int) -> bytes:
    file = io.BytesIO()
    pixels = np.random.default_rng(seed).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(file, "png")
    return file.getvalue()


@pytest.fixture
def store(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Any]:
    pytest.importorskip("upath")
    store = pytest.importorskip("fsspec").filesystem("memory")
    store.store.clear()
    for name in ("in/a.png", "in/b.PNG", "in/deep/c.png", "in/.hidden.png", "in/notes.txt", "in/a.svg"):
        store.pipe_file(f"/bucket/{name}", png(len(name)))
    module._listed.clear()
    monkeypatch.chdir(tmp_path)
    yield store
    store.store.clear()
    module._listed.clear()
