"""The file as a viewer shows it, and how far that is from the image.

All figures are taken in 8-bit sRGB from a render by resvg, an independent renderer.
"""

from __future__ import annotations

import gzip
from dataclasses import asdict, dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.errors import ImageError
from warpsplat.inspect_svg import inspect_svg
from warpsplat.viewer import Pixels, on_white, render_own, render_svg

SSIM_WINDOW = 11


def psnr(a: Pixels, b: Pixels) -> float:
    """Peak signal-to-noise ratio [dB] of two arrays in 0..255; infinite where they are equal."""
    error = float(np.mean((a - b) ** 2))
    return float("inf") if error == 0 else float(10 * np.log10(255.0**2 / error))


def ssim(a: Pixels, b: Pixels) -> float | None:
    """Structural similarity (Wang et al. 2004), Gaussian window of 11x11, sigma 1.5, mean over channels.

    None for an image smaller than the window.
    """
    if min(a.shape[:2]) <= SSIM_WINDOW:
        return None
    return float(_ssim_maps(a, b)[0].mean())


def _ssim_maps(a: Pixels, b: Pixels) -> tuple[Pixels, Pixels]:
    """SSIM and its contrast-structure factor where the window fits."""
    inner = SSIM_WINDOW // 2

    def blur(x: Pixels) -> Pixels:
        return np.asarray(cv2.GaussianBlur(x, (SSIM_WINDOW, SSIM_WINDOW), 1.5)[inner:-inner, inner:-inner])

    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    mean_a, mean_b = blur(a), blur(b)
    var_a, var_b = blur(a * a) - mean_a**2, blur(b * b) - mean_b**2
    covariance = blur(a * b) - mean_a * mean_b
    luminance = (2 * mean_a * mean_b + c1) / (mean_a**2 + mean_b**2 + c1)
    contrast = (2 * covariance + c2) / (var_a + var_b + c2)
    return luminance * contrast, contrast


MS_SSIM_WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Of the five scales (Wang et al. 2003, section 3.2)."""


def ms_ssim(a: Pixels, b: Pixels) -> float | None:
    """Multi-scale structural similarity (Wang et al. 2003); scales are halved by area.

    None for an image of which the smallest scale has no room for the window.
    """
    value = 1.0
    for scale, weight in enumerate(MS_SSIM_WEIGHTS):
        if min(a.shape[:2]) < 2 * SSIM_WINDOW:
            return None
        full, contrast = _ssim_maps(a, b)
        last = scale == len(MS_SSIM_WEIGHTS) - 1
        value *= max(float((full if last else contrast).mean()), 0.0) ** weight
        half = (a.shape[1] // 2, a.shape[0] // 2)
        a = np.asarray(cv2.resize(a, half, interpolation=cv2.INTER_AREA))
        b = np.asarray(cv2.resize(b, half, interpolation=cv2.INTER_AREA))
    return value


@dataclass(frozen=True)
class Score:
    """Figures of one file against its image."""

    psnr: float
    """[dB]"""
    ssim: float | None
    ms_ssim: float | None
    paths: int
    nodes: int
    """Points that the paths pass through, with those of basic shapes counted as one each."""
    bytes: int
    gzip_bytes: int

    def as_dict(self) -> dict[str, Any]:
        """For JSON; rounded to what the measurement is worth."""
        values = asdict(self)
        values["psnr"] = round(self.psnr, 3) if np.isfinite(self.psnr) else None
        for name in ("ssim", "ms_ssim"):
            values[name] = None if values[name] is None else round(values[name], 4)
        return values


def score_svg(text: str, target: npt.NDArray[np.floating], *, own: bool = False) -> Score:
    """Render ``text`` at the size of ``target`` (sRGB in [0, 1], (height, width, 3)) and compare.

    ``own`` says that this program wrote the text just now: it is drawn without precautions.

    Raises:
        ImageError: not an SVG, one that cannot be drawn, or one of other proportions.
    """
    height, width = target.shape[:2]
    image = render_own(text) if own else render_svg(text, width=width, height=height)
    if image.size != (width, height):
        raise ImageError(f"renders as {image.width}x{image.height}, the image has {width}x{height} pixels")
    shown = on_white(image)
    wanted = np.round(target.astype(np.float64) * 255)
    data = text.encode()
    facts = inspect_svg(text)
    return Score(
        psnr=psnr(shown, wanted),
        ssim=ssim(shown, wanted),
        ms_ssim=ms_ssim(shown, wanted),
        paths=facts.paths,
        nodes=facts.nodes,
        bytes=len(data),
        gzip_bytes=len(gzip.compress(data, 9, mtime=0)),
    )
