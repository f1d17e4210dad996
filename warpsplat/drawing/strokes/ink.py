"""Ink and paper told apart: how much of each pixel is inked, and where the lines of ink are."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, dilated, eroded
from warpsplat.portable import filters
from warpsplat.scene import FloatArray


@dataclass(frozen=True)
class Ink:
    """The ink of a drawing."""

    cover: FloatArray
    """Inked share of each pixel, shape (height, width)."""
    mask: Bools
    """The pixels of lines, shape (height, width)."""
    shown: FloatArray
    """The image without transparency, sRGB in [0, 1], shape (height, width, 3)."""
    paper: FloatArray | None
    """The paper's colour, sRGB in [0, 1], shape (3,); None: transparent."""


SEED = 0.35  # contrast that a line must reach somewhere, over that of strong ink
FULL = 0.9  # least contrast of full ink, over that of strong ink

FAINTEST, FAINTEST_NOISE = 0.07, 5.0
"""Least contrast of ink with the paper around it, in [0, 1], and in standard deviations of the noise."""

WIDEST, LEAST_WIDEST = 0.05, 25
"""Width of the broadest line, over the longer side of the image, and at the least [px]: what is broader is
paper of another colour, or an area."""

WINDOW = 9
"""Side of the window in which ink is compared with the strongest beside it; thin tips cover fewer pixels."""


def find_ink(image: FloatArray, *, mixed: bool = False) -> Ink:
    """Tell ink and paper apart; paper may be coloured in places and unevenly lit.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).
        mixed: Whether what is coloured in is ink too.
    """
    shown, is_clear = _on_paper(image)
    paper = _median_color(shown).astype(np.float32)
    light = 1 - shown if paper.mean() < 0.4 else shown
    channels = _with_solid(_contrasts(light), light, mixed=mixed)
    contrast, most = channels.mean(axis=2), channels.max(axis=2)
    noise = _noise(contrast)
    floor = max(FAINTEST, FAINTEST_NOISE * noise)
    strong = _strong(contrast, floor)
    seed = max(floor, SEED * strong)
    strongest = cv2.dilate(contrast, np.ones((WINDOW, WINDOW), np.uint8))
    mask = contrast > np.maximum(0.5 * np.maximum(strongest, seed), floor)
    mass = across(contrast / np.float32(strong))
    faint = max(FAINT, FAINTEST_NOISE * noise / strong)
    mask = _without_specks(with_thin(mask, middles(mass, faint)), (contrast > seed) | (mass > 2 * faint))
    full = cv2.dilate(np.where(mask, most, 0), np.ones((LEAST_WIDEST, LEAST_WIDEST), np.uint8))
    # Ink that is lighter than elsewhere is thinner than a pixel, to some extent.
    full = np.maximum(filters.box_blur(full, WINDOW), FULL * _strong(most, floor))
    cover = np.where(dilated(mask, 5) & (contrast > 0.5 * floor), np.clip(most / (full - 2 * noise), 0, 1), 0)
    cover[eroded(mask, 5)] = 1
    return Ink(cover.astype(np.float32), mask, shown, None if is_clear else paper)


def _on_paper(image: FloatArray) -> tuple[FloatArray, bool]:
    """Return the image on white, or on black where its ink is light, and whether its border is clear."""
    if image.shape[2] == 3:
        return np.asarray(image, np.float32), False
    opacity = image[..., 3:]
    is_clear = bool(np.median(np.concatenate([opacity[[0, -1]].ravel(), opacity[:, [0, -1]].ravel()])) < 0.5)
    light = float(image[..., :3].sum() / max(3 * float(opacity.sum()), 1e-6))
    behind = 0.0 if is_clear and light > 0.7 else 1.0
    return np.asarray(image[..., :3] + (1 - opacity) * behind, np.float32), is_clear


def _median_color(image: FloatArray) -> FloatArray:
    """Return the median of some pixels, shape (3,)."""
    return np.asarray(np.median(image.reshape(-1, 3)[:: max(1, image.size // 300_000)], axis=0))


def _contrasts(light: FloatArray) -> FloatArray:
    """Return how much darker than the paper around it each pixel is, shape (height, width, 3)."""
    side = 2 * round(max(LEAST_WIDEST, WIDEST * max(light.shape[:2])) / 2) + 1
    levels = np.round(255 * np.clip(light, 0, 1)).astype(np.uint8)
    return np.clip(cv2.medianBlur(levels, side) / np.float32(255) - light, 0, 1)


def _strong(contrast: FloatArray, floor: float) -> float:
    """Return the contrast of strong ink."""
    dark = contrast[contrast > floor]
    return float(np.percentile(dark, 90)) if len(dark) else 1.0


def _with_solid(channels: FloatArray, light: FloatArray, *, mixed: bool) -> FloatArray:
    """Return the contrasts with the paper of the whole image where that is as strong as in lines.

    What is broad and as dark as ink is no paper; if ``mixed``, nor is what is as strong in any channel.
    """
    whole = np.clip(_median_color(light) - light, 0, 1)
    lines = channels.mean(axis=2) > 0.5 * _strong(channels.mean(axis=2), FAINTEST)
    ink = np.median(whole[lines], axis=0) if lines.any() else np.maximum(whole.max(axis=(0, 1)), FAINTEST)
    solid = whole.max(axis=2) > FULL * ink.max() if mixed else (whole >= FULL * ink).all(axis=2)
    # With its edge, whose pixels are mixed.
    return np.where(dilated(solid, 3)[..., None], np.maximum(channels, whole), channels)


def _noise(contrast: FloatArray) -> float:
    """Return the standard deviation of the noise, from the second differences of most pixels."""
    rough = np.diff(np.diff(np.pad(contrast, 1, mode="reflect"), n=2, axis=0), n=2, axis=1)
    return float(np.median(np.abs(rough))) / (0.6745 * 6)


def _without_specks(mask: Bools, seeds: Bools) -> Bools:
    """Return the parts of ``mask`` of more than a pixel with seeds, without pinholes."""
    half_width = float(mask.sum()) / max(1, int((mask & ~eroded(mask, 3)).sum()))
    _, parts, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    held = (stats[:, cv2.CC_STAT_AREA] > 1) & (np.bincount(parts[seeds], minlength=len(stats)) > 0)
    held[0] = False
    inked = held[parts]
    _, parts, stats, _ = cv2.connectedComponentsWithStats((~inked).astype(np.uint8), connectivity=4)
    pinholes = stats[:, cv2.CC_STAT_AREA] < max(2, half_width * half_width)
    pinholes[0] = False
    return np.asarray(inked | pinholes[parts], np.bool_)


SPREAD = 0.8  # [px] standard deviation of the filter by which ink across lines is measured

FAINT = 0.12
"""Ink across a line from which on it goes on; it must have twice as much somewhere [px of full ink]."""


def across(ink: FloatArray, fine: int = 1) -> FloatArray:
    """Return how much ink lies across a thin line through each pixel [px of full ink]; nothing beside lines.

    A line of mass m that is blurred to s has the second derivative -m / (sqrt(2 pi) s^3) in its middle.

    Args:
        ink: Share of full ink, shape (height, width).
        fine: Pixels of the result on a pixel's side.

    Returns:
        Shape (fine * height, fine * width); less than their width in broader lines.
    """
    if fine > 1:
        ink = filters.resize_cubic(ink, (ink.shape[1] * fine, ink.shape[0] * fine))
    soft = filters.gaussian_blur(ink, SPREAD * fine, "replicate")
    padded = np.pad(soft, 1, mode="edge")
    middle = padded[1:-1, 1:-1]
    xx = padded[1:-1, 2:] - 2 * middle + padded[1:-1, :-2]
    yy = padded[2:, 1:-1] - 2 * middle + padded[:-2, 1:-1]
    xy = 0.25 * (padded[2:, 2:] + padded[:-2, :-2] - padded[2:, :-2] - padded[:-2, 2:])
    bend = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    spread = fine * math.sqrt(SPREAD * SPREAD + 1 / 12)  # with that of the pixels
    scale = math.sqrt(2 * math.pi) * spread * spread * spread / fine
    return np.asarray(np.maximum(-bend, 0) * scale, np.float32)


def middles(mass: FloatArray, least: float, fine: int = 1) -> Bools:
    """Return the pixels in the middle of lines with at least so much ink across; arguments as ``across``."""
    most = cv2.dilate(mass, np.ones((2 * fine + 1, 2 * fine + 1), np.uint8))
    return np.asarray((mass > least) & (2 * mass > most), np.bool_)


def with_thin(mask: Bools, thin: Bools, fine: int = 1) -> Bools:
    """Add thin lines to a mask that go on where it ends, or that are long; not the tips of its corners.

    Args:
        mask: Of ink, shape (height, width).
        thin: Middles of lines, shape (height, width).
        fine: Pixels of both on a pixel's side.
    """
    _, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    count, links, stats, _ = cv2.connectedComponentsWithStats((thin & ~mask).astype(np.uint8), connectivity=8)
    rows, columns = np.nonzero(links)
    padded = np.pad(parts, 1)
    beside = np.stack([padded[rows + down, columns + right] for down in range(3) for right in range(3)])
    pairs = np.stack([np.broadcast_to(links[rows, columns], beside.shape), beside], axis=-1).reshape(-1, 2)
    pairs = np.unique(pairs[pairs[:, 1] > 0], axis=0)
    held = np.bincount(pairs[:, 0], minlength=count) > 1
    held |= stats[:, cv2.CC_STAT_AREA] >= WINDOW * fine * fine
    held[0] = False
    return np.asarray(mask | held[links], np.bool_)
