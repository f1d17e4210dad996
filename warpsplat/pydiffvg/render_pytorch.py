"""DiffVG's rendering function, on our renderer."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import torch

from warpsplat.errors import UsageError
from warpsplat.kernels import constants
from warpsplat.pydiffvg.arguments import SceneArguments
from warpsplat.pydiffvg.assemble import assemble
from warpsplat.pydiffvg.cached import serialize_cached
from warpsplat.pydiffvg.device import get_device
from warpsplat.pydiffvg.layout import Layout, make_layout
from warpsplat.pydiffvg.pixel_filter import PixelFilter
from warpsplat.pydiffvg.shape import Shape, ShapeGroup
from warpsplat.torch import SceneTensors, render
from warpsplat.torch.function import draw
from warpsplat.torch.kept import check_memory
from warpsplat.torch.tensors import extremes

Tensor = torch.Tensor

FAINT = 1 / 256
"""Opacity at which coverages add up: two shapes that each cover half of a pixel cover all of it, where opaque
ones would leave a quarter."""

MOVE = 0.02
"""By which scenes are moved to find derivatives [px]."""

print_timing = False


def set_print_timing(val: bool) -> None:
    """Set whether each forward pass prints how long it took."""
    global print_timing  # noqa: PLW0603 - DiffVG's interface
    print_timing = val


class OutputType(IntEnum):
    """Kinds of images."""

    color = 1
    sdf = 2
    """Signed distances from the nearest outline."""


@dataclass(frozen=True)
class RenderOptions:
    """Arguments of ``serialize_scene`` besides the scene."""

    filter: PixelFilter
    output_type: OutputType
    positions: Tensor | None
    """Where distances are asked for [px], shape (position, 2); None: in all pixels."""


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
        """Return a scene as further arguments of ``apply``.

        Args:
            canvas_width: [canvas units].
            canvas_height: [canvas units].
            shapes: what the groups refer to.
            shape_groups: from back to front.
            filter: weights of the image around a pixel; default: the mean over its area.
            output_type: colours or signed distances.
            use_prefiltering: ignored, as images are never sampled.
            eval_positions: where distances are asked for [px], shape (position, 2); default: in all pixels.

        Raises:
            UsageError: something that cannot be rendered.
        """
        given = eval_positions is not None and len(eval_positions) > 0
        if given and output_type == OutputType.color:
            raise UsageError("eval_positions are of signed distances (OutputType.sdf), not of colours")
        options = RenderOptions(filter or PixelFilter(), output_type, eval_positions if given else None)
        options.filter.parts()
        scene = serialize_cached(canvas_width, canvas_height, shapes, shape_groups, get_device())
        return [canvas_width, canvas_height, scene, options]

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
            Of signed distances [canvas units], at the centres of pixels or at ``eval_positions``, shape
            (height, width, 1) or (position, 1).

        Raises:
            UsageError: other arguments, a background of another shape, or points that are not finite.
        """
        scene, options = _scene_of(args)
        if options.output_type == OutputType.sdf:
            return _render_distances(scene, int(width), int(height), options.positions)
        return _render_filtered(scene, int(width), int(height), background_image, options.filter)

    @staticmethod
    def render_grad(
        grad_img: Tensor,
        width: int,
        height: int,
        num_samples_x: int,
        num_samples_y: int,
        seed: int,
        background_image: Tensor | None,
        *args: Any,
    ) -> Tensor:
        """Return for each pixel the derivative of its value by a translation of all shapes and paints.

        ``grad_img``: weights of the image's channels, shape (height, width, 4). The others: see ``apply``.

        Returns:
            by x and y, for each canvas unit, shape (height, width, 2); of colours by central differences.

        Raises:
            UsageError: as ``apply``.
        """
        scene, options = _scene_of(args)
        if options.output_type == OutputType.sdf:
            return _translated_distances(scene, int(width), int(height), grad_img)
        return _translated_colors(scene, int(width), int(height), background_image, options.filter, grad_img)


def _scene_of(args: Sequence[Any]) -> tuple[SceneArguments, RenderOptions]:
    """Return what ``serialize_scene`` gave."""
    if len(args) != 4 or not isinstance(args[3], RenderOptions):
        raise UsageError("RenderFunction.apply takes what RenderFunction.serialize_scene gave, unchanged")
    return args[2], args[3]


def _render_distances(scene: SceneArguments, width: int, height: int, positions: Tensor | None) -> Tensor:
    from warpsplat.pydiffvg.distance import distances  # brings a kernel that colours do not need

    threads = torch.get_num_threads()
    if positions is None:
        return distances(scene, _centres(scene, width, height), threads).view(height, width, 1)
    unit = torch.tensor([scene.width / width, scene.height / height]).to(get_device(), torch.float32)
    return distances(scene, positions.to(get_device(), torch.float32) * unit, threads)[:, None]


def _centres(scene: SceneArguments, width: int, height: int) -> Tensor:
    """Return the centres of pixels, row by row [canvas units], shape (pixel, 2)."""
    sides = ((height, scene.height), (width, scene.width))
    y, x = ((torch.arange(side, device=get_device()) + 0.5) * (units / side) for side, units in sides)
    return torch.stack(torch.meshgrid(x.float(), y.float(), indexing="xy"), dim=2).view(-1, 2)


def _translated_distances(scene: SceneArguments, width: int, height: int, weights: Tensor) -> Tensor:
    """Return the derivatives of pixels' distances by a translation, see ``RenderFunction.render_grad``."""
    from warpsplat.pydiffvg.distance import distances

    centres = _centres(scene, width, height).requires_grad_()
    with torch.enable_grad():
        found = distances(scene, centres, torch.get_num_threads())
    (gradient,) = torch.autograd.grad(found, centres, weights.to(found).reshape(-1))
    return -gradient.view(height, width, 2)


@torch.no_grad()
def _translated_colors(
    scene: SceneArguments,
    width: int,
    height: int,
    background: Tensor | None,
    pixel_filter: PixelFilter,
    weights: Tensor,
) -> Tensor:
    """Return the derivatives of pixels' colours by a translation, see ``RenderFunction.render_grad``."""
    found = []
    for axis, scale in enumerate((width / scene.width, height / scene.height)):
        ahead, behind = (
            _render_filtered(scene, width, height, background, pixel_filter, (axis, sign * MOVE))
            for sign in (1, -1)
        )
        found.append((weights.to(ahead) * (ahead - behind)).sum(dim=2) * (scale / (2 * MOVE)))
    return torch.stack(found, dim=2)


def _render_filtered(
    scene: SceneArguments,
    width: int,
    height: int,
    background: Tensor | None,
    pixel_filter: PixelFilter,
    move: tuple[int, float] | None = None,
) -> Tensor:
    """Render colours; ``move``: an axis, and by how much everything is moved along it [px]."""
    if background is not None:
        background = _with_opacity(background.to(get_device(), torch.float32), width, height)
    parts = pixel_filter.parts()
    if parts is None:
        return _render(scene, width, height, background, move)
    if background is not None:
        background = background.repeat_interleave(parts, dim=0).repeat_interleave(parts, dim=1)
    if move is not None:
        move = move[0], parts * move[1]
    return pixel_filter.apply(_render(scene, parts * width, parts * height, background, move), parts)


def _render(
    scene: SceneArguments,
    width: int,
    height: int,
    background: Tensor | None,
    move: tuple[int, float] | None = None,
) -> Tensor:
    began = time.perf_counter()
    device = get_device()
    uniform = scene.width * height == scene.height * width
    layout = make_layout(scene.structure, (width, height), uniform, device, torch.get_num_threads())
    if not len(layout.scene):
        return torch.zeros(height, width, 4, device=device) if background is None else background
    values = assemble(scene, layout)
    if move is not None:
        for name in ("points", "frames"):
            if name in values:
                values[name] = values[name].clone()
                values[name][:, move[0]] += move[1]
    if not all(map(math.isfinite, *extremes([values["points"]]))):
        raise UsageError("a point of a shape is not finite: an optimiser diverged, or a shape has no size")
    if print_timing:
        print(f"Scene construction, time: {time.perf_counter() - began:.5f} s")
        began = time.perf_counter()
    if background is None:
        check_memory(layout.spec)
        result = draw([layout.spec], [values]).squeeze(0)
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
    """Composite a premultiplied image on a translucent background.

    As in DiffVG its colours count as premultiplied behind shapes, and as straight beside them, and a pixel is
    the mean of colours that are not premultiplied. Arrays: shape (height, width, 4).
    """
    covered = _coverage(values, layout)
    below, opacity = background[..., :3], background[..., 3:]
    # Premultiplied opacity and colour of the covered part, behind which the background shows.
    seen = covered - image[..., 3:]
    total = image[..., 3:] + seen * opacity
    color = (image[..., :3] + seen * below) * (covered / total.clamp_min(FAINT))
    return torch.cat([color + (1 - covered) * below, total + (1 - covered) * opacity], dim=2)


def _coverage(values: Mapping[str, Tensor], layout: Layout) -> Tensor:
    """Return the share of each pixel that visible shapes cover, shape (height, width, 1)."""
    own = {name: values[name] for name in ("points", "widths") if name in values}
    own["opacities"] = FAINT * (values["opacities"].detach() > constants.SEEN).float()
    own["colors"] = torch.zeros_like(values["colors"])
    return (render(SceneTensors(layout.outlines, own))[..., 3:] / FAINT).clamp_max(1.0)
