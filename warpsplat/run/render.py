"""An SVG drawn by the program's own renderers."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from PIL import Image

from warpsplat.errors import ImageError, UsageError
from warpsplat.fit.renderers import renderer_of
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray
from warpsplat.svg.inspect import MAX_PIXELS, inspect_svg, svg_size
from warpsplat.svg.read import scene_of
from warpsplat.svg.structure import read_shapes
from warpsplat.svg.viewer import premultiplied, render_svg


def drawn(text: str, renderer: str, scale: float, backend: Backend) -> FloatArray:
    """The SVG ``text`` at the size that resvg gives it, as ``Renderer.read_image`` has it.

    Raises:
        ImageError: not an SVG, or with something that the model cannot show.
        UsageError: a scale that leaves no pixel or too many, or a renderer that cannot draw files.
    """
    check_draws_files(renderer)
    size = svg_size(inspect_svg(text).root)
    if size is None:
        raise ImageError("says neither its size nor a viewBox")
    check_scale(size, scale)
    if renderer == "viewer":
        return (premultiplied(render_svg(text, zoom=scale)) / 255).astype(np.float32)
    width, height = (max(1, math.floor(math.floor(side + 0.5) * scale + 0.5)) for side in size)
    if width * height > MAX_PIXELS:
        raise ImageError(f"makes more than {MAX_PIXELS // 1_000_000} million pixels")
    scene, has_background = scene_of(read_shapes(text, width, height, scale), width, height)
    if not has_background:
        scene = replace(scene, canvas=replace(scene.canvas, background=None))
    try:
        scene = (own := renderer_of(renderer)).drawable(scene)
    except ValueError as error:
        raise ImageError(f"{error}, not supported by the {renderer} renderer") from None
    if len(scene):
        return render(scene, model=own.default_model, backend=backend)
    background = scene.canvas.background
    image = np.zeros((height, width, 4), np.float32)
    return image if background is None else np.asarray(image[..., :3] + background, np.float32)


def check_draws_files(renderer: str) -> None:
    """Check that a renderer, or the viewer resvg, can draw the scene of a file.

    Raises:
        UsageError: it cannot, or there is none of that name.
    """
    if renderer != "viewer" and (why := renderer_of(renderer).cannot_draw_files):
        raise UsageError(why)


def check_scale(size: tuple[float, float], scale: float) -> None:
    """Whether a picture of ``size``, magnified, has pixels, and not too many.

    Raises:
        UsageError: it has not.
        ImageError: it has too many by itself.
    """
    if not (math.isfinite(scale) and scale > 0):
        raise UsageError(f"scale must be a positive number, not {scale}")
    pixels = max(size[0], 1.0) * max(size[1], 1.0)
    # Products grow to infinity; a power of a float raises OverflowError.
    if pixels * scale * scale > MAX_PIXELS:
        most = f"more than {MAX_PIXELS // 1_000_000} million pixels"
        if pixels > MAX_PIXELS and scale == 1:
            raise ImageError(f"has {most}")
        raise UsageError(f"scale {scale} makes {most}")
    if min(max(1.0, side) for side in size) * scale < 0.5:
        raise UsageError(f"scale {scale} leaves no pixel of {size[0]:g}x{size[1]:g}")


def to_png(image: FloatArray) -> bytes:
    """A rendered image as a PNG."""
    packed = io.BytesIO()
    to_pillow(image).save(packed, "PNG")
    return packed.getvalue()


def to_pillow(image: FloatArray) -> Image.Image:
    """What ``render`` returns in 8 bits: RGB where all is opaque, else RGBA with straight opacity."""
    pixels = to_bytes(image)
    opaque = (pixels[..., 3:] == 255).all()
    return Image.fromarray(pixels[..., :3] if opaque else pixels)


def to_bytes(image: FloatArray) -> npt.NDArray[np.uint8]:
    """A rendered image in 8 bits; a transparent one, which is premultiplied, as PNGs have it."""
    color, alpha = image[..., :3], image[..., 3:]
    if alpha.shape[2]:
        image = np.concatenate([np.divide(color, alpha, out=np.zeros_like(color), where=alpha > 0), alpha], 2)
    return np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)
