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
from warpsplat.torch.engine import RenderSpec
from warpsplat.torch.kept import check_memory
from warpsplat.torch.passes import backward_all, forward_all, images_for
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
    Of several scenes a CPU works on as many at a time as it has threads.

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
        return _render([scene], width, height, renderer, threads).squeeze(0)
    if not isinstance(scene, (list, tuple)):
        raise TypeError(_not_a_scene(scene))
    if not scene:
        raise UsageError("no scene to render")
    return _render(scene, width, height, renderer, threads)


def _render(
    given: Sequence[SceneTensors | Scene],
    width: int | None,
    height: int | None,
    renderer: str | Model,
    threads: int | None,
) -> Tensor:
    """Return the image of each scene; see ``render``."""
    scenes = [drawable(_tensors_of(each), renderer) for each in given]
    if torch.compiler.is_compiling():
        width, height = (side if side is None else operator.index(side) for side in (width, height))  # static
        keys = [spec_key(one.layout, width, height, renderer, threads, one.device) for one in scenes]
        return _stacked(
            [
                torch.ops.warpsplat.render(list(one.values.values()), ",".join(one.values), key)[0]
                for one, key in zip(scenes, keys, strict=True)
            ]
        )
    specs = [spec_of(one.layout, width, height, renderer, threads, one.device) for one in scenes]
    if len({(spec.viewport.width, spec.viewport.height, spec.device) for spec in specs}) > 1:
        raise UsageError("scenes of several sizes or devices in one call")
    check_memory(specs[0], len(specs))
    return draw(specs, [one.drawn() for one in scenes])


def draw(specs: Sequence[RenderSpec], values: Sequence[Mapping[str, Tensor]]) -> Tensor:
    """Render scenes of one size, shape (scene, height, width, 4).

    ``specs``: of each scene; ``values``: all attributes that its shapes have, by name, in float32. They are
    checked if ``spec.opaque`` is None, see ``examined``.
    """
    if are_active():
        each = zip(specs, values, strict=True)
        return _stacked([Transformed.apply(spec, tuple(own), *own.values())[0] for spec, own in each])
    flat = itertools.chain.from_iterable(own.values() for own in values)
    images: Tensor = _Render.apply(specs, [tuple(own) for own in values], *flat)
    return images


def _stacked(images: list[Tensor]) -> Tensor:
    """Return images as one tensor, shape (scene, height, width, 4); a single one is not copied."""
    return torch.stack(images) if len(images) > 1 else images[0].unsqueeze(0)


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
    """Attributes of scenes, in the order of their ``names`` -> images, shape (scene, height, width, 4)."""

    @staticmethod
    def forward(
        ctx: Any, specs: Sequence[RenderSpec], names: Sequence[tuple[str, ...]], *values: Tensor
    ) -> Tensor:
        scenes = _by_scene(names, values)
        held = any(ctx.needs_input_grad)
        images = images_for(specs[0], len(specs))
        ctx.passes = forward_all(specs, scenes, images, held)
        ctx.names = names
        ctx.save_for_backward(*values)
        ctx.set_materialize_grads(False)
        return images

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, image_grads: Tensor | None) -> tuple[Tensor | None, ...]:
        if image_grads is None:
            return (None,) * len(ctx.needs_input_grad)
        scenes = _by_scene(ctx.names, ctx.saved_tensors)
        needed = _by_scene(ctx.names, ctx.needs_input_grad[2:])
        wanted = [[name for name, is_needed in own.items() if is_needed] for own in needed]
        found = backward_all(ctx.passes, scenes, image_grads, wanted)
        gradients = (map(own.get, names) for own, names in zip(found, ctx.names, strict=True))
        return None, None, *itertools.chain.from_iterable(gradients)


def _by_scene(names: Sequence[tuple[str, ...]], values: Sequence[Any]) -> list[dict[str, Any]]:
    """Return what belongs to each scene, by name."""
    rest = iter(values)
    return [dict(zip(own, rest)) for own in names]  # noqa: B905 - the others' come after
