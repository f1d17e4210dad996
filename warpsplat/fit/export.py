"""Export of a scene as the settings ask for."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
from PIL import Image

from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.settings import Settings
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.bridges import bridged
from warpsplat.scene.connected import separated
from warpsplat.scene.cutout import cut_out
from warpsplat.scene.simple import simple
from warpsplat.svg.viewer import on_white, premultiplied, render_own, render_svg
from warpsplat.svg.write import minified, rounded, shortened, write_svg


def export(scene: Scene, settings: Settings, per_pixel: float, metadata: str = "") -> str:
    """Return the SVG of ``scene``, with ``per_pixel`` units of its view box per pixel."""
    renderer = renderer_of(settings.renderer)
    return write_svg(
        renderer.to_paths(scene, settings),
        per_pixel=per_pixel,
        metadata=metadata,
        opacity_scale=renderer.opacity_scale,
        title=settings.title,
        ids=settings.ids,
        symbols=settings.symbols,
    )


def for_machines(scene: Scene, settings: Settings, per_pixel: float) -> Scene:
    """Return a scene with contours that machines accept, as far as the settings ask for them."""
    bridge = functools.partial(bridged, width=float(settings.bridges or 0))
    if settings.bridges:  # a stencil has no background
        scene = replace(scene, canvas=replace(scene.canvas, background=None))
    changes = (
        (simple, settings.simple),
        (cut_out, settings.stack == "cutout"),
        (bridge, settings.bridges),
        (separated, settings.separate),
    )
    for change, is_wanted in changes:
        scene = change(rounded(scene, per_pixel), per_pixel) if is_wanted else scene
    return scene


def finished(scene: Scene, settings: Settings, per_pixel: float, metadata: str = "") -> str:
    """Return ``export``'s SVG, as short as the settings allow."""
    text = export(scene, settings, per_pixel, metadata)
    if settings.minify:
        return minified(text)
    # Sheets are built from the usual head.
    return text if settings.sized_by else shortened(text)


def shown_paths(scene: Scene, settings: Settings) -> Scene:
    """Return the paths of ``scene``'s file with their opacities there; nothing is rounded."""
    renderer = renderer_of(settings.renderer)
    paths = renderer.to_paths(scene, settings)
    return replace(paths, opacities=paths.opacities * np.float32(renderer.opacity_scale))


def shown_image(text: str, scene: Scene, planes: int) -> FloatArray:
    """Return ``show``'s drawing as a target is given: sRGB in [0, 1], shape (height, width, planes)."""
    drawn = show(text, scene)
    return np.asarray((on_white(drawn) if planes == 3 else premultiplied(drawn)) / 255)


def show(text: str, scene: Scene) -> Image.Image:
    """Draw the file ``text`` of ``scene`` as a viewer does, with precautions if it embeds foreign markup."""
    return render_svg(text) if scene.pictures else render_own(text)
