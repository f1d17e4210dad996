"""The fold loss: the area that a closed curve's strip covers beside its path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from tests import reference
from tests.kernels.helpers import plans_of, relative_error, renderer_for
from tests.scenes import disc, random_scene
from warpsplat.scene import Scene


def folded_scene() -> Scene:
    """A disc whose side is pushed in past the opposite one, and random blobs pushed likewise."""
    scene = random_scene("closed", seed=5)
    points = scene.points.copy()
    middle = points.mean(axis=1)
    points[:, 2:4] = 2 * middle[:, None] - points[:, 2:4]
    return replace(scene, points=points)


def test_gradient(device: str) -> None:
    scene = folded_scene()
    weight = 3.0
    renderer = renderer_for(scene, device, fold=weight)
    p = reference.tensors(scene)
    signs = renderer.part_sign.numpy()
    areas = [
        reference.fold_area(grid, float(sign))
        for grid, sign in zip(reference.grids(scene, p, plans_of(renderer), 1.0), signs, strict=True)
    ]
    total = torch.stack(areas).sum()
    assert float(total.detach()) > 10
    (weight * total / (scene.width * scene.height)).backward()
    assert p["points"].grad is not None
    renderer.backward()
    assert relative_error(renderer.parameters.gradients()["points"], p["points"].grad.numpy()) < 1e-4


def test_orientation_does_not_matter_and_a_disc_has_no_fold(device: str) -> None:
    scene = disc(12, 40, 20)
    mirrored = replace(scene, points=np.ascontiguousarray(scene.points[..., ::-1]))
    for s, sign in ((scene, 1.0), (mirrored, -1.0)):
        renderer = renderer_for(s, device, fold=1.0)
        assert renderer.part_sign.numpy()[0] == sign
        renderer.backward()
        assert not renderer.parameters.gradients()["points"].any()
