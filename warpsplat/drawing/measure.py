"""Where the image says that a drawing's outlines are: from one render, its adjoint and the contrast there.

Moving an outline by d across itself changes the squared error by contrast^2 (d - d0)^2 for each unit of its
length, where d0 is the distance at which the image has it. The adjoint gives the first derivative of that,
and of each channel of the image the contrast.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from warpsplat.alpha import squares
from warpsplat.drawing.constraints import Drawing, Flags, Floats, Links, rows_of, summed, with_ends
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.kernels.drawing import samples as kernels
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.models import EXACT
from warpsplat.rendering.outline import Outline, OutlineBuffers
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import launch_on_host
from warpsplat.rendering.renderer import Renderer
from warpsplat.rendering.tiles import TILE, from_tiles, read_tiles, to_tiles, write_tiles
from warpsplat.scene import FloatArray

GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)
"""Where on a piece of an outline samples lie, with equal weights: exact for cubic functions."""

FARTHEST = 1.5
"""How far from an outline the image can have it: beyond, it is not this outline [px]."""

LEAST_CONTRAST, FAINT, HIDDEN = 1e-4, 0.01, 0.1
"""Squares of the contrast below which an outline is not seen, that the faintest seen ones count as, and that
those count as which are not seen: if they move, what they hide may show."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Places on outlines, in their order."""

    cubic: Links
    """The cubic that each lies on, ascending, shape (sample,)."""
    t: Floats
    """Where on it, shape (sample,)."""
    place: Floats
    """Where the image has the outline, shape (sample, 2)."""
    across: Floats
    """Unit vectors across the outline, shape (sample, 2)."""
    weight: Floats
    """By how much the mean squared error grows for each square of the distance across, shape (sample,)."""

    def take(self, index: Links | Flags) -> Samples:
        """Return the samples ``index``, in that order."""
        return Samples(**{name: values[index] for name, values in vars(self).items()})

    def starts(self, count: int) -> Links:
        """Return where the samples of each of ``count`` cubics begin, and those of the last one end."""
        return np.searchsorted(self.cubic, np.arange(count + 1))


def different(numbers: Links) -> Links:
    """Return the different ones among whole numbers, ascending: faster than by ``np.unique``."""
    ordered = np.sort(numbers, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]]


def chords(cubics: Floats) -> Floats:
    """Return the lengths of the control polygons, shape (cubic,)."""
    return np.asarray(np.linalg.norm(np.diff(cubics, axis=1), axis=2).sum(axis=1))


def pixels_around(cubics: Floats, width: int, height: int) -> tuple[Links, Links]:
    """Return pairs of a cubic and a pixel on or beside it, ascending; pixels by rows.

    ``cubics``: shape (cubic, 4, 2) [px]; ``width``, ``height``: of the image.
    """
    counts = 2 + np.minimum(np.ceil(chords(cubics)), width + height).astype(np.intp)
    which = np.repeat(np.arange(len(cubics)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    t = (number + 0.5) / counts[which]
    x, y = np.floor(points_at(cubics[which], t[:, None])[:, 0]).astype(np.intp).T
    # With a border of one pixel, what is beside it has the next numbers.
    wide, high = width + 2, height + 2
    middle = different((which * high + np.clip(y + 1, 0, high - 1)) * wide + np.clip(x + 1, 0, wide - 1))
    near = different(middle + np.array([j * wide + i for j in (-1, 0, 1) for i in (-1, 0, 1)])[:, None])
    x, y = near % wide - 1, near // wide % high - 1
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return near[inside] // (wide * high), (y * width + x)[inside]


class Measure:
    """Renders outlines of a drawing over and over and compares them with an image."""

    def __init__(self, target: FloatArray, drawing: Drawing, points: Floats, backend: Backend) -> None:
        """``points``: where the outlines begin."""
        self._following = drawing.following()
        self._parameters = Parameters(drawing.scene, backend)
        self._parameters.keeps_colors = True
        viewport = Viewport(target.shape[1], target.shape[0])
        self._renderer = Renderer(self._parameters, viewport, model=EXACT)
        self._size, self._scale = (viewport.width, viewport.height), 1 / (3 * viewport.pixel_count)
        self.least = LEAST_CONTRAST * self._scale
        """Curvature that does not count."""
        self._target = to_tiles(target)
        self._inside = read_tiles(self._renderer.film.buffers.inside)[:, None]
        cubics = with_ends(points, self._following)
        self._cubic, pixel = pixels_around(cubics, viewport.width, viewport.height)
        y, x = np.divmod(pixel, viewport.width)
        self._pixel = ((y // TILE * viewport.tiles_x + x // TILE) * TILE + x % TILE) * TILE + y % TILE
        self._render(points)

    def _render(self, points: Floats) -> None:
        self._parameters.groups["points"].value.assign(points.astype(np.float32))
        self._renderer.forward_complete()
        self._is_fresh = True

    def error(self, points: Floats) -> tuple[float, Floats]:
        """Return the mean squared error with the outlines at ``points``, and the part around each cubic."""
        self._render(points)
        self._residual = (read_tiles(self._renderer.film.buffers.image) - self._target) * self._inside
        parts = squares(self._residual, axis=1)
        around = summed(self._cubic, parts.ravel()[self._pixel], len(self._following))
        return float(parts.sum(dtype=np.float64)) * self._scale, around * self._scale

    def gradient(self, *, blurred: bool = False) -> Floats:
        """Return the derivative of the last ``error`` by the points' coordinates, shape (2 x point,).

        ``blurred``: of the residual. An outline on the border of two pixels may already suit the one that it
        comes from, and the error itself says nothing of the other one before it is there.
        """
        residual = self._residual
        if blurred:
            image = np.pad(from_tiles(residual, *self._size), ((1, 1), (1, 1), (0, 0)))
            rows = image[:-2] + 2 * image[1:-1] + image[2:]
            image = (rows[:, :-2] + 2 * rows[:, 1:-1] + rows[:, 2:]) / 16
            residual = to_tiles(image)
        self._back(self._by_image(residual))
        return self._parameters.arrays["points_grad"].numpy().astype(np.float64).ravel()

    def look(self) -> None:
        """Measure the contrasts across the outlines as they are now."""
        cubic, vertex, following = self._pieces()
        normal, length = self._across(vertex, following)
        square = np.zeros(len(vertex))
        for channel in self._channels():
            self._back(channel)
            square += ((self._piece_grads(vertex).sum(axis=1) * normal).sum(axis=1) / length) ** 2
        seen = square > LEAST_CONTRAST
        self._contrast = np.where(seen, np.maximum(square, FAINT), HIDDEN) * self._scale
        self._counts = np.bincount(cubic, minlength=len(self._following))

    def samples(self, points: Floats) -> Samples:
        """Return samples of the outlines at ``points``, on themselves: two a piece, as last looked at."""
        counts = self._counts
        cubic = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(cubic)) - (np.cumsum(counts) - counts)[cubic]
        t = ((number[:, None] + GAUSS) / counts[cubic][:, None]).ravel()
        weight = np.repeat(self._contrast * 0.5 / counts[cubic], 2)
        cubics, cubic = with_ends(points, self._following), np.repeat(cubic, 2)
        where, across = np.zeros((2, len(cubic), 2))
        found = Samples(cubic, t, where, across, weight)
        values = {"cubics": rows_of(cubics), "first": found.starts(len(counts)), "share": weight.copy()}
        launch_on_host(kernels.along, len(counts), found, values)
        return found

    def places(self, points: Floats) -> Samples:
        """Return samples at ``points``, those of the last ``error``, where the image has outlines."""
        self.look()
        self._back(self._by_image(self._residual))
        _, vertex, following = self._pieces()
        normal, _ = self._across(vertex, following)
        slope = (self._piece_grads(vertex) * normal[:, None]).sum(axis=2)
        found = self.samples(points)
        # A distance that is linear along the piece has these ends, and these values at the samples.
        weight = np.maximum(found.weight.reshape(-1, 2).sum(axis=1), 1e-30)
        ends = -np.stack([2 * slope[:, 0] - slope[:, 1], 2 * slope[:, 1] - slope[:, 0]], axis=1)
        ends /= weight[:, None]
        away = np.clip(ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * GAUSS, -FARTHEST, FARTHEST)
        return replace(found, place=found.place + away.reshape(-1, 1) * found.across)

    def _across(self, vertex: Links, following: Links) -> tuple[Floats, Floats]:
        """Return unit normals and lengths of straight pieces."""
        at = self._outline.vertex.numpy().astype(np.float64)
        edge = at[following] - at[vertex]
        length = np.maximum(np.linalg.norm(edge, axis=1), 1e-9)
        return np.stack([-edge[:, 1], edge[:, 0]], axis=1) / length[:, None], length

    @property
    def _outline(self) -> OutlineBuffers:
        geometry = self._renderer.geometry
        assert isinstance(geometry, Outline)
        return geometry.buffers

    def _pieces(self) -> tuple[Links, Links, Links]:
        """Return the cubic, and the first and second vertex, of the straight pieces."""
        b, arrays = self._outline, self._parameters.arrays
        pieces = b.bezier_range.numpy().astype(np.intp)
        counts = pieces[:, 1] - pieces[:, 0]
        shape = arrays["contours"].numpy()["shape"][arrays["bezier_contour"].numpy()]
        base = b.vertex_range.numpy()[shape, 0] + pieces[:, 0]
        cubic = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(cubic)) - np.repeat(np.cumsum(counts) - counts, counts)
        vertex = base[cubic] + number
        return cubic, vertex, b.vertex_next.numpy()[vertex]

    def _piece_grads(self, vertex: Links) -> Floats:
        """Return the gradients of the two ends of the pieces that begin at vertices, shape (piece, 2, 2)."""
        b = self._outline
        ends = [grad.numpy()[vertex] for grad in (b.start_grad, b.end_grad)]
        return np.stack(ends, axis=1).astype(np.float64)

    def _back(self, image_grad: FloatArray) -> None:
        """Compute the adjoint, which takes the place of the coverages: each needs a render of its own."""
        if not self._is_fresh:
            self._renderer.forward()
        self._is_fresh = False
        write_tiles(self._renderer.film.buffers.image_grad, image_grad)
        self._renderer.backward()

    def _by_image(self, residual: FloatArray) -> FloatArray:
        """Return the derivative of the mean squared error by the image."""
        if residual.shape[1] == 3:
            return residual * np.float32(2 * self._scale)
        red, green, blue, opacity = np.moveaxis(residual, 1, 0)
        found = np.empty_like(residual)
        for channel, color in enumerate((red, green, blue)):
            found[:, channel] = 2 * color - opacity
        found[:, 3] = 3 * opacity - (red + green + blue)
        found *= np.float32(self._scale)
        return found

    def _channels(self) -> Iterator[FloatArray]:
        """Yield gradients of the image whose squares add up to the squared error's.

        With opacity a, on black and on white, they are r - a/2, g - a/2, b - a/2 and a by the root of 3/4.
        """
        planes = self._residual.shape[1]
        for channel in range(planes):
            shares = np.eye(planes, dtype=np.float32)[channel]
            if planes == 4:
                shares[3] = -0.5 if channel < 3 else np.sqrt(np.float32(0.75))
            yield shares[None, :, None, None] * self._inside
