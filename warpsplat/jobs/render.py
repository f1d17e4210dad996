"""An SVG drawn by the program's own renderers."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from PIL import Image

from warpsplat.errors import ImageError
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.models import EXACT, Model, SplatModel
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray
from warpsplat.scene.chains import as_chains
from warpsplat.svg.inspect import MAX_PIXELS, inspect_svg, svg_size
from warpsplat.svg.read import scene_of
from warpsplat.svg.structure import read_shapes

MODELS: dict[str, Model] = {"exact": EXACT, "splat": SplatModel()}


def draw_own(text: str, model: str, scale: float, backend: Backend) -> bytes:
    """The SVG ``text`` as a PNG of the size that resvg gives it, drawn by one of ``MODELS``.

    Raises:
        ImageError: not an SVG, or with something that the model cannot show.
    """
    size = svg_size(inspect_svg(text).root)
    if size is None:
        raise ImageError("says neither its size nor a viewBox")
    width, height = (max(1, math.floor(math.floor(side + 0.5) * scale + 0.5)) for side in size)
    if width * height > MAX_PIXELS:
        raise ImageError(f"makes more than {MAX_PIXELS // 1_000_000} million pixels")
    scene, has_background = scene_of(read_shapes(text, width, height, scale), width, height)
    if not has_background:
        scene = replace(scene, canvas=replace(scene.canvas, background=None))
    if model == "splat":
        try:
            scene = as_chains(scene)
        except ValueError as error:
            raise ImageError(f"{error}, not supported by the splat renderer") from None
    if len(scene):
        image = render(scene, model=MODELS[model], backend=backend)
    else:
        background = scene.canvas.background
        image = np.zeros((height, width, 4), np.float32)
        image = image if background is None else image[..., :3] + background
    packed = io.BytesIO()
    Image.fromarray(to_bytes(image)).save(packed, "PNG")
    return packed.getvalue()


def to_bytes(image: FloatArray) -> npt.NDArray[np.uint8]:
    """A rendered image in 8 bits; a transparent one, which is premultiplied, as PNGs have it."""
    color, alpha = image[..., :3], image[..., 3:]
    if alpha.shape[2]:
        image = np.concatenate([np.divide(color, alpha, out=np.zeros_like(color), where=alpha > 0), alpha], 2)
    return np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)
