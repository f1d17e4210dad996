"""The renderer as a function that torch differentiates."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch.autograd.function import once_differentiable

from warpsplat.errors import UsageError
from warpsplat.fit.renderers import renderer_of
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.models import Model
from warpsplat.run.arguments import check_threads
from warpsplat.run.render import zoom_of
from warpsplat.scene import Canvas, Scene
from warpsplat.torch.drawable import drawable
from warpsplat.torch.engine import RenderSpec, check_memory
from warpsplat.torch.passes import backward, forward
from warpsplat.torch.tensors import SceneTensors
from warpsplat.torch.transforms import Transformed, are_active

Tensor = torch.Tensor


def render(
    scene: SceneTensors | Scene | Sequence[SceneTensors | Scene],
    width: int | None = None,
    height: int | None = None,
    *,
    renderer: str | Model = "exact",
    threads: int | None = None,
) -> Tensor:
    """Render a scene, or several; gradients flow back to the attributes.

    ``torch.compile`` makes it one operator of its graph; ``torch.func`` differentiates and batches it.

    Args:
        scene: one scene, or several of one size and device. A ``Scene`` is drawn as it is, on the CPU.
        width: of the image [px]; default: the canvas' width, or what fits ``height``.
        height: of the image [px]; default: the canvas' height, or what fits ``width``.
        renderer: what covers a pixel: ``exact``, the area that a viewer computes; ``splat``, Gaussians along
            the paths; ``gaussian``, soft ones; or a model of ``warpsplat.rendering.models``.
        threads: of the CPU; default: as many as torch uses.

    Returns:
        sRGB premultiplied by opacity, and opacity: float32, shape (height, width, 4), on the scene's device;
        for several scenes (scene, height, width, 4). On a canvas with a background the opacity is 1.

    Raises:
        UsageError: an invalid size, renderer, number of threads or device; no scene, or one that the renderer
            cannot draw.
        ResourceError: the images take more memory than there is.
        ValueError: a scene that the model cannot show, or a number that is not finite.
        TypeError: no scene.
    """
    if isinstance(scene, (Scene, SceneTensors)):
        return _render([scene], width, height, renderer, threads)[0]
    if not isinstance(scene, (list, tuple)):
        raise TypeError(_not_a_scene(scene))
    if not scene:
        raise UsageError("no scene to render")
    return torch.stack(_render(scene, width, height, renderer, threads))


def _render(
    given: Sequence[SceneTensors | Scene],
    width: int | None,
    height: int | None,
    renderer: str | Model,
    threads: int | None,
) -> list[Tensor]:
    """Return the image of each scene; see ``render``."""
    scenes = [drawable(_tensors_of(each), renderer) for each in given]
    if torch.compiler.is_compiling():
        width, height = (side if side is None else operator.index(side) for side in (width, height))  # static
        keys = [spec_key(one.layout, width, height, renderer, threads, one.device) for one in scenes]
        return [
            torch.ops.warpsplat.render(list(one.values.values()), ",".join(one.values), key)[0]
            for one, key in zip(scenes, keys, strict=True)
        ]
    all_specs = [spec_of(one.layout, width, height, renderer, threads, one.device) for one in scenes]
    if len({(spec.viewport.width, spec.viewport.height, spec.device) for spec in all_specs}) > 1:
        raise UsageError("scenes of several sizes or devices in one call")
    check_memory(all_specs[0], len(all_specs))
    return [draw(spec, one.drawn()) for spec, one in zip(all_specs, scenes, strict=True)]


def draw(spec: RenderSpec, values: Mapping[str, Tensor]) -> Tensor:
    """Render all attributes that the shapes have, by name, in float32; shape (height, width, 4).

    Values are checked if ``spec.opaque`` is None, see ``examined``.
    """
    arguments = spec, tuple(values), *values.values()
    image: Tensor = Transformed.apply(*arguments)[0] if are_active() else _Render.apply(*arguments)
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


def _tensors_of(scene: SceneTensors | Scene) -> SceneTensors:
    """Return the tensors of one of several scenes; a ``Scene`` has none but its layout."""
    if isinstance(scene, SceneTensors):
        return scene
    if isinstance(scene, Scene):
        return SceneTensors(scene, {})
    raise TypeError(_not_a_scene(scene))


def _not_a_scene(scene: object) -> str:
    found = type(scene).__name__
    if isinstance(scene, torch.nn.Module):
        return f"a {found} is called to render it, as in module(); render takes its tensors()"
    return f"render takes SceneTensors or a Scene, or a list of them, not {found}"


def spec_of(
    layout: Scene,
    width: int | None,
    height: int | None,
    renderer: str | Model,
    threads: int | None,
    device: torch.device,
) -> RenderSpec:
    """Return what an engine is recorded for, in which ``opaque`` is not known yet; see ``render``."""
    check_threads(threads)
    model = renderer_of(renderer).default_model if isinstance(renderer, str) else renderer
    viewport = viewport_of(layout.canvas, width, height)
    return RenderSpec(layout, viewport, model, device, threads or torch.get_num_threads(), opaque=None)


def spec_key(
    layout: Scene,
    width: int | None,
    height: int | None,
    renderer: str | Model,
    threads: int | None,
    device: torch.device,
) -> str:
    """Return the key of ``spec_of`` for the operator. ``torch.compile`` takes the result as a constant."""
    from warpsplat.torch.operator import key_of  # registers the operator, which others have no use for

    return key_of(spec_of(layout, width, height, renderer, threads, device))


# As torch.compiler.assume_constant_result does, which imports the compiler, for seconds.
spec_key._dynamo_marked_constant = True  # type: ignore[attr-defined]


def viewport_of(canvas: Canvas, width: int | None, height: int | None) -> Viewport:
    """Return the viewport of an image of a canvas; see ``render``."""
    zoom = zoom_of((canvas.width, canvas.height), width, height, None)
    fitting = max(1, round(zoom * canvas.width)), max(1, round(zoom * canvas.height))
    return Viewport(width or fitting[0], height or fitting[1], zoom)


class _Render(torch.autograd.Function):
    """Attributes, in the order of ``names`` -> image."""

    @staticmethod
    def forward(ctx: Any, spec: RenderSpec, names: tuple[str, ...], *values: Tensor) -> Tensor:
        image, ctx.spec, ctx.ticket = forward(spec, dict(zip(names, values, strict=True)))
        ctx.names = names
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
        found = backward(ctx.spec, ctx.ticket, values, image_grad, wanted)
        return None, None, *map(found.get, ctx.names)
