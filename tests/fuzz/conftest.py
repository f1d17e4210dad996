"""Hypothesis keeps nothing in the tree: the same examples on every run need no memory."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis.configuration import set_hypothesis_home_dir

from tests.cli.conftest import forks  # noqa: F401

set_hypothesis_home_dir(Path(tempfile.gettempdir()) / "warpsplat-test-hypothesis")
