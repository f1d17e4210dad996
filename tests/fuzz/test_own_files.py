"""Files of any shapes, written, read and written again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz.test_properties import examples
from tests.scenes import random_scene
from warpsplat.scene import Basis, Kind
from warpsplat.svg.read import load_scene
from warpsplat.svg.write import GRIDS, write_svg

pytestmark = pytest.mark.slow

outlines = st.tuples(st.sampled_from(list(Basis)), st.integers(3, 9), st.integers(0, 999))


@examples(60)
@given(st.sampled_from(list(Kind)), st.lists(outlines, min_size=1, max_size=4), st.sampled_from(GRIDS))
def test_own_files_come_back(kind: Kind, shapes: list[tuple[Basis, int, int]], per_pixel: float) -> None:
    """Read and written again, they are the same bytes, if no shape is too small for the grid."""
    scene = random_scene(Kind.FILL, 0, 401, 299)
    for basis, beziers, seed in shapes:
        scene = scene.append(random_scene(kind, 1, 401, 299, seed=seed, basis=basis, beziers=beziers))
    scene = replace(scene, points=np.float32(max(1.0, 4 / per_pixel)) * scene.points)
    text = write_svg(scene, per_pixel=per_pixel)
    back, _ = load_scene(text, 401, 299, "made up")
    assert back.basis.tolist() == scene.basis.tolist()
    assert write_svg(back, per_pixel=per_pixel) == text
