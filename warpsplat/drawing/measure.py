"""Where the image says that a drawing's outlines are: from one render, its adjoint and the contrast there.

Moving an outline by d across itself changes the squared error by contrast^2 (d - d0)^2 for each unit of its
length, where d0 is the distance at which the image has it. The adjoint gives the first derivative of that,
and of each channel of the image the contrast.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares
from warpsplat.drawing.constraints import Drawing, Floats, Links, with_ends
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.models import EXACT
from warpsplat.rendering.outline import Outline
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.rendering.tiles import TILE, to_tiles
from warpsplat.scene import FloatArray

GAUSS = np.array([0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)])
"""Where on a piece of an outline samples lie, with equal weights: exact for cubic functions."""

FARTHEST = 1.5
"""How far from an outline the image can have it: beyond, it is not this outline [px]."""

LEAST_WEIGHT = 1e-4
"""Contrast squared, of a channel's range, below which an outline is not seen."""


import os
FLOOR=float(os.environ.get("FL","0.003"))
HIDDEN=float(os.environ.get("HI","0.1"))

@dataclass(frozen=True, eq=False)
class Samples:
    """Places on outlines, in their order."""

    cubic: Links
    """The cubic that each lies on, ascending, shape (sample,)."""
    t: Floats
    """Where on it, shape (sample,)."""
    place: Floats
    """Where the image has the outline, shape (sample, 2)."""
    normal: Floats
    """Unit vectors across the outline, shape (sample, 2)."""
    weight: Floats
    """By how much the mean squared error grows for each square of the distance across, shape (sample,)."""

    def take(self, index: Links) -> Samples:
        """Return the samples ``index``, in that order."""
        return Samples(**{name: values[index] for name, values in vars(self).items()})


def bernstein(t: Floats) -> Floats:
    """Return the weights of a cubic's control points at ``t``, shape (sample, 4)."""
    s = 1 - t
    return np.stack([s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t], axis=-1)


class Surroundings:
    """The pixels around each cubic."""

    def __init__(self, cubics: Floats, viewport: Viewport) -> None:
        """``cubics``: shape (cubic, 4, 2) [px]."""
        reach = np.linalg.norm(np.diff(cubics, axis=1), axis=2).sum(axis=1)
        counts = 2 + np.minimum(np.ceil(reach), viewport.width + viewport.height).astype(np.intp)
        which = np.repeat(np.arange(len(cubics)), counts)
        number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
        t = (number + 0.5) / counts[which]
        points = (bernstein(t)[..., None] * cubics[which]).sum(axis=1)
        x, y = np.floor(points).astype(np.intp).T
        wide, high, every = viewport.width + 2, viewport.height + 2, 9 * len(which)
        x, y = np.clip(x + 1, 0, wide - 1), np.clip(y + 1, 0, high - 1)
        middle = np.unique((which * high + y) * wide + x)
        offsets = np.array([j * wide + i for j in (-1, 0, 1) for i in (-1, 0, 1)])
        near = np.unique((middle[:, None] + offsets).ravel())
        self._cubic, place = near // (wide * high), near % (wide * high)
        x, y = place % wide - 1, place // wide - 1
        inside = (x >= 0) & (x < viewport.width) & (y >= 0) & (y < viewport.height)
        self._cubic, x, y = self._cubic[inside], x[inside], y[inside]
        tile = y // TILE * viewport.tiles_x + x // TILE
        self._pixel = (tile * TILE + x % TILE) * TILE + y % TILE
        self._count = len(cubics)

    def sums(self, pixels: FloatArray) -> Floats:
        """Return sums of ``pixels``, by tiles, around each cubic, shape (cubic,)."""
        return np.bincount(self._cubic, pixels.ravel()[self._pixel], self._count)


class Measure:
    """Renders outlines of a drawing over and over and compares them with an image."""

    def __init__(
        self, target: FloatArray, drawing: Drawing, backend: Backend, capacity: Capacity | None = None
    ) -> None:
        """``target``: as ``finish_drawing`` has it; ``capacity``: of the renderer, if it is known."""
        self._following = drawing.following()
        self._parameters = Parameters(drawing.scene, backend)
        self._parameters.keeps_colors = True
        viewport = Viewport(target.shape[1], target.shape[0])
        self._renderer = Renderer(self._parameters, viewport, model=EXACT, capacity=capacity)
        self._target, self._viewport = to_tiles(target), viewport
        self._scale = 1 / (3 * viewport.pixel_count)
        self.least = LEAST_WEIGHT * self._scale
        self.scene = drawing.scene

    @property
    def capacity(self) -> Capacity:
        """Capacity of the renderer's arrays."""
        return self._renderer.capacity

    def error(self, points: Floats) -> float:
        """Return the mean squared error with the outlines at ``points``."""
        self.scene = replace(self.scene, points=points.astype(np.float32))
        self._parameters.groups["points"].value.assign(self.scene.points)
        self._renderer.forward_complete()
        self._is_fresh = True
        film = self._renderer.film.buffers
        self._residual = (film.image.numpy() - self._target) * film.inside.numpy()[:, None]
        self.squares = squares(self._residual, axis=1)
        return float(self.squares.sum(dtype=np.float64)) * self._scale

    def surroundings(self, points: Floats) -> Surroundings:
        """Return the pixels around the outlines at ``points``."""
        return Surroundings(with_ends(points, self._following), self._viewport)

    def gradient(self) -> Floats:
        """Return the derivative of the last ``error`` by the coordinates of the points, shape (2 x point,)."""
        self._back(self._by_image(self._residual))
        return self._parameters.arrays["points_grad"].numpy().astype(np.float64).ravel()

    def look(self) -> None:
        """Measure the contrasts across the outlines as they are now."""
        cubic, _, vertex, following = self._pieces()
        normal, length = self._across(vertex, following)
        square = np.zeros(len(vertex))
        for channel in self._channels():
            self._back(channel)
            square += ((self._piece_grads(vertex).sum(axis=1) * normal).sum(axis=1) / length) ** 2
        self._contrast = np.where(square > LEAST_WEIGHT, np.maximum(square, FLOOR), HIDDEN) * self._scale
        self._cubic = cubic

    def samples(self, points: Floats) -> Samples:
        """Return samples of the outlines at ``points``, without places."""
        cubic = self._cubic
        pieces = np.bincount(cubic, minlength=len(points) // 3)
        number = np.arange(len(cubic)) - (np.cumsum(pieces) - pieces)[cubic]
        t = ((number[:, None] + GAUSS) / pieces[cubic][:, None]).ravel()
        cubics = with_ends(points, self._following)
        cubic = np.repeat(cubic, 2)
        slopes = 3 * np.diff(cubics, axis=1)[cubic]
        s = (1 - t)[:, None]
        ahead = s * s * slopes[:, 0] + 2 * s * t[:, None] * slopes[:, 1] + (t * t)[:, None] * slopes[:, 2]
        speed = np.linalg.norm(ahead, axis=1)
        normal = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) / np.maximum(speed, 1e-9)[:, None]
        weight = np.repeat(self._contrast, 2) * speed * (0.5 / pieces)[cubic]
        where = (bernstein(t)[..., None] * cubics[cubic]).sum(axis=1)
        return Samples(cubic, t, where, normal, weight)

    def places(self, points: Floats) -> Samples:
        """Return samples of the outlines at ``points``, those of the last ``error``, where the image has them."""
        self.look()
        self._back(self._by_image(self._residual))
        _, _, vertex, following = self._pieces()
        normal, length = self._across(vertex, following)
        slope = (self._piece_grads(vertex) * normal[:, None]).sum(axis=2)
        # A distance that is linear along the piece has these ends, and these values at the samples.
        ends = slope / (self._contrast * length)[:, None]
        ends = -np.stack([2 * ends[:, 0] - ends[:, 1], 2 * ends[:, 1] - ends[:, 0]], axis=1)
        away = np.clip(ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * GAUSS, -FARTHEST, FARTHEST)
        found = self.samples(points)
        return replace(found, place=found.place + away.reshape(-1, 1) * found.normal)

    def _across(self, vertex: Links, following: Links) -> tuple[Floats, Floats]:
        """Return unit normals and lengths of straight pieces."""
        at = self._outline.vertex.numpy().astype(np.float64)
        edge = at[following] - at[vertex]
        length = np.maximum(np.linalg.norm(edge, axis=1), 1e-9)
        return np.stack([-edge[:, 1], edge[:, 0]], axis=1) / length[:, None], length

    @property
    def _outline(self) -> "OutlineBuffers":
        geometry = self._renderer.geometry
        assert isinstance(geometry, Outline)
        return geometry.buffers

    def _pieces(self) -> tuple[Links, Links, Links, Links]:
        """Return cubic, number in it, first and second vertex of the straight pieces that are drawn."""
        b, arrays = self._outline, self._parameters.arrays
        counts, first = b.bezier_pieces.numpy(), b.bezier_vertex.numpy()
        shape = arrays["contour_shape"].numpy()[arrays["bezier_contour"].numpy()]
        base = b.vertex_first.numpy()[shape] + first
        drawn = (b.vertex_last.numpy() > b.vertex_first.numpy())[shape]
        counts = np.where(drawn, counts, 0).astype(np.intp)
        cubic = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(cubic)) - np.repeat(np.cumsum(counts) - counts, counts)
        vertex = base[cubic] + number
        return cubic, number, vertex, b.vertex_next.numpy()[vertex]

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
        self._renderer.film.buffers.image_grad.assign(image_grad)
        self._renderer.backward()

    def _by_image(self, residual: FloatArray) -> FloatArray:
        """Return the derivative of the mean squared error by the image."""
        if residual.shape[1] == 3:
            return residual * np.float32(2 * self._scale)
        color, opacity = residual[:, :3], residual[:, 3:]
        back = 3 * opacity - color.sum(axis=1, keepdims=True)
        return np.concatenate([2 * color - opacity, back], axis=1) * np.float32(self._scale)

    def _channels(self) -> list[FloatArray]:
        """Return gradients of the image whose squares are those of the error: r - a/2, ... and a by sqrt 3/4."""
        found = []
        planes = self._residual.shape[1]
        for channel in range(planes):
            grad = np.zeros_like(self._residual)
            grad[:, channel] = self._renderer.film.buffers.inside.numpy()
            if planes == 4 and channel < 3:
                grad[:, 3] = -0.5
            elif planes == 4:
                grad[:, 3] = np.sqrt(np.float32(0.75))
            found.append(grad)
        return found
