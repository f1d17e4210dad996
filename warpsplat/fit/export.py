"""The file that settings ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PIL import Image

from warpsplat.fit.as_paths import as_paths
from warpsplat.fit.settings import Settings
from warpsplat.kernels import constants
from warpsplat.scene import Scene
from warpsplat.svg.viewer import render_own, render_svg
from warpsplat.svg.write import minified, shortened, write_svg


def export(scene: Scene, settings: Settings, per_pixel: float, metadata: str = "") -> str:
    """The file that ``settings`` ask for, with ``per_pixel`` units of its view box a pixel."""
    if settings.renderer == "gaussian":
        scene = as_paths(scene, settings.softness)
    return write_svg(
        scene,
        per_pixel=per_pixel,
        metadata=metadata,
        opacity_scale=_opacity_scale(settings),
        title=settings.title,
        ids=settings.ids,
    )


def shown_paths(scene: Scene, settings: Settings) -> Scene:
    """The paths of the file of ``scene``, with the opacities that they have there; nothing is rounded."""
    if settings.renderer == "gaussian":
        return as_paths(scene, settings.softness)
    return replace(scene, opacities=scene.opacities * np.float32(_opacity_scale(settings)))


def _opacity_scale(settings: Settings) -> float:
    """Opacity of a path over that of its shape."""
    return constants.PLATEAU if settings.renderer == "splat" else 1.0


def finished(scene: Scene, settings: Settings, per_pixel: float, metadata: str = "") -> str:
    """As ``export``, as short as the settings allow."""
    text = export(scene, settings, per_pixel, metadata)
    if settings.minify:
        return minified(text)
    # A sheet is made of the usual head.
    return text if settings.size or settings.page or settings.units else shortened(text)


def show(text: str, scene: Scene) -> Image.Image:
    """The file ``text`` of a scene, as a viewer draws it; what it keeps of other files with precautions.

    Raises:
        ImageError: what it keeps cannot be drawn.
    """
    return render_svg(text) if scene.pictures else render_own(text)
