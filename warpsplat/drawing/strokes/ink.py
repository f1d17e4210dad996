"""Ink and paper told apart: how much of each pixel is inked, and where the lines of ink are."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.strokes.ridges import FAINT, NOISY, SURE, across, middles, with_thin
from warpsplat.drawing.trace.grids import Bools
from warpsplat.portable import filters
from warpsplat.scene import FloatArray

BROAD = 0.05
"""Width from which on what is dark is paper of another colour, over the longer side of the picture."""

LEAST_BROAD = 25
"""The same in a small picture [px]."""

REDUCED = 512
"""Longer side of the picture that the paper is looked for in, about [px]."""

FAINTEST = 0.07
"""Least contrast of ink with the paper around it, in [0, 1]."""

NOISE = 5.0
"""The same in standard deviations of the paper's noise."""

SEED = 0.35
"""Contrast that a line must reach somewhere, over that of strong ink."""

TEXTURED_SEED, TEXTURED_SPECK, TEXTURED_SHARE = 0.45, 4.0, 0.6
"""SEED and SPECK of a picture that is coloured in, where crayons leave a texture, and the share of a piece of
ink that has the contrast of a seed.
"""

NEAR = 9
"""Side of the window in which ink is compared with the strongest beside it [px]."""

BESIDE = 31
"""Side of the window that knows what full ink is [px]."""

SOLID = 0.9
"""Contrast with the picture's paper from which on what is broad is ink, over that of lines."""

FULL, TEXTURED_FULL = 0.9, 0.7
"""Contrast of full ink over that of strong ink, at the least; and in a picture that is coloured in."""

TINT, PAINTED = 0.05, 0.05
"""How far a channel of an area differs from the paper more than the others do, if it is coloured in, and the
share of such areas from which on lines must be dark."""

CLEAR = 0.02
"""Share of clear pixels from which on a picture has no paper."""

SPECK, SMALLEST = 0.7, 3.0
"""Area of the least piece of ink, over the square of a line's width, and at the least [px]."""

DARK, LEAST_DOT = 0.6, 2
"""Contrast of a small dot that is no dirt, over that of strong ink, and its size at the least [px]."""


@dataclass(frozen=True)
class Ink:
    """What is drawn."""

    cover: FloatArray
    """Inked share of each pixel, shape (height, width)."""
    mask: Bools
    """The pixels of lines, shape (height, width)."""
    shown: FloatArray
    """The picture without transparency, sRGB in [0, 1], shape (height, width, 3)."""
    paper: FloatArray | None
    """The paper's colour, sRGB in [0, 1], shape (3,); None: transparent."""
    textured: bool = False
    """Whether crayons leave what cannot be told from thin lines and dots."""


def find_ink(image: FloatArray, *, mixed: bool = False) -> Ink:
    """Tell ink and paper apart; paper may be coloured, in places and unevenly lit.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).
        mixed: whether broad ink may be alone and have any colour.
    """
    shown, is_clear = _shown(image)
    paper = np.asarray(np.median(shown.reshape(-1, 3)[:: max(1, shown.size // 300_000)], axis=0), np.float32)
    light = 1 - shown if paper.mean() < 0.4 else shown
    small = _reduced(light)
    is_textured = _is_colored_in(small)
    contrast = _contrast(light, small, in_all=is_textured)
    noise = _noise(contrast)
    if noise > 0.01:
        contrast = filters.gaussian_blur(contrast, 0.8)
        noise *= 0.5
    floor = max(FAINTEST, NOISE * noise)
    dark = contrast[contrast > floor]
    strong = float(np.percentile(dark, 90)) if len(dark) else 1.0
    contrast = _with_solid(contrast, light, strong, in_all=is_textured and not mixed, alone=mixed)
    seed = max(floor, (TEXTURED_SEED if is_textured else SEED) * strong)
    near = cv2.dilate(contrast, np.ones((NEAR, NEAR), np.uint8))
    mask = contrast > np.maximum(0.5 * np.maximum(near, seed), floor)
    seeds = contrast > seed
    if not is_textured:
        mass = across(contrast / np.float32(strong))
        grain = NOISY * noise / strong
        mask = with_thin(mask, middles(mass, max(FAINT, grain)))
        seeds |= mass > max(SURE, 2 * grain)
    speck, share = (TEXTURED_SPECK, TEXTURED_SHARE) if is_textured else (SPECK, 0.0)
    sure = contrast > (np.inf if is_textured else DARK * strong)
    mask = _held(mask, seeds, sure, speck, share)
    full = cv2.dilate(np.where(mask, contrast, 0), np.ones((BESIDE, BESIDE), np.uint8))
    # What is lighter than ink elsewhere is thinner than a pixel, to some extent.
    full = np.maximum(filters.box_blur(full, NEAR), (TEXTURED_FULL if is_textured else FULL) * strong)
    around = cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    cover = np.where(around, np.clip((contrast - 0.5 * floor) / (full - 0.5 * floor), 0, 1), 0)
    cover[cv2.erode(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0] = 1
    return Ink(cover.astype(np.float32), mask, shown, None if is_clear else paper, is_textured)


def _shown(image: FloatArray) -> tuple[FloatArray, bool]:
    """The picture on white, or on black where its ink is light, and whether its paper is clear."""
    if image.shape[2] == 3:
        return np.asarray(image, np.float32), False
    opacity = image[..., 3:]
    is_clear = bool((opacity < 0.5).mean() > CLEAR)
    light = float(image[..., :3].sum() / max(3 * float(opacity.sum()), 1e-6))
    behind = 0.0 if is_clear and light > 0.7 else 1.0
    return np.asarray(image[..., :3] + (1 - opacity) * behind, np.float32), is_clear


def _reduced(light: FloatArray) -> FloatArray:
    """The picture at the size that its paper is looked for in."""
    height, width = light.shape[:2]
    factor = max(1, round(max(height, width) / REDUCED))
    size = (max(1, width // factor), max(1, height // factor))
    return filters.resize_area(light, size)


def _contrast(light: FloatArray, small: FloatArray, *, in_all: bool) -> FloatArray:
    """How much darker than the paper around it each pixel is, in the channel that shows it most or, if
    ``in_all``, in each: what is coloured in has a texture that shows in some; its outlines show in all.
    """
    height, width = light.shape[:2]
    broad = max(LEAST_BROAD, BROAD * max(height, width)) * small.shape[1] / width
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * round(broad / 2) + 1,) * 2)
    paper = cv2.morphologyEx(small, cv2.MORPH_CLOSE, kernel, borderType=cv2.BORDER_REPLICATE)
    # The edge of what is coloured broadly is no line, although the reduced picture blurs it.
    paper = cv2.erode(paper, np.ones((3, 3), np.uint8))
    paper = filters.resize_linear(paper, (width, height))
    contrast = np.clip(paper - light, 0, 1)
    return np.asarray(contrast.min(axis=2) if in_all else contrast.max(axis=2), np.float32)


def _with_solid(
    contrast: FloatArray, light: FloatArray, strong: float, *, in_all: bool, alone: bool
) -> FloatArray:
    """The contrast with the whole picture's paper where that is as strong as lines have it: what is broad and
    as dark as ink is no paper. ``alone``: or as strong as anything has it, where there are no lines.
    """
    paper = np.median(light.reshape(-1, 3)[:: max(1, light.size // 300_000)], axis=0)
    away = np.clip(paper - light, 0, 1)
    whole = away.min(axis=2) if in_all else away.max(axis=2)
    lines = contrast > 0.5 * strong
    if not lines.any() and not alone:
        return contrast
    solid = whole > SOLID * float(np.median(whole[lines]) if lines.any() else max(whole.max(), FAINTEST))
    return np.asarray(np.where(solid, np.maximum(contrast, whole), contrast), np.float32)


def _is_colored_in(small: FloatArray) -> bool:
    """Whether areas of the picture, not only lines, have a colour of their own."""
    areas = cv2.medianBlur((255 * np.clip(small, 0, 1)).astype(np.uint8), 15) / np.float32(255)
    away = areas - np.median(areas.reshape(-1, 3), axis=0)
    tint = np.abs(away - away.mean(axis=2, keepdims=True)).max(axis=2)
    return bool((tint > TINT).mean() > PAINTED)


def _noise(contrast: FloatArray) -> float:
    """Standard deviation of the noise, from the second differences of most pixels."""
    rough = np.diff(np.diff(np.pad(contrast, 1, mode="reflect"), n=2, axis=0), n=2, axis=1)
    return float(np.median(np.abs(rough))) / (0.6745 * 6)


def _held(mask: Bools, seeds: Bools, dark: Bools, speck: float, share: float) -> Bools:
    """The parts of ``mask`` that are no specks, or ``dark`` ones, and more than a ``share`` seeds, without
    pinholes.
    """
    edge = mask & (cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0)
    width = 2 * float(mask.sum()) / max(1, int(edge.sum()))
    least = max(SMALLEST, speck * width * width)
    _, parts, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    held = stats[:, cv2.CC_STAT_AREA] >= least
    held |= (np.bincount(parts[dark], minlength=len(stats)) > 0) & (stats[:, cv2.CC_STAT_AREA] >= LEAST_DOT)
    held &= np.bincount(parts[seeds], minlength=len(stats)) > share * stats[:, cv2.CC_STAT_AREA]
    held[0] = False
    inked = held[parts]
    _, parts, stats, _ = cv2.connectedComponentsWithStats((~inked).astype(np.uint8), connectivity=4)
    pinholes = stats[:, cv2.CC_STAT_AREA] < max(SMALLEST, 0.5 * SPECK * width * width)
    pinholes[0] = False
    return np.asarray(inked | pinholes[parts], np.bool_)
