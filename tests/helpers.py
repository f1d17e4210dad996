"""Compare the renderer with its reference on the same scene and plans; launch single kernels."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import torch
import warp as wp

from tests.reference import exact
from tests.reference.composite import composite
from tests.reference.curves import Tensors, tensors
from warpsplat.extensions import load_renderer, renderer_names
from warpsplat.kernels.constants import TILE
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.models import EXACT, Model
from warpsplat.rendering.outline import Outline, OutlineBuffers
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.scene import Scene

SPLAT: Model = load_renderer("splat").default_model if "splat" in renderer_names() else EXACT
"""Tests with it, whose parameter is called splat, are skipped where it is not there."""


def renderer_for(
    scene: Scene,
    device: str,
    scale: float = 1.0,
    *,
    model: Model = EXACT,
    threads: int | None = None,
    lanes: int | None = None,
    capacity: Capacity | None = None,
    opaque: bool = False,
    straight: bool = False,
) -> Renderer:
    """Return a renderer after a complete forward pass. ``lanes``: default: as usual on the device."""
    backend = Backend.on(device, threads)
    backend = replace(backend, lanes=lanes or backend.lanes)
    viewport = Viewport(round(scene.canvas.width * scale), round(scene.canvas.height * scale), scale)
    options = {"model": model, "capacity": capacity, "opaque": opaque, "straight": straight}
    renderer = Renderer(Parameters(scene, backend), viewport, **options)
    renderer.forward_complete()
    return renderer


def outline_of(renderer: Renderer) -> OutlineBuffers:
    assert isinstance(renderer.geometry, Outline)
    return renderer.geometry.buffers


def pieces_of(renderer: Renderer) -> list[list[int]]:
    """Return the number of pieces of each Bézier, by shape."""
    ranges = outline_of(renderer).bezier_range.numpy()
    pieces = (ranges[:, 1] - ranges[:, 0]).tolist()
    first = renderer.parameters.arrays["bezier_first"].numpy()
    return [pieces[a:b] for a, b in itertools.pairwise(first)]


def reference_image(scene: Scene, renderer: Renderer, detach: bool = False) -> tuple[Tensors, torch.Tensor]:
    """Return the parameters, and the image that the reference renders with the renderer's plans."""
    p, v = tensors(scene), renderer.viewport
    if isinstance(renderer.geometry, Outline):
        covers = exact.coverages(scene, p, pieces_of(renderer), v.width, v.height, v.scale)
    else:
        from tests.paper.helpers import plans_of
        from tests.paper.reference import splat

        covers = splat.coverages(scene, p, plans_of(renderer), v.width, v.height, v.scale, detach)
    return p, composite(covers, p, scene, v.scale)


def compare(
    scene: Scene,
    device: str,
    scale: float = 1.0,
    *,
    tolerance: float = 1e-3,
    model: Model = EXACT,
    lanes: int | None = None,
) -> None:
    """Compare image and all gradients with the reference, for a random gradient of the image."""
    renderer = renderer_for(scene, device, scale, model=model, lanes=lanes)
    splats = not isinstance(renderer.geometry, Outline)
    detach = not getattr(model, "through_scales", True)
    p, image = reference_image(scene, renderer, detach)
    # The cut at Q_MAX makes single pixels differ where float32 and float64 decide differently.
    np.testing.assert_allclose(renderer.read_image(), image.detach().numpy(), atol=2e-3 if splats else 2e-4)
    assert np.abs(renderer.read_image() - image.detach().numpy()).mean() < 2e-6
    weights = np.random.default_rng(1).normal(size=(*image.shape,))
    (image * torch.tensor(weights)).sum().backward()
    for name, got in adjoint(renderer, weights).items():
        gradient = p[name].grad
        want = np.zeros(got.shape) if gradient is None else gradient.numpy()
        assert relative_error(got, want) < tolerance, name


def adjoint(renderer: Renderer, image_grad: Any = 1.0) -> dict[str, np.ndarray]:
    """Gradients of the parameters for one of the image, after a forward pass."""
    shape = renderer.read_image().shape
    renderer.write_image_grad(np.array(np.broadcast_to(image_grad, shape), np.float32))
    renderer.backward()
    return renderer.parameters.gradients()


def coverage_images(renderer: Renderer) -> np.ndarray:
    """Return coverage by shape, [shape, padded height, padded width]; 0 where it has no slot."""
    v, bins = renderer.viewport, renderer.bins.buffers
    images = np.zeros((renderer.parameters.shape_count, TILE * v.tiles_y, TILE * v.tiles_x), np.float32)
    shapes, tiles = bins.slot_shape.numpy(), bins.slot_tile.numpy()
    coverage = renderer.coverage.buffers.coverage_pixels.numpy()
    for slot in np.flatnonzero(shapes >= 0):
        y, x = divmod(int(tiles[slot]), v.tiles_x)
        block = coverage[slot].reshape(TILE, TILE).T
        images[shapes[slot], TILE * y : TILE * (y + 1), TILE * x : TILE * (x + 1)] = block
    return images


def run(kernel: wp.Kernel, dim: int | tuple[int, ...], device: str, *sources: object, **values: Any) -> None:
    """Launch one kernel, its parameters by name."""
    program = Backend.on(device, 1).program()
    program.launch(kernel, dim, *sources, **values)
    program.run()


def relative_error(got: np.ndarray, want: np.ndarray) -> float:
    """Return the largest difference over the largest magnitude."""
    return float(np.abs(got - want).max(initial=0) / max(np.abs(want).max(initial=0), 1e-30))
