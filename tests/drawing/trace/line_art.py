"""Line art of which every stroke is known."""

from __future__ import annotations

import cv2
import numpy as np

from tests.drawing.trace import drawings
from warpsplat.drawing.strokes.ink import find_ink
from warpsplat.drawing.strokes.lines import trace_ink
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.viewer import render_svg

PEN = 'fill="none" stroke="#000" stroke-width="3" stroke-linecap="round"'


def drawn(paths: str, width: int = 96, height: int = 72, ground: str = "#fff") -> FloatArray:
    """A picture of SVG paths, sRGB in [0, 1], shape (height, width, 3)."""
    return drawings.draw(f"{drawings.ground(ground, width, height)}<g {PEN}>{paths}</g>", width, height)


def traced(image: FloatArray) -> Scene:
    """The strokes of line art."""
    return trace_ink(find_ink(image)).scene()


CROSS = '<path d="M20 12L76 60"/><path d="M22 58L78 16"/>'
TEE = '<path d="M10 20H86"/><path d="M48 20V62"/>'


def shown(svg: str) -> np.ndarray:
    """Where a file is painted, shape (height, width): its strokes' share of each pixel."""
    return np.asarray(render_svg(svg).convert("RGBA"), np.float32)[..., 3] / 255


def grown(mask: np.ndarray) -> np.ndarray:
    """The pixels within 1 px of those of a mask."""
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    return np.asarray(cv2.dilate(mask.astype(np.uint8), cross) > 0)
