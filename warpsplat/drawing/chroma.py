"""Fit drawings by lightness alone if the image stores colours at half its resolution, as JPEG does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.tidy import Finished, finish_drawing
from warpsplat.drawing.trace.regions import NEGLIGIBLE_NOISE
from warpsplat.drawing.trace.seeds import noise_of
from warpsplat.fit.problem import Run
from warpsplat.scene import FloatArray

LIGHTNESS = np.array([0.299, 0.587, 0.114], np.float32)
"""Shares of the channels in what JPEG keeps at full resolution (ITU-T T.871)."""

BLURRED = 0.75
"""Sharpness of colours over that of lightness, below which their resolution is lower."""

CHROMA_WEIGHT = 0.25
"""Weight of what is blurred: some, as colours may be of one lightness."""


def finish_by_lightness(target: FloatArray, drawing: Drawing, run: Run, **options: Any) -> Finished:
    """Finish a drawing as ``finish_drawing``, mostly by lightness where the image's colours are blurred.

    Its PSNR is NaN then.
    """
    if not has_blurred_colors(target):
        return finish_drawing(target, drawing, run, **options)
    scene, ground = drawing.scene, drawing.scene.canvas.background
    canvas = replace(scene.canvas, background=None if ground is None else _dull(ground))
    dull = replace(scene, colors=_dull(scene.colors), stop_colors=_dull(scene.stop_colors), canvas=canvas)
    done = finish_drawing(_dull(target), replace(drawing, scene=dull), run, **options)
    own = {name: getattr(scene, name) for name in ("colors", "stop_colors", "canvas")}
    return done._replace(drawing=replace(done.drawing, scene=replace(done.drawing.scene, **own)), psnr=np.nan)


def has_blurred_colors(image: FloatArray) -> bool:
    """Return whether an image has noise, and the edges of its colours are less sharp than those of lightness.

    ``image``: as for ``finish_drawing``; one with opacity is no JPEG.
    """
    if image.shape[2] != 3 or noise_of(image * np.float32(255)) < NEGLIGIBLE_NOISE:
        return False
    light = (image * LIGHTNESS).sum(axis=2, keepdims=True)
    return _sharpness(image - light) < BLURRED * _sharpness(light)


def _sharpness(image: FloatArray) -> float:
    """Return the sum of the squared second differences along rows and columns over that of the first ones."""
    sums = [sum(float((np.diff(image, n, axis) ** 2).sum()) for axis in (0, 1)) for n in (1, 2)]
    return sums[1] / sums[0] if sums[0] > 0 else np.inf


def _dull(colors: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return colours, shape (..., 3) or (..., 4), nearer to grey."""
    light = (colors[..., :3] * LIGHTNESS).sum(axis=-1, keepdims=True)
    dull = colors.copy()
    dull[..., :3] = light + np.float32(CHROMA_WEIGHT) * (colors[..., :3] - light)
    return dull
