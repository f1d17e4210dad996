"""How a picture was made of sharp shapes.

Scanners, cameras and programs that resize mix colours in sRGB or in linear light, convolve them with a small
symmetric kernel, and clip what goes beyond black and white; JPEG and WebP halve the resolution of colours
(``chroma``). Clean edges tell the light. A sharp image that is about right tells the kernel: the one with
which it is nearest to the picture. The picture without them is
what it is, less what the sharp image becomes through them, plus the sharp image (back projection: Irani and
Peleg 1991, "Improving resolution by image registration").
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce

import cv2
import numpy as np

from warpsplat.drawing.chroma import halved, has_blurred_colors, with_sharp_colors
from warpsplat.drawing.edges import LINEAR, MIDDLES, Edges, find_edges
from warpsplat.drawing.trace.grids import Bools, Box, Floats, Ints, dilated, uneven_pixels
from warpsplat.drawing.trace.seeds import ROUNDING, noise_of
from warpsplat.fit.optics import COUNTS, RADIUS, RINGS, Kernel, Optics
from warpsplat.portable.linear import solve
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.geometry import enlarged

SCALE = 2
"""Samples of a sharp image along a pixel: coverage of whole pixels does not tell what Lanczos or bicubic
filters leave of finer parts."""

ROUNDS = 4
"""Solutions for a kernel, as each tells which pixels it would clip."""

MOST_TOLD = 1 << 17
"""Most pixels from which the kernel is solved for, which bounds time and memory."""

STRIP = 64
"""Rows whose samples are summed together, which bounds the memory."""

RIDGE = 0.01
"""Ridge of the normal equations, over the mean of their diagonal: edges of few directions leave weights open,
which stay small then."""

CLEAN = 16
"""Weight of clean edges: elsewhere, what a trace does not tell is taken for blur."""

LIGHTNESS = np.array([5, 9, 2], np.float32) / 16
"""Shares of the channels, about, in what JPEG keeps at full resolution (ITU-T T.871)."""

NONE = (1 / COUNTS[0], *(0.0,) * (len(RINGS) - 1))
"""Each pixel is the mean of its samples."""


@dataclass(frozen=True, eq=False)
class Found:
    """The optics that bring a sharp image nearest to a picture."""

    kernel: Kernel
    error: float
    """Sum of squared errors beside edges, with them [levels squared]."""
    without: float
    """The same without."""
    shown: FloatArray
    """The sharp image through the optics, sRGB in [0, 1], shape (height, width, channel)."""
    undone: FloatArray
    """The picture without the optics, likewise."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A picture whose optics are looked for."""

    levels: Floats
    uneven: Bools
    """The pixels that are not flat, shape (height, width)."""
    edges: Edges
    noise: float
    """Noise of flat colours [levels]."""
    is_halved: bool
    """Whether its colours have half the resolution of its lightness, and so do not tell the kernel."""
    kernel: Kernel | None = None
    """Its kernel; None: to be found."""

    @classmethod
    def of(cls, image: FloatArray, noise: float | None = None, known: Optics | None = None) -> Seen:
        """Return an image, sRGB in [0, 1], shape (height, width, 3), or premultiplied with opacity.

        ``noise``: of flat colours [levels]; None: measured. ``known``: of how it was made.
        """
        known = known or Optics()
        levels = _levels(image)
        noise = noise_of(levels) if noise is None else noise
        is_halved = has_blurred_colors(image)
        sharp = _levels(with_sharp_colors(image)) if is_halved else levels
        is_linear = None if known.light is None else known.light == "linear"
        edges, uneven = find_edges(sharp, noise, is_linear=is_linear), uneven_pixels(levels, ROUNDING + noise)
        return cls(levels, uneven, edges, noise, is_halved, known.kernel)

    @property
    def known(self) -> Optics:
        """How it was made, as far as that is decided."""
        return Optics("linear" if self.edges.is_linear else "sRGB", self.kernel)

    def part(self, box: Box) -> Seen:
        """Return a part of it."""
        some = box.slices()
        edges = replace(self.edges, plain=self.edges.plain[some], clean=self.edges.clean[some])
        return replace(self, levels=self.levels[some], uneven=self.uneven[some], edges=edges)

    def plain(self, image: FloatArray | None = None) -> FloatArray:
        """Return this, or an image made of it, with clean edges of two colours."""
        if image is None:
            return _image(self.edges.plain)
        return _image(find_edges(_levels(image), self.noise, is_linear=False).plain)

    def scenes(self, scene: Scene, part: Box | None = None) -> list[Scene]:
        """Return scenes whose images ``find`` takes; ``part``: only these pixels, all by default."""
        part = part or Box(0, 0, scene.canvas.width, scene.canvas.height)
        frames = scene.frames.copy()
        frames[:, :2] -= part[:2]
        shifted = replace(scene, points=scene.points - np.array(part[:2], np.float32), frames=frames)
        fine = enlarged(shifted, SCALE, SCALE * (part.right - part.left), SCALE * (part.bottom - part.top))
        return [fine, _in_light(fine)] if self.edges.is_linear else [fine]

    def find(self, fine: FloatArray, light: FloatArray | None = None) -> Found:
        """Return the optics that bring a sharp image nearest to this one.

        Args:
            fine: As this one, shape (SCALE height, SCALE width, channel).
            light: The same in the light in which colours were mixed, if that is not sRGB.
        """
        fine = _levels(fine)
        mean = reduce(np.add, [fine[y::SCALE, x::SCALE] for y, x in np.ndindex(SCALE, SCALE)]) / COUNTS[0]
        beside = dilated(self.uneven | uneven_pixels(fine, 0)[::SCALE, ::SCALE], 2 * RADIUS // SCALE)
        some = np.nonzero(beside)
        light = fine if light is None else _levels(light)
        every = max(-(-len(some[0]) // MOST_TOLD), 1)
        told = some[0][::every], some[1][::every]
        kernel, error = self._kernel(_rings(light, *told), self._steps(fine, told), told)
        without = _squared(self._planes(self.levels[told] - _rounded(mean[told])))
        undone, shown = self.levels.copy(), _rounded(mean)
        shown[some] = self.in_srgb(_through(light, kernel, some))
        if self.is_halved:
            shown = halved(shown)
        undone[some] = mean[some] + self._residual(shown[some], self._steps(fine, some), some)
        return Found(kernel, every * error, every * without, _image(shown), _image(undone))

    def _kernel(self, rings: list[Floats], steps: Floats, some: tuple[Ints, ...]) -> tuple[Kernel, float]:
        """Return the kernel for some pixels, and the squared error with it."""

        def left(tried: Kernel) -> float:
            return _squared(self._planes(self._residual(self.in_srgb(_summed(tried, rings)), steps, some)))

        if self.kernel is not None:
            return self.kernel, left(self.kernel)
        light = self._planes(self.in_light(self.levels[some]))
        planes = [self._planes(ring) for ring in rings]
        center = planes[0] / COUNTS[0]
        columns = [ring - n * center for ring, n in zip(planes[1:], COUNTS[1:], strict=True)]
        table = np.array(columns, np.float64).reshape(len(columns), -1)
        right = (light - center).reshape(-1).astype(np.float64)
        weight = usual = np.repeat(np.where(self.edges.clean[some], CLEAN, 1), light.shape[1])
        kernel, error = NONE, left(NONE)
        told = int(((light > 0) & (light < 255)).sum())
        for _ in range(ROUNDS if told > len(table) else 0):
            # Sums of products of whole numbers are exact, and so the same in any order.
            weighted = table * weight
            normal = np.array([[(one * other).sum() for one in weighted] for other in table])
            normal += RIDGE * np.trace(normal) / len(normal) * np.eye(len(normal))
            try:
                solved = solve(normal, np.array([(one * right).sum() for one in weighted])).tolist()
            except np.linalg.LinAlgError:  # no edges, or all alike
                break
            tried = ((1 - sum(n * w for n, w in zip(COUNTS[1:], solved, strict=True))) / COUNTS[0], *solved)
            now = left(tried)
            if now < error:
                kernel, error = tried, now
            # What is beyond black or white tells no more than that.
            raw = _summed(tried, planes)
            clipped = ((light <= 0) & (raw < 0)) | ((light >= 255) & (raw > 255))
            before, weight = weight, np.where(clipped.reshape(-1), 0, usual)
            if (weight == before).all():
                break
        return kernel, error

    def _steps(self, fine: Floats, some: tuple[Ints, ...]) -> Floats:
        """Return how far colours around some pixels are apart, over how far in light, (pixel, channel)."""
        if not self.edges.is_linear:
            return np.ones((len(some[0]), fine.shape[2]), np.float32)
        window = np.ones((2 * RADIUS - 1, 2 * RADIUS - 1), np.uint8)
        low, high = (
            change(fine.astype(np.uint8), window)[::SCALE, ::SCALE][some].astype(np.float32)
            for change in (cv2.erode, cv2.dilate)
        )
        return np.where(
            high > low, (high - low) / np.maximum(self.in_light(high) - self.in_light(low), 1 / 16), 1
        )

    def _residual(self, through: Floats, steps: Floats, some: tuple[Ints, ...]) -> Floats:
        """Return what some pixels show beyond a sharp image, as if colours were mixed in sRGB [levels].

        ``through``: what it becomes through the optics, shape (pixel, channel).
        """
        return np.round(16 * (self.in_light(self.levels[some]) - self.in_light(through)) * steps) / 16

    @property
    def near_edges(self) -> Bools:
        """The pixels that a kernel may have changed, shape (height, width)."""
        return dilated(self.uneven, 2 * RADIUS // SCALE)

    def through(self, fine: FloatArray, kernel: Kernel, some: tuple[Ints, ...]) -> Floats:
        """Return some pixels of a sharp image through a kernel, neither rounded nor clipped [levels].

        ``fine``: in [0, 1], in the light in which colours were mixed, (SCALE height, SCALE width, channel).
        """
        return _through(_levels(fine), kernel, some)

    def in_light(self, levels: Floats) -> Floats:
        """Return whole levels in the light in which colours were mixed."""
        return LINEAR[levels.astype(np.intp)] if self.edges.is_linear else levels

    def in_srgb(self, light: Floats) -> Floats:
        """Return whole levels of such light."""
        if self.edges.is_linear:
            return np.searchsorted(MIDDLES, light).astype(np.float32)
        return _rounded(light)

    def _planes(self, pixels: Floats) -> Floats:
        """Return what of pixels (pixel, channel), or sums of them, tells optics, shape (pixel, plane)."""
        if not self.is_halved:
            return pixels
        return np.round((pixels[:, :3] * LIGHTNESS).sum(axis=1, keepdims=True))


def _in_light(scene: Scene) -> Scene:
    """Return a scene with its colours in linear light."""

    def linear(colors: FloatArray) -> FloatArray:
        levels = np.clip(np.round(colors * 255), 0, 255)
        return np.asarray(LINEAR[levels.astype(np.intp)] / np.float32(255), np.float32)

    ground = scene.canvas.background
    canvas = replace(scene.canvas, background=None if ground is None else linear(ground))
    return replace(scene, colors=linear(scene.colors), stop_colors=linear(scene.stop_colors), canvas=canvas)


def _levels(pixels: FloatArray) -> Floats:
    """Return values in [0, 1] as whole levels of 255."""
    return np.asarray(np.round(pixels * np.float32(255)), np.float32)


def _image(levels: Floats) -> FloatArray:
    """Return levels as values in [0, 1], colours not beyond opacity."""
    levels = np.clip(np.round(levels), 0, 255)
    if levels.shape[2] == 4:
        levels = np.minimum(levels, levels[..., 3:])
    return np.asarray(levels / np.float32(255), np.float32)


def _summed(kernel: Kernel, rings: list[Floats]) -> Floats:
    """Return the sum of rings by their weights."""
    total = np.zeros_like(rings[0])
    for weight, ring in zip(kernel, rings, strict=True):
        total += np.float32(weight) * ring
    return total


def _rounded(levels: Floats) -> Floats:
    return np.clip(np.round(levels), 0, 255)


def _squared(difference: Floats) -> float:
    return float(np.square(difference, dtype=np.float64).sum())


def _through(fine: Floats, kernel: Kernel, some: tuple[Ints, ...]) -> Floats:
    """Return some pixels of a sharp image through a kernel, shape (pixel, channel)."""
    return np.concatenate([_summed(kernel, _strip_rings(fine, *part)) for part in _strips(*some)])


def _rings(fine: Floats, rows: Ints, columns: Ints) -> list[Floats]:
    """Return the sum of the samples of each of RINGS around some pixels, shape (pixel, channel)."""
    strips = [_strip_rings(fine, *part) for part in _strips(rows, columns)]
    return [np.concatenate(ring) for ring in zip(*strips, strict=True)]


def _strips(rows: Ints, columns: Ints) -> list[tuple[Ints, Ints]]:
    """Return pixels, whose rows are in order, by strips."""
    ends = np.searchsorted(rows, np.arange(STRIP, int(rows[-1]) + 1 if len(rows) else 0, STRIP))
    return list(zip(np.split(rows, ends), np.split(columns, ends), strict=True))


def _strip_rings(fine: Floats, rows: Ints, columns: Ints) -> list[Floats]:
    """Return what ``_rings`` does, for pixels of one strip."""
    if not len(rows):
        return [fine[:0, 0]] * len(RINGS)
    before, width = RADIUS - SCALE // 2, fine.shape[1] // SCALE
    first = int(rows[0])
    top, bottom = SCALE * first - before, SCALE * (int(rows[-1]) + 1) + before
    beyond = max(-top, 0), max(bottom - len(fine), 0)
    wide = np.pad(fine[max(top, 0) : bottom], [beyond, (before, before), (0, 0)], mode="edge")
    pairs = [(RADIUS - 1 - away, RADIUS + away) for away in range(RADIUS)]
    last = SCALE * (width - 1) + 1
    sums = [
        (wide[:, low : low + last : SCALE] + wide[:, high : high + last : SCALE]).reshape(-1, fine.shape[2])
        for low, high in pairs
    ]

    def both(across: int, down: int) -> Floats:
        """Return the sum of the four samples that are so far away along the two sides."""
        low, high = ((SCALE * (rows - first) + at) * width + columns for at in pairs[down])
        return sums[across].take(low, axis=0) + sums[across].take(high, axis=0)

    return [both(a, b) if a == b else both(a, b) + both(b, a) for a, b in RINGS]
