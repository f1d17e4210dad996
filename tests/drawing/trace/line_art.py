"""Line art of which every stroke is known."""

from __future__ import annotations

import cv2
import numpy as np

from warpsplat.drawing.strokes.ink import find_ink
from warpsplat.drawing.strokes.lines import trace_ink
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.viewer import on_white, render_svg


def drawn(paths: str, width: int = 96, height: int = 72, ground: str = "#fff") -> np.ndarray:
    """A picture of SVG paths, sRGB in [0, 1], shape (height, width, 3)."""
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">'
        f'<rect width="{width}" height="{height}" fill="{ground}"/>'
        f'<g fill="none" stroke="#000" stroke-width="3" stroke-linecap="round">{paths}</g></svg>'
    )
    return np.asarray(on_white(render_svg(text)), np.float32) / np.float32(255)


def traced(image: FloatArray) -> Scene:
    """The strokes of line art."""
    return trace_ink(find_ink(image)).scene


CROSS = '<path d="M20 12L76 60"/><path d="M22 58L78 16"/>'
TEE = '<path d="M10 20H86"/><path d="M48 20V62"/>'


def shown(svg: str) -> np.ndarray:
    """Where a file is painted, shape (height, width): its strokes' share of each pixel."""
    return np.asarray(render_svg(svg).convert("RGBA"), np.float32)[..., 3] / 255


def grown(mask: np.ndarray) -> np.ndarray:
    """The pixels within 1 px of those of a mask."""
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    return np.asarray(cv2.dilate(mask.astype(np.uint8), cross) > 0)
