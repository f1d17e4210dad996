"""A drawing that takes long says so before."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from tests.drawing.drawings import RED, WHITE, disc, drawing
from warpsplat.drawing.draw import warn_if_long
from warpsplat.fit.problem import Problem
from warpsplat.fit.settings import Settings
from warpsplat.scene import Canvas


@pytest.mark.parametrize(("discs", "is_long"), [(20, False), (3000, True)])
def test_it_says_how_many_nodes_take_how_long(
    discs: int, is_long: bool, caplog: pytest.LogCaptureFixture
) -> None:
    made = drawing(Canvas(64, 64, WHITE), (RED, [disc(32, 32, 9)] * discs))
    with caplog.at_level(logging.WARNING):
        warn_if_long(made, Problem(np.ones((64, 64, 3), np.float32), Settings()))
    assert ["12,000 nodes takes about 7 s" in message for message in caplog.messages] == [True] * is_long
