"""``warpsplat.render``."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from warpsplat.api.run import backend_on
from warpsplat.api.svg import SvgSource, save_svg, svg_name_of, text_of
from warpsplat.errors import ImageError, UsageError, shown
from warpsplat.fit.settings import Settings
from warpsplat.fit.step import model_for
from warpsplat.jobs.render import RendererName, drawn
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.memory import MOST_SIDE
from warpsplat.rendering.renderer import render_into
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.inspect import inspect_svg, svg_size


def render(
    scene: Scene | SvgSource,
    width: int | None = None,
    height: int | None = None,
    *,
    scale: float | None = None,
    renderer: RendererName = "exact",
    device: str = "auto",
    threads: int | None = None,
) -> FloatArray:
    """Draw a scene or an SVG.

    Args:
        scene: what to draw.
        width: [px]; the canvas, or the SVG's own size, is scaled to it.
        height: [px]; without one of the two the other says the size.
        scale: magnification, in place of both.
        renderer: ``exact`` coverage, ``splat`` or (scenes only) ``gaussian``; ``viewer`` is resvg.
        device: where to compute, see ``vectorize``.
        threads: see there.

    Returns:
        sRGB in [0, 1] premultiplied by opacity, and opacity, shape (height, width, 4). ``to_pillow`` makes an
        image of 8 bits of it.

    Raises:
        UsageError: sizes of other proportions than the scene's, or of no pixel.
        ImageError: an SVG that cannot be read, or not by this renderer.
        ResourceError: the picture takes more memory than there is.
    """
    if not isinstance(scene, Scene):
        text = text_of(scene, svg_name_of(scene))
        own = svg_size(inspect_svg(text).root)
        if own is None:
            raise ImageError(f"{svg_name_of(scene)}: says neither its size nor a viewBox")
        zoom = _zoom(own, width, height, scale)
        with backend_on(device, threads) as backend:
            return _with_opacity(drawn(text, renderer, zoom, backend))
    size = (scene.canvas.width, scene.canvas.height)
    zoom = _zoom(size, width, height, scale)
    if renderer == "viewer":
        return render(save_svg(scene), scale=zoom, renderer="viewer")
    viewport = Viewport(width or max(1, round(size[0] * zoom)), height or max(1, round(size[1] * zoom)), zoom)
    with backend_on(device, threads) as backend:
        model = model_for(Settings(renderer=renderer), 0)
        return _with_opacity(render_into(scene, viewport, model=model, backend=backend))


def _zoom(size: tuple[float, float], width: int | None, height: int | None, scale: float | None) -> float:
    """Pixels per unit of something of ``size`` that is drawn with this width, height or scale."""
    if scale is not None and (width is not None or height is not None):
        raise UsageError("a scale, and a width or height besides")
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
        raise UsageError(f"{width}x{height} px have not the proportions of {size[0]:g}x{size[1]:g}")
    return zoom


def _with_opacity(image: npt.NDArray[np.float32]) -> FloatArray:
    return image if image.shape[2] == 4 else np.concatenate([image, np.ones_like(image[..., :1])], axis=2)
