"""The text of a result's file, within a limit of bytes and on a sheet."""

from __future__ import annotations

import numpy as np

from warpsplat.fit.export import finished
from warpsplat.fit.settings import Settings
from warpsplat.scene import Scene
from warpsplat.scene.geometry import areas
from warpsplat.svg.page import placed


def export_within(scene: Scene, settings: Settings, per_pixel: float, metadata: str) -> tuple[str, Scene]:
    """Return the SVG and its shapes: all, or those that show most if ``max_bytes`` allows no more."""

    def made() -> tuple[str, int]:
        text = finished(scene, settings, per_pixel, metadata)
        return text, len(on_paper(text, settings).encode())

    svg, size = made()
    while settings.max_bytes and size > settings.max_bytes and len(scene) > 1:
        excess = 1 - settings.max_bytes / size
        count = min(max(1, round(excess * len(scene))), len(scene) - 1)
        seen = areas(scene) * scene.opacities
        scene = scene.take(np.sort(np.argsort(seen, kind="stable")[count:]))
        svg, size = made()
    return svg, scene


def on_paper(svg: str, settings: Settings) -> str:
    """Return ``svg`` on the sheet that ``settings`` ask for, if any."""
    return placed(svg, settings.size, settings.page, settings.units)
