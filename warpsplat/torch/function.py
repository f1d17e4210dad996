"""The renderer as a function that torch differentiates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import torch

from warpsplat.errors import UsageError, shown
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.memory import MOST_SIDE
from warpsplat.rendering.models import EXACT, GaussianModel, Model, SplatModel
from warpsplat.scene import Canvas
from warpsplat.scene.attributes import OPACITY_RANGE
from warpsplat.torch.engine import Picture, check_pictures, engine_of
from warpsplat.torch.tensors import TABLE, SceneTensors, attributes_of

Tensor = torch.Tensor
Names = tuple[tuple[str, ...], ...]
MODELS: dict[str, Model] = {"exact": EXACT, "splat": SplatModel(), "gaussian": GaussianModel()}


def render(
    scene: SceneTensors | Sequence[SceneTensors],
    width: int | None = None,
    height: int | None = None,
    *,
    renderer: Literal["exact", "splat", "gaussian"] | Model = "exact",
    threads: int | None = None,
) -> Tensor:
    """Draw a scene; gradients flow back to its attributes.

    Args:
        scene: one, or several.
        width: of the picture [px]; default: the canvas', or what ``height`` makes it.
        height: [px]; the same.
        renderer: what covers the pixels: ``exact``, the area that a viewer computes; ``splat``, the
            Gaussians of the paths; ``gaussian``, soft ones; or a model of ``warpsplat.rendering.models``.
        threads: of the CPU, default: as many as torch uses.

    Returns:
        sRGB premultiplied by opacity, and opacity: float32, shape (height, width, 4), on the scene's device;
        of several scenes (scene, height, width, 4). On a canvas with a background the opacity is 1.

    Raises:
        UsageError: no such size, renderer or device, or no scene.
        ResourceError: a picture takes more memory than there is.
        ValueError: a scene that the model cannot show, or a number that is not finite.
    """
    scenes = [scene] if isinstance(scene, SceneTensors) else list(scene)
    if not scenes:
        raise UsageError("no scene to render")
    model = model_of(renderer)
    used = threads or torch.get_num_threads()
    pictures = [
        Picture(
            one.layout, viewport_of(one.layout.canvas, width, height), model, one.device, used, is_opaque(one)
        )
        for one in scenes
    ]
    sizes = {(p.viewport.width, p.viewport.height, p.device) for p in pictures}
    if len(sizes) > 1:
        raise UsageError("scenes of several sizes or devices in one call")
    given = [[(a.name, one.value(a)) for a in attributes_of(one.layout)] for one in scenes]
    for each in given:
        check_finite(each)
    images = draw(pictures, [dict(each) for each in given])
    return images.squeeze(0) if isinstance(scene, SceneTensors) else images


def draw(pictures: Sequence[Picture], values: Sequence[Mapping[str, Tensor]]) -> Tensor:
    """Pictures of one size and device from all attributes that their shapes have, unchecked.

    Shape (picture, height, width, 4).

    Raises:
        ResourceError: they take more memory than there is.
    """
    check_pictures(pictures)
    names = tuple(map(tuple, values))
    images: Tensor = _Render.apply(pictures, names, *(value for each in values for value in each.values()))
    return images


def over(image: Tensor, background: Tensor | Sequence[float] | float) -> Tensor:
    """A picture of ``render``, shape (..., 4), on a colour or on a picture of sRGB: shape (..., 3)."""
    below = torch.as_tensor(background, dtype=image.dtype, device=image.device)
    return image[..., :3] + (1 - image[..., 3:]) * below


def check_finite(values: Sequence[tuple[str, Tensor]]) -> None:
    """Whether all numbers are.

    Raises:
        ValueError: one is not.
    """
    finite = torch.stack([value.detach().isfinite().all() for _, value in values]).tolist()
    if not all(finite):
        wrong = (name for (name, _), fine in zip(values, finite, strict=True) if not fine)
        raise ValueError(f"{', '.join(wrong)}: numbers that are not finite")


def is_opaque(scene: SceneTensors) -> bool:
    """Whether some shape lets so little light through that one cannot divide by it."""
    return bool((scene.value(TABLE["opacities"]).detach() > OPACITY_RANGE[1]).any())


def model_of(renderer: str | Model) -> Model:
    """The model that is meant.

    Raises:
        UsageError: there is none of that name.
    """
    if not isinstance(renderer, str):
        return renderer
    if renderer not in MODELS:
        raise UsageError(f"no renderer {shown(renderer)}; there are {', '.join(MODELS)}")
    return MODELS[renderer]


def viewport_of(canvas: Canvas, width: int | None, height: int | None) -> Viewport:
    """The picture of a canvas in a size of which one side, or both, may be left to the canvas.

    Raises:
        UsageError: a side is not a number of pixels, or the two would stretch the canvas.
    """
    for name, side in (("width", width), ("height", height)):
        if side is not None and (
            isinstance(side, bool) or not isinstance(side, int) or not 1 <= side <= MOST_SIDE
        ):
            raise UsageError(f"{name} must be a number of pixels, not {shown(side)}")
    if width is None and height is None:
        return Viewport(canvas.width, canvas.height)
    scale = width / canvas.width if width is not None else (height or 0) / canvas.height
    fitting = max(1, round(scale * canvas.width)), max(1, round(scale * canvas.height))
    made = width or fitting[0], height or fitting[1]
    if abs(made[1] - scale * canvas.height) > 1:
        raise UsageError(
            f"{made[0]}x{made[1]} px would stretch a canvas of {canvas.width}x{canvas.height}; "
            f"leave out the height or take {fitting[1]}"
        )
    return Viewport(*made, scale)


class _Render(torch.autograd.Function):
    """Pictures, names of the attributes of each, and these one after the other -> images."""

    @staticmethod
    def forward(ctx: Any, pictures: Sequence[Picture], names: Names, *values: Tensor) -> Tensor:
        viewport, device = pictures[0].viewport, pictures[0].device
        shape = len(pictures), viewport.height, viewport.width, 4
        images = torch.empty(shape, dtype=torch.float32, device=device)
        tickets = []
        for picture, own, image in zip(pictures, _parts(names, values), images, strict=True):
            with engine_of(picture) as engine:
                engine.forward(own)
                engine.show(image)
                tickets.append(ticket := object())
                engine.ticket = ticket
        ctx.state = (pictures, tickets, names)
        ctx.save_for_backward(*values)
        ctx.set_materialize_grads(False)
        return images

    @staticmethod
    def backward(ctx: Any, images_grad: Tensor | None) -> tuple[Tensor | None, ...]:
        if images_grad is None:
            return (None,) * len(ctx.needs_input_grad)
        wanted = ctx.needs_input_grad[2:]
        found: tuple[Tensor | None, ...] = _Adjoint.apply(ctx.state, wanted, images_grad, *ctx.saved_tensors)
        return (None, None, *found)


class _Adjoint(torch.autograd.Function):
    """Gradients of images -> of attributes. A function of its own, as it is what has no derivative."""

    @staticmethod
    def forward(
        ctx: Any, state: Any, wanted: Sequence[bool], images_grad: Tensor, *values: Tensor
    ) -> tuple[Tensor | None, ...]:
        pictures, tickets, names = state
        found: list[Tensor | None] = []
        each = zip(pictures, tickets, _parts(names, values), _parts(names, wanted), images_grad, strict=True)
        for picture, ticket, own, asked, image_grad in each:
            if not any(asked.values()):
                found += [None] * len(asked)
                continue
            gradient = image_grad.contiguous()
            with engine_of(picture) as engine:
                if engine.ticket is not ticket:  # another call has used the buffers since
                    engine.forward(own)
                gradients = engine.backward(gradient, [name for name in asked if asked[name]])
            found += [gradients[name].reshape(own[name].shape) if asked[name] else None for name in asked]
        return tuple(found)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        raise RuntimeError("warpsplat.torch.render has first derivatives only: no double backward")


def _parts(names: Names, values: Sequence[Any]) -> list[dict[str, Any]]:
    """The values of each picture by name."""
    rest = iter(values)
    return [{name: next(rest) for name in own} for own in names]
