"""Fit drawings by lightness alone if the image stores colours at half its resolution, as JPEG does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.constraints import Drawing, Finished
from warpsplat.drawing.denoise import LIGHTNESS, has_blurred_colors
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.fit.problem import Run
from warpsplat.scene import FloatArray

CHROMA_WEIGHT = 0.25
"""Weight of what is blurred: some, as colours may be of one lightness."""


def finish_by_lightness(
    target: FloatArray, drawing: Drawing, run: Run, *, seen: FloatArray | None = None, **options: Any
) -> Finished:
    """Finish a drawing as ``finish_drawing``, mostly by lightness where the image's colours are blurred.

    Its PSNR is NaN then.
    """
    if not has_blurred_colors(target):
        return finish_drawing(target, drawing, run, seen=seen, **options)
    scene, ground = drawing.scene, drawing.scene.canvas.background
    canvas = replace(scene.canvas, background=None if ground is None else _dull(ground))
    dull = replace(scene, colors=_dull(scene.colors), stop_colors=_dull(scene.stop_colors), canvas=canvas)
    options["seen"] = None if seen is None else _dull(seen)
    done = finish_drawing(_dull(target), replace(drawing, scene=dull), run, **options)
    own = {name: getattr(scene, name) for name in ("colors", "stop_colors", "canvas")}
    return done._replace(drawing=replace(done.drawing, scene=replace(done.drawing.scene, **own)), psnr=np.nan)


def _dull(colors: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return colours, shape (..., 3) or (..., 4), nearer to grey."""
    light = (colors[..., :3] * LIGHTNESS).sum(axis=-1, keepdims=True)
    dull = colors.copy()
    dull[..., :3] = light + np.float32(CHROMA_WEIGHT) * (colors[..., :3] - light)
    return dull
