"""DiffVG's rendering function, on our renderer."""

from __future__ import annotations

import time
from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import torch

from warpsplat.errors import UsageError
from warpsplat.pydiffvg.arguments import SceneArguments
from warpsplat.pydiffvg.assemble import LAYOUTS, assemble, outlines_only
from warpsplat.pydiffvg.device import get_device
from warpsplat.pydiffvg.pixel_filter import PixelFilter
from warpsplat.pydiffvg.reading import read
from warpsplat.pydiffvg.shape import Shape, ShapeGroup
from warpsplat.pydiffvg.straight import over
from warpsplat.torch import SceneTensors, render
from warpsplat.torch.function import draw

Tensor = torch.Tensor

print_timing = False


def set_print_timing(val: bool) -> None:
    """Whether each forward pass prints how long it took."""
    global print_timing  # noqa: PLW0603 - DiffVG's interface
    print_timing = val


class OutputType(IntEnum):
    """What a picture shows."""

    color = 1
    sdf = 2
    """Distances to the nearest outline: not there."""


class RenderFunction:
    """Used as DiffVG's autograd function is: ``RenderFunction.apply(width, ..., *serialize_scene(...))``."""

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
        """A scene as further arguments of ``apply``; the first two are width and height of its canvas.

        Args:
            canvas_width: [canvas units]
            canvas_height: [canvas units]
            shapes: that the groups name.
            shape_groups: from the back to the front.
            filter: default: the one there is.
            output_type: ``color``.
            use_prefiltering: not read; pictures are never sampled.
            eval_positions: none.

        Raises:
            UsageError: what cannot be rendered.
        """
        if output_type != OutputType.color or (eval_positions is not None and len(eval_positions)):
            raise UsageError("signed distances (OutputType.sdf, eval_positions) are not there, only colours")
        (filter or PixelFilter()).check()
        scene = read(canvas_width, canvas_height, shapes, shape_groups, get_device())
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
        """A picture; gradients flow to all tensors of the scene, and to the background.

        Args:
            width: [px]
            height: [px]
            num_samples_x: not read: a pixel is the mean over its whole area.
            num_samples_y: the same.
            seed: not read: nothing is random.
            background_image: sRGB and opacity, shape (height, width, 4); or sRGB, (height, width, 3).
            args: what ``serialize_scene`` gave.

        Returns:
            sRGB and opacity, float32, shape (height, width, 4). As in DiffVG a pixel is the mean of colours
            that are not premultiplied, and black where nothing is: at the edge of what is drawn it fades.

        Raises:
            UsageError: arguments that are none, a background of another shape, points that are not finite.
        """
        if len(args) != 3 or not isinstance(args[2], SceneArguments):
            raise UsageError("RenderFunction.apply takes what RenderFunction.serialize_scene gave, unchanged")
        return render_scene(args[2], int(width), int(height), background_image)

    @staticmethod
    def render_grad(*_: Any) -> Tensor:
        """Not there.

        Raises:
            UsageError: always.
        """
        raise UsageError("RenderFunction.render_grad, gradients by pixel of translation, is not there")


def render_scene(scene: SceneArguments, width: int, height: int, background: Tensor | None) -> Tensor:
    """See ``RenderFunction.apply``."""
    began = time.perf_counter()
    device = get_device()
    if background is not None:
        background = background.to(device, torch.float32)
        if background.shape[2:] == (3,):
            background = torch.nn.functional.pad(background, (0, 1), value=1.0)
        if tuple(background.shape) != (height, width, 4):
            raise UsageError(
                f"background_image has shape {tuple(background.shape)}, not ({height}, {width}, 4)"
            )
    size = width, height
    layout = LAYOUTS.get(scene, size, device)
    if not len(layout.scene):
        return torch.zeros(height, width, 4, device=device) if background is None else background
    values = assemble(scene, layout, size, device)
    if not bool(values["points"].isfinite().all()):
        raise UsageError(
            "a point of a shape is not finite: an optimiser has run away, or a shape has no size"
        )
    if print_timing:
        print(f"Scene construction, time: {time.perf_counter() - began:.5f} s")
        began = time.perf_counter()
    if background is None:
        result = draw([layout.picture(torch.get_num_threads())], [values])[0]
    else:
        image = render(SceneTensors(layout.scene, values), width, height)
        if bool((background[..., 3] >= 1).all()):
            result = image + (1 - image[..., 3:]) * background
        else:
            result = over(image, render(outlines_only(values, layout), width, height), background)
    if print_timing:
        print(f"Forward pass, time: {time.perf_counter() - began:.5f} s")
    return result
