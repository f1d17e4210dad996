"""The fold loss: the area that a fill's strip covers beside its path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from tests.helpers import relative_error, renderer_for
from tests.paper.helpers import grid_of, plans_of
from tests.paper.reference.grid import fold_area, grids
from tests.reference.curves import tensors
from tests.scenes import disc, points_by_shape, random_scene, with_points
from warpsplat.paper.models import SplatModel
from warpsplat.scene import Kind, Scene


def folded_scene() -> Scene:
    """Random blobs, the side of each pushed in past the opposite one."""
    scene = random_scene(Kind.FILL, seed=5)
    points = points_by_shape(scene)
    middle = points.mean(axis=1)
    points[:, 2:4] = 2 * middle[:, None] - points[:, 2:4]
    return replace(scene, points=with_points(scene, points))


def test_gradient(device: str) -> None:
    """Folded fills between strokes, which may fold."""
    scene = folded_scene().append(random_scene(Kind.STROKE, 2)).append(folded_scene())
    weight = 3.0
    renderer = renderer_for(scene, device, model=SplatModel(fold=weight))
    p = tensors(scene)
    signs = grid_of(renderer).shape_sign.numpy()
    assert not signs[scene.kind == Kind.STROKE].any()
    areas = [
        fold_area(grid, float(sign))
        for grid, sign in zip(grids(scene, p, plans_of(renderer), 1.0), signs, strict=True)
    ]
    total = torch.stack(areas).sum()
    assert float(total.detach()) > 10
    (weight * total / (scene.canvas.width * scene.canvas.height)).backward()
    assert p["points"].grad is not None
    renderer.backward()
    assert relative_error(renderer.parameters.gradients()["points"], p["points"].grad.numpy()) < 1e-4


def test_orientation_does_not_matter_and_a_disc_has_no_fold(device: str) -> None:
    scene = disc(12, 40, 20)
    mirrored = replace(scene, points=np.ascontiguousarray(scene.points[..., ::-1]))
    for s, sign in ((scene, 1.0), (mirrored, -1.0)):
        renderer = renderer_for(s, device, model=SplatModel(fold=1.0))
        assert grid_of(renderer).shape_sign.numpy()[0] == sign
        renderer.backward()
        assert not renderer.parameters.gradients()["points"].any()
