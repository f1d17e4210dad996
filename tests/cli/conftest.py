from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.forks import Forks


@pytest.fixture(scope="session")
def forks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Forks]:
    """One process for all tests here: it takes seconds to start."""
    made = Forks(tmp_path_factory.mktemp("forks"))
    yield made
    made.close()
