"""The renderer as a function that torch differentiates."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch.autograd.function import once_differentiable

from warpsplat.errors import UsageError
from warpsplat.fit.renderers import renderer_of
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.models import Model
from warpsplat.run.render import zoom_of
from warpsplat.scene import Canvas
from warpsplat.scene.attributes import OPACITY_RANGE
from warpsplat.torch.engine import RenderSpec, check_memory, engine_of
from warpsplat.torch.tensors import TABLE, SceneTensors, attributes_of, check_finite

Tensor = torch.Tensor


def render(
    scene: SceneTensors | Sequence[SceneTensors],
    width: int | None = None,
    height: int | None = None,
    *,
    renderer: str | Model = "exact",
    threads: int | None = None,
) -> Tensor:
    """Render a scene, or several; gradients flow back to the attributes.

    Args:
        scene: one scene, or several of one size and device.
        width: of the image [px]; default: the canvas' width, or what fits ``height``.
        height: of the image [px]; default: the canvas' height, or what fits ``width``.
        renderer: what covers a pixel: ``exact``, the area that a viewer computes; ``splat``, Gaussians along
            the paths; ``gaussian``, soft ones; or a model of ``warpsplat.rendering.models``.
        threads: of the CPU; default: as many as torch uses.

    Returns:
        sRGB premultiplied by opacity, and opacity: float32, shape (height, width, 4), on the scene's device;
        for several scenes (scene, height, width, 4). On a canvas with a background the opacity is 1.

    Raises:
        UsageError: an invalid size, renderer or device, or no scene.
        ResourceError: the images take more memory than there is.
        ValueError: a scene that the model cannot show, or a number that is not finite.
    """
    scenes = [scene] if isinstance(scene, SceneTensors) else list(scene)
    if not scenes:
        raise UsageError("no scene to render")
    model = renderer_of(renderer).default_model if isinstance(renderer, str) else renderer
    threads = threads or torch.get_num_threads()
    specs = []
    for one in scenes:
        viewport = viewport_of(one.layout.canvas, width, height)
        specs.append(RenderSpec(one.layout, viewport, model, one.device, threads, is_opaque(one)))
    if len({(spec.viewport.width, spec.viewport.height, spec.device) for spec in specs}) > 1:
        raise UsageError("scenes of several sizes or devices in one call")
    values = [{a.name: one.value(a) for a in attributes_of(one.layout)} for one in scenes]
    for each in values:
        check_finite(each)
    check_memory(specs[0], len(specs))
    images = [draw(*each) for each in zip(specs, values, strict=True)]
    return images[0] if isinstance(scene, SceneTensors) else torch.stack(images)


def draw(spec: RenderSpec, values: Mapping[str, Tensor]) -> Tensor:
    """Render all attributes that the shapes have, by name, without a check; shape (height, width, 4)."""
    image: Tensor = _Render.apply(spec, tuple(values), *values.values())
    return image


def over(image: Tensor, background: Tensor | Sequence[float] | float) -> Tensor:
    """Composite an image of ``render`` on a background.

    Args:
        image: sRGB premultiplied by opacity, and opacity, shape (..., 4).
        background: sRGB, of a shape that broadcasts to (..., 3).

    Returns:
        sRGB, shape (..., 3).
    """
    below = torch.as_tensor(background, dtype=image.dtype, device=image.device)
    return image[..., :3] + (1 - image[..., 3:]) * below


def is_opaque(scene: SceneTensors) -> bool:
    """Return whether a shape is so opaque that its adjoint cannot divide by what it lets through."""
    return bool((scene.value(TABLE["opacities"]).detach() > OPACITY_RANGE[1]).any())


def viewport_of(canvas: Canvas, width: int | None, height: int | None) -> Viewport:
    """Return the viewport of an image of a canvas; see ``render``."""
    zoom = zoom_of((canvas.width, canvas.height), width, height, None)
    fitting = max(1, round(zoom * canvas.width)), max(1, round(zoom * canvas.height))
    return Viewport(width or fitting[0], height or fitting[1], zoom)


class _Render(torch.autograd.Function):
    """Attributes, in the order of ``names`` -> image."""

    @staticmethod
    def forward(ctx: Any, spec: RenderSpec, names: tuple[str, ...], *values: Tensor) -> Tensor:
        shape = spec.viewport.height, spec.viewport.width, 4
        image = torch.empty(shape, dtype=torch.float32, device=spec.device)
        with engine_of(spec) as engine:
            engine.forward(dict(zip(names, values, strict=True)))
            engine.show(image)
            ctx.ticket = engine.ticket = object()
        ctx.spec, ctx.names = spec, names
        ctx.save_for_backward(*values)
        ctx.set_materialize_grads(False)
        return image

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, image_grad: Tensor | None) -> tuple[Tensor | None, ...]:
        if image_grad is None:
            return (None,) * len(ctx.needs_input_grad)
        values = dict(zip(ctx.names, ctx.saved_tensors, strict=True))
        wanted = list(itertools.compress(ctx.names, ctx.needs_input_grad[2:]))
        with engine_of(ctx.spec) as engine:
            if engine.ticket is not ctx.ticket:  # another call has used the buffers since
                engine.forward(values)
            found = engine.backward(image_grad.contiguous(), wanted)
        gradients = (
            found[name].reshape(value.shape) if name in found else None for name, value in values.items()
        )
        return None, None, *gradients
