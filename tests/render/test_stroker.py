"""Strokes with caps, joins and dashes: image and adjoint against float64, pictures against resvg."""

from __future__ import annotations

import pytest

from tests.helpers import compare
from tests.scenes import DASHES, styled_scene
from warpsplat.scene import Cap, Join
from warpsplat.scene.attributes import NO_DASHES

STYLES = [(cap, join) for cap in Cap for join in Join if (cap, join) != (Cap.ROUND, Join.ROUND)]


@pytest.mark.parametrize(("cap", "join"), STYLES)
def test_image_and_gradients(device: str, cap: Cap, join: Join) -> None:
    compare(styled_scene(cap, join, seed=3), device, 1.5)


@pytest.mark.parametrize("dash", range(len(DASHES)))
@pytest.mark.parametrize(("cap", "join"), [(Cap.BUTT, Join.MITER), (Cap.SQUARE, Join.BEVEL), (Cap.ROUND, Join.ROUND)])
def test_dashes(device: str, cap: Cap, join: Join, dash: int) -> None:
    compare(styled_scene(cap, join, dash, seed=4), device)


@pytest.mark.parametrize("dash", [NO_DASHES, 1])
def test_sixteen_lanes(device: str, dash: int) -> None:
    compare(styled_scene(Cap.SQUARE, Join.MITER, dash, seed=5), device, lanes=16)
