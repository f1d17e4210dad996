from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.forks import Forks


@pytest.fixture(scope="session")
def forks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Forks]:
    """One process for all tests here: it takes seconds to start."""
    made = Forks(tmp_path_factory.mktemp("forks"))
    yield made
    made.close()


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """With grain, so that it is taken for a photograph."""
    path = tmp_path / "photo.png"
    y, x = np.mgrid[:40, :60]
    smooth = np.stack([4 * x, 6 * y, 0 * x + 90], axis=2)
    grain = np.random.default_rng(0).normal(0, 4, smooth.shape)
    Image.fromarray(np.clip(smooth + grain, 0, 255).astype(np.uint8)).save(path)
    return path
