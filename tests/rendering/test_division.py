"""The division of a tile among a GPU's threads, on any device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from tests.helpers import SPLAT, relative_error, renderer_for
from tests.scenes import mixed_scene, random_scene
from warpsplat.kernels.tile import column
from warpsplat.rendering.models import EXACT, Model
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import Basis, Kind, Scene


def scene_of(name: str, splines: bool) -> Scene:
    if name == "mixed":
        both = (mixed_scene(90, 70, seed=seed, splines=splines) for seed in (4, 5))
        return next(both).append(next(both))
    basis = Basis.SPLINE if splines else Basis.CUBIC
    return random_scene(Kind[name.upper()], count=30, width=90, height=70, seed=4, basis=basis)


@pytest.mark.parametrize("name", ["fill", "stroke", "mixed"])
@pytest.mark.parametrize(
    ("model", "splines"), [(EXACT, False), (EXACT, True), (SPLAT, False)], ids=["exact", "splines", "splat"]
)
def test_sixteen_lanes_do_what_one_does(device: str, name: str, model: Model, splines: bool) -> None:
    scene = scene_of(name, splines)
    scene = replace(scene, points=(1.5 * scene.points).astype(np.float32))
    weights = np.random.default_rng(0).normal(size=(70, 90, 3)).astype(np.float32)
    target = wp.array(to_tiles(np.abs(weights)), dtype=column, device=device)
    outcomes = []
    for lanes in (1, 16):
        renderer = renderer_for(scene, device, model=model, lanes=lanes)
        costs = renderer.removal_costs(target)
        renderer.write_image_grad(weights)
        renderer.backward()
        outcomes.append([renderer.read_image(), costs, *renderer.parameters.gradients().values()])
    for one, many in zip(*outcomes, strict=True):
        assert relative_error(many, one) < 2e-5
