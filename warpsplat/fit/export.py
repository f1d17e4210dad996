"""Export of a scene as the settings ask for."""

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
    """Return the SVG of ``scene``, with ``per_pixel`` units of its view box per pixel."""
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


def finished(scene: Scene, settings: Settings, per_pixel: float, metadata: str = "") -> str:
    """Return ``export``'s SVG, as short as the settings allow."""
    text = export(scene, settings, per_pixel, metadata)
    if settings.minify:
        return minified(text)
    # Sheets are built from the usual head.
    return text if settings.size or settings.page or settings.units else shortened(text)


def shown_paths(scene: Scene, settings: Settings) -> Scene:
    """Return the paths of ``scene``'s file with their opacities there; nothing is rounded."""
    if settings.renderer == "gaussian":
        return as_paths(scene, settings.softness)
    return replace(scene, opacities=scene.opacities * np.float32(_opacity_scale(settings)))


def _opacity_scale(settings: Settings) -> float:
    """Return the opacity of a path over that of its shape."""
    return constants.PLATEAU if settings.renderer == "splat" else 1.0


def show(text: str, scene: Scene) -> Image.Image:
    """Draw the file ``text`` of ``scene`` as a viewer does, with precautions if it embeds foreign markup.

    Raises:
        ImageError: the embedded markup cannot be drawn.
    """
    return render_svg(text) if scene.pictures else render_own(text)
