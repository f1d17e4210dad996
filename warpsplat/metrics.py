"""Quality of a file: its rendering by resvg, an independent viewer, compared with the image in 8-bit sRGB."""

from __future__ import annotations

import functools
import gzip
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.field_docs import described
from warpsplat.native import STRIP_PIXELS
from warpsplat.portable import elementary
from warpsplat.ssimulacra2 import ssimulacra2
from warpsplat.svg.inspect import inspect_svg
from warpsplat.svg.viewer import WHOLE_PIXELS, Bytes, Stop, check_stop, draw, rows_of

Floats = npt.NDArray[np.floating]

SSIM_WINDOW = 11

MIDDLE = np.float32(128)
"""Subtracted before variances are computed, so that 32 bits suffice for them."""

MS_SSIM_WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Weights of the five scales (Wang et al. 2003, section 3.2)."""


class Rows(Protocol):
    """An image by rows: an array, or an object that makes them on demand."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Return height, width and channels."""

    def __getitem__(self, rows: slice, /) -> Floats:
        """Return rows, shape (row, width, channels)."""


@dataclass(frozen=True)
class Pair:
    """A channel of two images, in [0, 255]."""

    width: int
    height: int
    rows: Callable[[slice], tuple[Floats, Floats]]
    """Returns rows of both, each of shape (row, width)."""

    @staticmethod
    def of(a: Floats, b: Floats) -> Pair:
        """Return a pair of arrays, shape (height, width)."""
        return Pair(a.shape[1], a.shape[0], lambda rows: (a[rows], b[rows]))


def psnr(a: Floats, b: Floats) -> float:
    """Return the peak signal-to-noise ratio [dB] of two arrays in [0, 255]; infinite if they are equal."""
    return decibels(float(np.mean((a - b) ** 2, dtype=np.float64)))


def decibels(error: float) -> float:
    """Return the PSNR [dB] of a mean squared error of levels in [0, 255]; infinite for 0."""
    return float("inf") if error == 0 else float(10 * elementary.log10(65025 / error))


def similarities(a: Floats, b: Floats) -> tuple[float | None, float | None]:
    """Return SSIM and MS-SSIM of images (height, width, channel) in [0, 255].

    Structural similarity (Wang et al. 2004) with a Gaussian window of 11x11, sigma 1.5, mean over channels;
    that of several scales (Wang et al. 2003), halved by area. None: the smallest scale is smaller than the
    window.
    """
    planes = ([np.ascontiguousarray(x[..., i], np.float32) for x in (a, b)] for i in range(a.shape[2]))
    return _figures(Pair.of(*plane) for plane in planes)[1:]


def _figures(pairs: Iterable[Pair], stop: Stop | None = None) -> tuple[float, float | None, float | None]:
    """Return PSNR, SSIM and MS-SSIM of channels, holding the maps of one strip at a time."""
    errors, scales = [], []
    for pair in pairs:
        errors.append(_squared_error(pair))
        scales.append(_similarities(pair, stop))
    similar = np.mean(scales, axis=0)  # [scale, (SSIM, contrast)]
    single = None if len(similar) == 0 else float(similar[0, 0])
    multiple = None
    if len(similar) == len(MS_SSIM_WEIGHTS):
        factors = np.append(similar[:-1, 1], similar[-1, 0])
        multiple = float(np.prod(elementary.power(np.maximum(factors, 0.0), MS_SSIM_WEIGHTS)))
    return decibels(float(np.mean(errors))), single, multiple


def _squared_error(pair: Pair) -> float:
    """Return the mean squared error."""
    total = 0.0
    for rows in rows_of(pair.width, pair.height):
        a, b = pair.rows(rows)
        total += float(np.square(a - b).sum(dtype=np.float64))
    return total / (pair.width * pair.height)


def _similarities(pair: Pair, stop: Stop | None) -> list[tuple[float, float]]:
    """Return the mean SSIM and contrast-structure factor of each scale that is larger than the window."""
    values: list[tuple[float, float]] = []
    while min(pair.width, pair.height) >= (2 * SSIM_WINDOW if values else SSIM_WINDOW + 1):
        values.append(_similarity(pair, stop))
        if len(values) == len(MS_SSIM_WEIGHTS) or min(pair.width, pair.height) < 2 * SSIM_WINDOW:
            break
        pair = _halved(pair)
    return values


def _halved(pair: Pair) -> Pair:
    """Return both images at half the size, by area; strip by strip if both sides are even."""
    width, height = pair.width // 2, pair.height // 2
    step = height
    if pair.width % 2 == pair.height % 2 == 0:
        step = max(1, STRIP_PIXELS // (2 * pair.width))
    halves = np.empty((2, height, width), np.float32)
    for top in range(0, height, step):
        bottom = min(top + step, height)
        whole = slice(2 * top, pair.height if bottom == height else 2 * bottom)
        for half, plane in zip(halves, pair.rows(whole), strict=True):
            half[top:bottom] = cv2.resize(plane, (width, bottom - top), interpolation=cv2.INTER_AREA)
    return Pair.of(halves[0], halves[1])


def _similarity(pair: Pair, stop: Stop | None) -> tuple[float, float]:
    """Return the means of SSIM and of its contrast-structure factor, where the window fits."""
    width, height = pair.width, pair.height
    total = np.zeros(2)
    for rows in rows_of(width, height, SSIM_WINDOW - 1):
        check_stop(stop)
        a, b = pair.rows(rows)
        total += _similarity_sums(a - MIDDLE, b - MIDDLE)
    total /= (height - SSIM_WINDOW + 1) * (width - SSIM_WINDOW + 1)
    return float(total[0]), float(total[1])


def _similarity_sums(a: Floats, b: Floats) -> tuple[float, float]:
    """Return sums of both over a strip of values about ``MIDDLE``."""
    inner = SSIM_WINDOW // 2

    def blur(x: Floats) -> Floats:
        return np.asarray(cv2.GaussianBlur(x, (SSIM_WINDOW, SSIM_WINDOW), 1.5)[inner:-inner, inner:-inner])

    c1, c2 = np.float32((0.01 * 255) ** 2), np.float32((0.03 * 255) ** 2)
    mean_a, mean_b = blur(a), blur(b)
    variances = blur(a * a + b * b) - mean_a * mean_a - mean_b * mean_b
    covariance = blur(a * b) - mean_a * mean_b
    contrast = (2 * covariance + c2) / (variances + c2)
    mean_a, mean_b = mean_a + MIDDLE, mean_b + MIDDLE
    luminance = (2 * mean_a * mean_b + c1) / (mean_a * mean_a + mean_b * mean_b + c1)
    return float((luminance * contrast).sum(dtype=np.float64)), float(contrast.sum(dtype=np.float64))


@described
@dataclass(frozen=True)
class Score:
    """Figures of a file compared with its image."""

    psnr: float
    """Peak signal-to-noise ratio [dB]; infinite if the file shows the very image."""
    ssim: float | None
    """Structural similarity, at most 1; None: the image is too small."""
    ms_ssim: float | None
    """The same on several scales; None: the image is too small."""
    ssimulacra2: float | None
    """SSIMULACRA2, 100 for equal images; None: it was not measured, or the image is too small."""
    paths: int
    """Elements that draw: paths, rectangles, circles, ellipses, lines, polylines and polygons. Not counted
    are clips, masks, and a background: a rectangle that fills the view box behind the others.
    """
    nodes: int
    """Points that the paths pass through; other elements count as one."""
    bytes: int
    """Size of the file."""
    gzip_bytes: int
    """Its size, compressed."""

    def of_file(self, text: str) -> Score:
        """Return the figures for another file, ``text``, of the same picture."""
        return replace(self, **_sizes(text))

    def as_dict(self) -> dict[str, Any]:
        """Return the figures for JSON, rounded to their accuracy; an infinite PSNR is None."""
        values = asdict(self)
        values["exact"] = bool(np.isposinf(self.psnr))
        values["psnr"] = None if values["exact"] else round(self.psnr, 3)
        for name in ("ssim", "ms_ssim"):
            values[name] = None if values[name] is None else round(values[name], 4)
        values["ssimulacra2"] = None if self.ssimulacra2 is None else round(self.ssimulacra2, 2)
        return values


def score_svg(
    text: str,
    target: Rows,
    *,
    own: bool = False,
    perceptual: bool = True,
    stop: Callable[[], bool] | None = None,
) -> Score:
    """Render ``text`` at the size of ``target`` and compare.

    With opacity they are compared on black and on white, and the figures are of where they differ more.
    Besides ``target`` this takes about 6 bytes a pixel (12 if a side is odd), with SSIMULACRA2 200.

    Args:
        text: The SVG.
        target: The image, sRGB in [0, 1], shape (height, width, 3), for which transparent parts of the file
            are white; or premultiplied with opacity, shape (height, width, 4).
        own: Whether this program wrote the text just now, so that it is drawn without precautions.
        perceptual: Whether to measure SSIMULACRA2, of images that are neither too small nor too large.
        stop: Called every few tenths of a second; once true, the work is given up.

    Raises:
        ImageError: Not an SVG, one that cannot be drawn, or one of other proportions.
        Stopped: ``stop`` returned true.
    """
    height, width = target.shape[:2]
    shown = draw(text, width, height, stop, own=own)
    papers = _papers(target)
    paper = papers[0] if len(papers) == 1 else max(papers, key=lambda level: _error(shown, target, level))
    fidelity, single, multiple = _figures(_shown_and_wanted(shown, target, paper), stop)
    check_stop(stop)
    # Largest image that SSIMULACRA2 is measured for [pixels]: it takes 200 bytes a pixel.
    ssimulacra2_pixels = 4_000_000
    perceptual = perceptual and height * width <= ssimulacra2_pixels
    seen = ssimulacra2(*_in_8_bits(shown, target, paper)) if perceptual else None
    facts = inspect_svg(text)
    return Score(
        psnr=fidelity,
        ssim=single,
        ms_ssim=multiple,
        ssimulacra2=seen,
        paths=facts.paths,
        nodes=facts.nodes,
        **_sizes(text),
    )


def psnr_of_file(text: str, target: Rows) -> float:
    """Return the PSNR of ``score_svg`` for a file that this program wrote just now."""
    shown = draw(text, target.shape[1], target.shape[0], own=True)
    return decibels(max(_error(shown, target, paper) for paper in _papers(target)))


def _papers(target: Rows) -> tuple[int, ...]:
    """Return the levels of grey that a picture is compared on: black and white if ``target`` has opacity."""
    return (0, 255) if target.shape[2] == 4 else (255,)


def _sizes(text: str) -> dict[str, int]:
    """Return the fields of ``Score`` about sizes."""
    data = text.encode()
    return {"bytes": len(data), "gzip_bytes": len(gzip.compress(data, 9, mtime=0))}


def _error(shown: Bytes, target: Rows, paper: int) -> float:
    """Return the mean squared error on grey of level ``paper``."""
    return float(np.mean([_squared_error(pair) for pair in _shown_and_wanted(shown, target, paper)]))


def _shown_and_wanted(shown: Bytes, target: Rows, paper: int) -> Iterator[Pair]:
    """Yield the channels of ``shown`` and of ``target``, in 8-bit levels, on grey of level ``paper``.

    Those of large images are computed strip by strip on demand.
    """
    height, width, _ = target.shape
    levels = _levels(target, paper)
    is_opaque = bool((shown[..., 3] == 255).all())

    def rows_for(channel: int, rows: slice) -> tuple[Floats, Floats]:
        flat = shown[rows, :, channel].astype(np.float32)
        if not is_opaque:
            alpha = shown[rows, :, 3] / np.float32(255)
            flat = np.asarray(flat * alpha + np.float32(paper) * (1 - alpha), np.float32)
        return flat, levels[rows, :, channel].astype(np.float32)

    for channel in range(3):
        make = functools.partial(rows_for, channel)
        yield Pair(width, height, make) if width * height > WHOLE_PIXELS else Pair.of(*make(slice(0, height)))


def _levels(target: Rows, paper: int) -> Bytes:
    """Return an image in 8-bit levels on grey of level ``paper``, shape (height, width, 3)."""
    height, width, channels = target.shape
    levels = np.empty((height, width, 3), np.uint8)
    for rows in rows_of(width, height):
        part = target[rows]
        wanted = part[..., :3] * np.float32(255)
        if channels == 4:
            wanted += np.float32(paper) * (1 - part[..., 3:])
        levels[rows] = np.round(wanted, out=wanted)
    return levels


def _in_8_bits(shown: Bytes, target: Rows, paper: int) -> tuple[Bytes, Bytes]:
    """Return ``target`` and ``shown`` on grey of level ``paper``, shape (height, width, 3)."""
    height, width, _ = target.shape
    a, b = (np.empty((height, width, 3), np.uint8) for _ in range(2))
    for channel, pair in enumerate(_shown_and_wanted(shown, target, paper)):
        for rows in rows_of(width, height):
            flat, wanted = pair.rows(rows)
            a[rows, :, channel], b[rows, :, channel] = wanted, np.round(flat)
    return a, b
