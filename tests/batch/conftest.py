from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests import make_image
from tests.batch.helpers import Answers, answers
from tests.cli.helpers import Cli
from tests.files.memory_store import store  # noqa: F401


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "in" / "deep").mkdir(parents=True)
    for seed, name in enumerate(("in/a.png", "in/b.png", "in/b.jpg", "in/deep/c.png")):
        make_image(tmp_path / name, seed)
    (tmp_path / "in" / "broken.png").write_bytes(b"no image")
    return tmp_path


@pytest.fixture
def batch(cli: Cli) -> Answers:
    def answered(*arguments: object, code: int = 0) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        return answers(cli(*arguments, "--json", code=code).out)

    return answered
