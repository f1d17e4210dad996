"""The renderer as a function that torch differentiates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import torch

from warpsplat.errors import UsageError
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.models import EXACT, GaussianModel, Model, SplatModel
from warpsplat.scene import ATTRIBUTES, Canvas
from warpsplat.scene.attributes import OPACITY_RANGE
from warpsplat.torch.engine import Picture, engine_of
from warpsplat.torch.tensors import SceneTensors

Tensor = torch.Tensor
MODELS: dict[str, Model] = {"exact": EXACT, "splat": SplatModel(), "gaussian": GaussianModel()}
NAMES = tuple(attribute.name for attribute in ATTRIBUTES)
OPACITIES = ATTRIBUTES[NAMES.index("opacities")]


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
        ValueError: a scene that the model cannot show, or a number that is not finite.
    """
    scenes = [scene] if isinstance(scene, SceneTensors) else list(scene)
    if not scenes:
        raise UsageError("no scene to render")
    model = model_of(renderer)
    for one in scenes:
        check_finite(one)
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
    values = [one.value(attribute) for one in scenes for attribute in ATTRIBUTES]
    images: Tensor = _Render.apply(pictures, *values)
    return images.squeeze(0) if isinstance(scene, SceneTensors) else images


def over(image: Tensor, background: Tensor | Sequence[float] | float) -> Tensor:
    """A picture of ``render``, shape (..., 4), on a colour or on a picture of sRGB: shape (..., 3)."""
    below = torch.as_tensor(background, dtype=image.dtype, device=image.device)
    return image[..., :3] + (1 - image[..., 3:]) * below


def check_finite(scene: SceneTensors) -> None:
    """Whether all numbers are.

    Raises:
        ValueError: one is not.
    """
    if scene.values:
        finite = torch.stack([value.detach().isfinite().all() for value in scene.values.values()])
        if not finite.all():
            names = [name for name, fine in zip(scene.values, finite.tolist(), strict=True) if not fine]
            raise ValueError(f"{', '.join(names)}: numbers that are not finite")


def is_opaque(scene: SceneTensors) -> bool:
    """Whether some shape lets so little light through that one could not divide by it."""
    return bool((scene.value(OPACITIES).detach() > OPACITY_RANGE[1]).any())


def model_of(renderer: str | Model) -> Model:
    """The model that is meant.

    Raises:
        UsageError: there is none of that name.
    """
    if not isinstance(renderer, str):
        return renderer
    if renderer not in MODELS:
        raise UsageError(f"no renderer {renderer!r}; there are {', '.join(MODELS)}")
    return MODELS[renderer]


def viewport_of(canvas: Canvas, width: int | None, height: int | None) -> Viewport:
    """The picture of a canvas in a size of which one side, or both, may be left to the canvas.

    Raises:
        UsageError: a side is not a number of pixels, or the two would stretch the canvas.
    """
    for name, side in (("width", width), ("height", height)):
        if side is not None and (isinstance(side, bool) or not isinstance(side, int) or side < 1):
            raise UsageError(f"{name} must be a number of pixels, not {side!r}")
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
    """Pictures, and for each all attributes in the order of the table -> images."""

    @staticmethod
    def forward(ctx: Any, pictures: list[Picture], *values: Tensor) -> Tensor:
        viewport, device = pictures[0].viewport, pictures[0].device
        shape = len(pictures), viewport.height, viewport.width, 4
        images = torch.empty(shape, dtype=torch.float32, device=device)
        tickets = []
        for i, picture in enumerate(pictures):
            with engine_of(picture) as engine:
                engine.forward(dict(zip(NAMES, _part(values, i), strict=True)))
                engine.show(images[i])
                tickets.append(ticket := object())
                engine.ticket = ticket
        ctx.pictures, ctx.tickets = pictures, tickets
        ctx.save_for_backward(*values)
        ctx.set_materialize_grads(False)
        return images

    @staticmethod
    def backward(ctx: Any, images_grad: Tensor | None) -> tuple[Tensor | None, ...]:
        if images_grad is None:
            return (None,) * (1 + len(ctx.saved_tensors))
        wanted = ctx.needs_input_grad[1:]
        state = (ctx.pictures, ctx.tickets, wanted)
        found: tuple[Tensor | None, ...] = _Adjoint.apply(state, images_grad, *ctx.saved_tensors)
        return (None, *found)


class _Adjoint(torch.autograd.Function):
    """Gradients of images -> of attributes. A function of its own, as it is what has no derivative."""

    @staticmethod
    def forward(ctx: Any, state: Any, images_grad: Tensor, *values: Tensor) -> tuple[Tensor | None, ...]:
        pictures, tickets, wanted = state
        found: list[Tensor | None] = []
        for i, picture in enumerate(pictures):
            own, asked = _part(values, i), _part(wanted, i)
            if not any(asked):
                found += [None] * len(NAMES)
                continue
            with engine_of(picture) as engine:
                if engine.ticket is not tickets[i]:  # another call has used the buffers since
                    engine.forward(dict(zip(NAMES, own, strict=True)))
                gradients = engine.backward(images_grad[i].contiguous())
            found += [
                gradients.get(name, torch.zeros_like(value)).reshape(value.shape) if want else None
                for name, value, want in zip(NAMES, own, asked, strict=True)
            ]
        return tuple(found)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        raise RuntimeError("warpsplat.torch.render has first derivatives only: no double backward")


def _part(values: Any, i: int) -> Any:
    """Those of picture ``i``, in the order of the table."""
    return values[i * len(NAMES) : (i + 1) * len(NAMES)]
