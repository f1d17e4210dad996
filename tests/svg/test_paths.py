"""Path data as the viewer reads it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.svg.foreign import HEAD, ROUND
from warpsplat.metrics import psnr
from warpsplat.svg.paths import cubics
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg


def test_path_data_as_the_viewer_reads_it() -> None:
    """Every command, absolute and relative, smooth ones after others, arcs of all flags."""
    rng = np.random.default_rng(5)
    sizes = {"l": 2, "h": 1, "v": 1, "c": 6, "s": 4, "q": 4, "t": 2, "z": 0, "m": 2, "a": 7}
    for _ in range(12):
        data = "M20 15"
        for command in rng.choice([*sizes], 8):
            relative = rng.random() < 0.5
            v = [f"{x:.1f}" for x in rng.uniform(*((-15, 15) if relative else (3, 27)), sizes[command])]
            if command == "a":
                v[:3] = [f"{x:.1f}" for x in rng.uniform(2, 20, 3)]
                v[3:5] = [str(x) for x in rng.integers(0, 2, 2)]
            data += (command if relative else command.upper()) + " ".join(v)
        text = f'{HEAD}width="40" height="30"><path {ROUND} stroke-width="2" d="{data}"/></svg>'
        scene, _ = load_scene(text, 40, 30, data)
        written, shown = (on_white(render_svg(t)) for t in (write_svg(scene, per_pixel=1e4), text))
        assert psnr(written, shown) > 36, data


@pytest.mark.parametrize("turn", [0, 30, 77.7])
@pytest.mark.parametrize("sweep", [0, 1])
def test_an_arc_too_small_for_its_ends_is_half_an_ellipse(turn: float, sweep: int) -> None:
    (drawn,) = cubics(f"M1 2A3 1.5 {turn} 0 {sweep} 14.1 9.3", keep_dots=False)
    assert len(drawn.points) == 7
    angle = np.radians(turn)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    own = (drawn.points[::3] - [7.55, 5.65]) @ rotation
    sizes = np.hypot(own[:, 0] / 3, own[:, 1] / 1.5)
    assert np.allclose(sizes, sizes[0])
    (x, y), (far_x, far_y) = drawn.points[3] - drawn.points[0], drawn.points[6] - drawn.points[0]
    assert (x * far_y - y * far_x > 0) == (sweep == 1)
