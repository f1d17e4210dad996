from __future__ import annotations

from tests.files.memory_store import store  # noqa: F401
