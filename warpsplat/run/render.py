"""Draw scenes and SVGs by the program's own renderers, or by the viewer."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from PIL import Image

from warpsplat.errors import ImageError, UsageError, shown
from warpsplat.fit.renderers import renderer_of
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.memory import MOST_SIDE
from warpsplat.rendering.renderer import render as render_scene
from warpsplat.rendering.renderer import render_into
from warpsplat.run.arguments import backend_on
from warpsplat.run.svg import SvgSource, save_svg, size_of, svg_name_of, text_of
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.inspect import MAX_PIXELS
from warpsplat.svg.read import scene_of
from warpsplat.svg.structure import read_shapes
from warpsplat.svg.viewer import premultiplied, render_svg


def render(
    scene: Scene | SvgSource,
    width: int | None = None,
    height: int | None = None,
    *,
    scale: float | None = None,
    renderer: str = "exact",
    device: str = "auto",
    threads: int | None = None,
) -> FloatArray:
    """Draw a scene or an SVG.

    Args:
        scene: what to draw.
        width: [px]; the canvas, or the SVG's own size, is scaled to it.
        height: [px]; one of the two decides the other.
        scale: magnification, instead of both.
        renderer: ``exact`` coverage, ``splat`` or (scenes only) ``gaussian``; ``viewer`` is resvg.
        device: where to compute, see ``vectorize``.
        threads: as for ``vectorize``.

    Returns:
        sRGB in [0, 1] premultiplied by opacity, and opacity, shape (height, width, 4). ``to_pillow`` makes an
        image of 8 bits of it.

    Raises:
        UsageError: sizes of other proportions than the scene's, or of no pixel; a scene that this renderer
            cannot draw.
        ImageError: an SVG that cannot be read, or not by this renderer.
        ResourceError: the picture takes more memory than there is.
    """
    if not isinstance(scene, Scene):
        text = text_of(scene, svg_name_of(scene))
        own = size_of(text, svg_name_of(scene))
        zoom = zoom_of(own, width, height, scale)
        with backend_on(device, threads) as backend:
            return _with_opacity(_draw_svg(text, own, renderer, zoom, backend()))
    size = (scene.canvas.width, scene.canvas.height)
    zoom = zoom_of(size, width, height, scale)
    if renderer == "viewer":
        return render(save_svg(scene), scale=zoom, renderer="viewer")
    viewport = Viewport(width or max(1, round(size[0] * zoom)), height or max(1, round(size[1] * zoom)), zoom)
    with backend_on(device, threads) as backend:
        fitted = renderer_of(renderer)
        try:
            scene = fitted.drawable(scene)
        except ValueError as error:
            raise UsageError(cannot_draw(error, renderer)) from None
        return _with_opacity(render_into(scene, viewport, model=fitted.default_model, backend=backend()))


def cannot_draw(error: ValueError, renderer: str) -> str:
    """Return the message that a renderer cannot draw a scene, and why."""
    return f"the scene {error}, which the renderer {renderer} cannot draw; the renderer exact can"


def zoom_of(size: tuple[float, float], width: int | None, height: int | None, scale: float | None) -> float:
    """Return the pixels per unit of a picture of ``size`` that is drawn with this width, height or scale."""
    if scale is not None and (width is not None or height is not None):
        raise UsageError("give either a scale, or a width and height")
    for what, side in (("width", width), ("height", height)):
        if side is not None and (isinstance(side, bool) or not 1 <= side <= MOST_SIDE or int(side) != side):
            raise UsageError(f"{what} must be a whole number from 1 to {MOST_SIDE}, not {shown(side)}")
    if scale is not None:
        if not (math.isfinite(scale) and scale > 0):
            raise UsageError(f"scale must be a positive number, not {scale}")
        return scale
    if width is None and height is None:
        return 1.0
    zoom = width / size[0] if width is not None else (height or 1) / size[1]
    if width is not None and height is not None and abs(size[1] * zoom - height) >= 1:
        raise UsageError(f"{width}x{height} px do not have the proportions of {size[0]:g}x{size[1]:g}")
    return zoom


def _with_opacity(image: npt.NDArray[np.float32]) -> FloatArray:
    return image if image.shape[2] == 4 else np.concatenate([image, np.ones_like(image[..., :1])], axis=2)


def _draw_svg(
    text: str, size: tuple[float, float], renderer: str, scale: float, backend: Backend
) -> FloatArray:
    """Draw an SVG of a ``size`` as large as resvg does; the image is one of ``Renderer.read_image``."""
    check_draws_files(renderer)
    check_scale(size, scale)
    if renderer == "viewer":
        return (premultiplied(render_svg(text, zoom=scale)) / 255).astype(np.float32)
    width, height = (max(1, math.floor(math.floor(side + 0.5) * scale + 0.5)) for side in size)
    if width * height > MAX_PIXELS:
        raise ImageError(f"makes more than {MAX_PIXELS // 1_000_000} million pixels")
    scene, has_background = scene_of(read_shapes(text, scale), width, height)
    if not has_background:
        scene = replace(scene, canvas=replace(scene.canvas, background=None))
    try:
        scene = (own := renderer_of(renderer)).drawable(scene)
    except ValueError as error:
        raise ImageError(f"{error}, not supported by the {renderer} renderer") from None
    if len(scene):
        return render_scene(scene, model=own.default_model, backend=backend)
    background = scene.canvas.background
    image = np.zeros((height, width, 4), np.float32)
    return image if background is None else np.asarray(image[..., :3] + background, np.float32)


def check_draws_files(renderer: str) -> None:
    """Raise ``UsageError`` unless a renderer, or the viewer resvg, can draw the scene of a file."""
    if renderer != "viewer" and (why := renderer_of(renderer).cannot_draw_files):
        raise UsageError(why)


def check_scale(size: tuple[float, float], scale: float) -> None:
    """Raise ``UsageError`` unless a picture of ``size``, magnified, has pixels, and not too many."""
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
    """Return a rendered image as a PNG."""
    packed = io.BytesIO()
    to_pillow(image).save(packed, "PNG")
    return packed.getvalue()


def to_pillow(image: FloatArray) -> Image.Image:
    """Convert what ``render`` returns to 8 bits: RGB if all is opaque, else RGBA with straight opacity."""
    color, alpha = image[..., :3], image[..., 3:]
    if alpha.shape[2]:
        image = np.concatenate([np.divide(color, alpha, out=np.zeros_like(color), where=alpha > 0), alpha], 2)
    pixels = np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)
    opaque = (pixels[..., 3:] == 255).all()
    return Image.fromarray(pixels[..., :3] if opaque else pixels)
