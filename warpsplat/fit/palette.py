"""Few colours: shapes that have only those of a palette, and which of them each has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight
from warpsplat.fit.place import survey
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.fit.state import FitState
from warpsplat.scene import Canvas, FloatArray, IndexArray, Scene
from warpsplat.scene.geometry import areas

ROUNDS = 20
"""Of k-means."""

FOLLOWED = 0.01
"""Share of the way to what shapes would like that the colours of a palette go at each choice."""

SOLID = 0.5
"""Opacity from which on a pixel's colour counts."""


Floats = npt.NDArray[np.floating]


class Palette:
    """The colours that shapes may have.

    Shapes are rendered in these colours only, and each step trains their own from there. What a shape would
    like is remembered, so that many small steps towards another colour of the palette add up (the
    straight-through estimator of Bengio et al. 2013).
    """

    def __init__(self, colors: FloatArray, *, given: bool = True) -> None:
        """``colors``: sRGB in [0, 1], shape (color, 3); where they were not ``given``, they are a start."""
        self.colors = colors
        self._given = given
        self._wanted: FloatArray | None = None
        self._shown: FloatArray | None = None
        self._revision = -1

    @staticmethod
    def of(settings: Settings, target: FloatArray) -> Palette | None:
        """The settings' palette, or as many colours of ``target`` as they allow; None if they allow all."""
        if settings.palette:
            return Palette(np.array([solid_color(color) for color in settings.palette], np.float32))
        if settings.colors is None:
            return None
        small, _ = survey(target)
        pixels = small.reshape(-1, small.shape[2])
        if target.shape[2] == 4:
            pixels = pixels[pixels[:, 3] > SOLID]
        return Palette(
            main_colors(straight(pixels), np.ones(len(pixels), np.int64), settings.colors), given=False
        )

    @staticmethod
    def of_scene(settings: Settings, scene: Scene) -> Palette | None:
        """The same by a scene's colours, as they are seen by area."""
        if settings.palette or settings.colors is None:
            return Palette.of(settings, np.zeros((1, 1, 3), np.float32))
        colors, seen = mean_colors(scene), np.maximum(areas(scene), 1.0)
        background = scene.canvas.background
        if background is not None:
            canvas = scene.canvas.width * scene.canvas.height
            colors, seen = np.concatenate([colors, background[None]]), np.append(seen, canvas)
        return Palette(main_colors(colors, np.ceil(seen).astype(np.int64), settings.colors))

    def nearest(self, colors: FloatArray) -> IndexArray:
        """The colour of the palette that each of ``colors`` is nearest to, shape (color,)."""
        return np.asarray(_apart(colors, self.colors).argmin(axis=1), np.intp)

    def canvas(self, canvas: Canvas) -> Canvas:
        """With a background of the palette."""
        if canvas.background is None:
            return canvas
        return replace(canvas, background=self.colors[self.nearest(canvas.background[None])[0]])

    def choose(self, state: FitState) -> None:
        """Give each shape the colour that is nearest to what it would like to have."""
        scene = state.scene()
        if self._wanted is None or self._shown is None or self._revision != state.parameters.revision:
            wanted = scene.colors
        else:
            wanted = self._wanted + (scene.colors - self._shown)
        self._wanted = np.clip(wanted, 0, 1)
        self._revision = state.parameters.revision
        if not self._given:
            self._follow(areas(scene))
        self._shown = self.colors[self.nearest(self._wanted)]
        state.parameters.assign(replace(scene, colors=self._shown))

    def _follow(self, seen: FloatArray) -> None:
        """Take for each colour the mean of what the shapes that have it would like, by the areas ``seen``."""
        assert self._wanted is not None
        which, count = self.nearest(self._wanted), len(self.colors)
        total = np.bincount(which, weights=seen, minlength=count)
        for channel in range(3):
            sums = np.bincount(which, weights=seen * self._wanted[:, channel], minlength=count)
            mean = np.where(total > 0, sums / np.maximum(total, 1e-9), self.colors[:, channel])
            self.colors[:, channel] += FOLLOWED * (mean - self.colors[:, channel])

    def hold(self, state: FitState) -> None:
        """The colours stay from now on, as a file can say them."""
        self._given = True
        self.colors = np.asarray(np.round(self.colors * 255) / 255, np.float32)
        self.choose(state)
        state.parameters.hold("colors", np.ones(len(state.scene()), np.bool_))

    def limited(self, scene: Scene) -> Scene:
        """A scene in these colours, without gradients."""
        flat = replace(
            scene,
            paint=np.zeros_like(scene.paint),
            frames=np.zeros_like(scene.frames),
            focus=np.zeros_like(scene.focus),
            stop_first=np.zeros_like(scene.stop_first),
            stop_offsets=scene.stop_offsets[:0],
            stop_colors=scene.stop_colors[:0],
            stop_opacities=scene.stop_opacities[:0],
        )
        return replace(
            flat,
            canvas=self.canvas(scene.canvas),
            colors=self.colors[self.nearest(mean_colors(scene))],
            opacities=np.ones_like(scene.opacities),
        )


def mean_colors(scene: Scene) -> FloatArray:
    """Of each shape; of a gradient, the mean of its stops. Shape (shape, 3)."""
    colors = scene.colors.copy()
    counts = np.diff(scene.stop_first)
    owner = np.repeat(np.arange(len(scene)), counts)
    for channel in range(3):
        total = np.bincount(owner, weights=scene.stop_colors[:, channel], minlength=len(scene))
        colors[:, channel] = np.where(counts > 0, total / np.maximum(counts, 1), colors[:, channel])
    return colors


def main_colors(colors: FloatArray, often: IndexArray, count: int) -> FloatArray:
    """The ``count`` colours that stand for ``colors`` best (weighted k-means, from those furthest apart).

    They are 8-bit colours; one that most of those that it stands for are themselves is that colour exactly.

    Args:
        colors: sRGB in [0, 1], shape (color, 3).
        often: how often each is there, shape (color,).
        count: how many are wanted.

    Returns:
        shape (count or fewer, 3).
    """
    levels, which = np.unique(np.round(colors * 255), axis=0, return_inverse=True)
    weights = np.bincount(which.reshape(-1), weights=often).astype(np.float64)
    if len(levels) <= count:
        return np.asarray(levels / 255, np.float32) if len(levels) else np.zeros((1, 3), np.float32)
    centers = levels[[int(weights.argmax())]].astype(np.float64)
    while len(centers) < count:
        gain = weights * _apart(levels, centers).min(axis=1)
        centers = np.concatenate([centers, levels[[int(gain.argmax())]]])
    for _ in range(ROUNDS):
        nearest = _apart(levels, centers).argmin(axis=1)
        total = np.bincount(nearest, weights=weights, minlength=count)
        sums = [np.bincount(nearest, weights=weights * levels[:, c], minlength=count) for c in range(3)]
        means = np.stack(sums, axis=1) / np.maximum(total, 1e-9)[:, None]
        centers = np.where(total[:, None] > 0, means, centers)
    nearest = _apart(levels, centers).argmin(axis=1)
    for i in range(count):
        own = np.flatnonzero(nearest == i)
        if len(own) and weights[own].max() > 0.5 * weights[own].sum():
            centers[i] = levels[own[weights[own].argmax()]]
    return np.asarray(np.round(centers) / 255, np.float32)


def _apart(colors: Floats, others: Floats) -> Floats:
    """Squared distances, shape (color, other)."""
    return np.asarray(((colors[:, None] - others[None]) ** 2).sum(axis=2))
