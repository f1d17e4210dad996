"""Run the splat renderer and its reference on the same scene with the same grid plan."""

from __future__ import annotations

import numpy as np
import torch
import warp as wp

from tests import reference
from warpsplat.parameters import Parameters
from warpsplat.render_splat import SplatRenderer
from warpsplat.scene import Scene


def renderer_for(scene: Scene, device: str, scale: float = 1.0, **options: object) -> SplatRenderer:
    parameters = Parameters(scene, wp.get_device(device))
    width, height = round(scene.width * scale), round(scene.height * scale)
    renderer = SplatRenderer(parameters, width, height, scale, **options)
    renderer.forward_complete()
    return renderer


def plans_of(renderer: SplatRenderer) -> list[reference.Plan]:
    columns, rows = renderer.part_columns.numpy(), renderer.part_rows.numpy()
    reach = renderer.part_reach.numpy()
    return [reference.Plan(int(c), int(r), float(z)) for c, r, z in zip(columns, rows, reach, strict=True)]


def reference_image(
    scene: Scene, renderer: SplatRenderer, detach: bool = False
) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
    p = reference.tensors(scene)
    size = (renderer.width, renderer.height, renderer.scale)
    return p, reference.render(scene, p, plans_of(renderer), *size, detach)


def relative_error(got: np.ndarray, want: np.ndarray) -> float:
    """Largest difference over the largest magnitude."""
    return float(np.abs(got - want).max() / max(np.abs(want).max(), 1e-30))
