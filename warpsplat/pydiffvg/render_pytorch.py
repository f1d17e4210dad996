"""DiffVG's rendering function, on our renderer."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any

import torch

from warpsplat.errors import UsageError
from warpsplat.kernels import constants
from warpsplat.pydiffvg.arguments import SceneArguments, serialize_cached
from warpsplat.pydiffvg.assemble import assemble
from warpsplat.pydiffvg.device import get_device
from warpsplat.pydiffvg.layout import Layout, make_layout
from warpsplat.pydiffvg.pixel_filter import PixelFilter
from warpsplat.pydiffvg.shape import Shape, ShapeGroup
from warpsplat.torch import SceneTensors, render
from warpsplat.torch.engine import check_memory
from warpsplat.torch.function import draw

Tensor = torch.Tensor

FAINT = 1 / 256
"""Opacity at which coverages add up: two shapes that each cover half of a pixel cover all of it, where opaque
ones would leave a quarter."""

print_timing = False


def set_print_timing(val: bool) -> None:
    """Set whether each forward pass prints how long it took."""
    global print_timing  # noqa: PLW0603 - DiffVG's interface
    print_timing = val


class OutputType(IntEnum):
    """Kinds of images."""

    color = 1
    sdf = 2
    """Distances to the nearest outline: not supported."""


class RenderFunction:
    """Called as DiffVG's autograd function: ``RenderFunction.apply(width, ..., *serialize_scene(...))``."""

    @staticmethod
    def serialize_scene(
        canvas_width: int,
        canvas_height: int,
        shapes: Sequence[Shape],
        shape_groups: Sequence[ShapeGroup],
        filter: PixelFilter | None = None,
        output_type: OutputType = OutputType.color,
        use_prefiltering: bool = False,
        eval_positions: Tensor | None = None,
    ) -> list[Any]:
        """Return a scene as further arguments of ``apply``: its width, its height and ``SceneArguments``.

        The canvas has canvas units; the groups, from back to front, refer to ``shapes``. Of the others, only
        the defaults are supported, and ``use_prefiltering`` is ignored: images are never sampled.

        Raises:
            UsageError: something that cannot be rendered.
        """
        if output_type != OutputType.color or (eval_positions is not None and len(eval_positions)):
            raise UsageError(
                "signed distances (OutputType.sdf, eval_positions) are not supported, only colours"
            )
        (filter or PixelFilter()).check()
        scene = serialize_cached(canvas_width, canvas_height, shapes, shape_groups, get_device())
        return [canvas_width, canvas_height, scene]

    @staticmethod
    def apply(
        width: int,
        height: int,
        num_samples_x: int,
        num_samples_y: int,
        seed: int,
        background_image: Tensor | None,
        *args: Any,
    ) -> Tensor:
        """Render a scene; gradients flow to all of its tensors and to the background.

        ``background_image``: sRGB and opacity, shape (height, width, 4); or sRGB, (height, width, 3);
        ``args``: the result of ``serialize_scene``. The numbers of samples and the seed are ignored: a pixel
        is the mean over its whole area.

        Returns:
            sRGB and opacity in [0, 1], float32, shape (height, width, 4). As in DiffVG a pixel is the mean of
            colours that are not premultiplied, and black where nothing is: edges fade to black.

        Raises:
            UsageError: other arguments, a background of another shape, or points that are not finite.
        """
        if len(args) != 3 or not isinstance(args[2], SceneArguments):
            raise UsageError("RenderFunction.apply takes what RenderFunction.serialize_scene gave, unchanged")
        return _render(args[2], int(width), int(height), background_image)

    @staticmethod
    def render_grad(*_: Any) -> Tensor:
        """Refuse to render gradients of translations by a ``UsageError``."""
        raise UsageError("RenderFunction.render_grad, gradients of each pixel, is not supported")


def _render(scene: SceneArguments, width: int, height: int, background: Tensor | None) -> Tensor:
    began = time.perf_counter()
    device = get_device()
    if background is not None:
        background = _with_opacity(background.to(device, torch.float32), width, height)
    uniform = scene.width * height == scene.height * width
    layout = make_layout(scene.structure, (width, height), uniform, device, torch.get_num_threads())
    if not len(layout.scene):
        return torch.zeros(height, width, 4, device=device) if background is None else background
    values = assemble(scene, layout)
    if not bool(values["points"].isfinite().all()):
        raise UsageError("a point of a shape is not finite: an optimiser diverged, or a shape has no size")
    if print_timing:
        print(f"Scene construction, time: {time.perf_counter() - began:.5f} s")
        began = time.perf_counter()
    if background is None:
        check_memory(layout.spec)
        result = draw(layout.spec, values)
    else:
        result = render(SceneTensors(layout.scene, values))
        if bool((background[..., 3] >= 1).all()):
            result = result + (1 - result[..., 3:]) * background
        else:
            result = _on_translucent(result, values, layout, background)
    if print_timing:
        print(f"Forward pass, time: {time.perf_counter() - began:.5f} s")
    return result


def _with_opacity(background: Tensor, width: int, height: int) -> Tensor:
    """Return a background of shape (height, width, 3 or 4) with an opacity, shape (height, width, 4)."""
    if background.shape[2:] == (3,):
        background = torch.nn.functional.pad(background, (0, 1), value=1.0)
    if tuple(background.shape) != (height, width, 4):
        raise UsageError(f"background_image has shape {tuple(background.shape)}, not ({height}, {width}, 4)")
    return background


def _on_translucent(
    image: Tensor, values: Mapping[str, Tensor], layout: Layout, background: Tensor
) -> Tensor:
    """Composite a premultiplied image on a translucent background, which is not premultiplied.

    As in DiffVG a pixel is the mean of colours that are not premultiplied. Arrays: shape (height, width, 4).
    """
    covered = _coverage(values, layout)
    below, opacity = background[..., :3], background[..., 3:]
    # Premultiplied opacity and colour of the covered part, behind which the background shows.
    seen = covered - image[..., 3:]
    total = image[..., 3:] + seen * opacity
    color = (image[..., :3] + seen * opacity * below) * (covered / total.clamp_min(constants.NOTHING))
    return torch.cat([color + (1 - covered) * below, total + (1 - covered) * opacity], dim=2)


def _coverage(values: Mapping[str, Tensor], layout: Layout) -> Tensor:
    """Return the share of each pixel that visible shapes cover, shape (height, width, 1)."""
    own = {name: values[name] for name in ("points", "widths") if name in values}
    own["opacities"] = FAINT * (values["opacities"].detach() > constants.SEEN).float()
    own["colors"] = torch.zeros_like(values["colors"])
    return (render(SceneTensors(layout.outlines, own))[..., 3:] / FAINT).clamp_max(1.0)
