"""Limit shapes to a palette of few colours, and choose for each the one with the least error."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight
from warpsplat.fit.paints import without_gradients
from warpsplat.fit.place import reduced
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.scene import Canvas, FloatArray, IndexArray, Scene
from warpsplat.scene.geometry import areas

if TYPE_CHECKING:
    from warpsplat.fit.state import FitState
    from warpsplat.fit.step import Step

SOLID_OPACITY = 0.5
"""Minimum opacity of a pixel whose colour counts, and of a shape that is kept where all are made opaque."""

Floats = npt.NDArray[np.floating]


class Palette:
    """The colours that shapes may have.

    Each shape gets the colour with the least error, all else as it is. The squared error is a paraboloid in
    its colour, equally steep in all channels around the best one: the nearest colour of the palette has the
    least error. Every few steps all shapes choose at once; in between they are trained as they are.
    """

    def __init__(self, colors: FloatArray) -> None:
        """``colors``: sRGB in [0, 1], shape (color, 3)."""
        self.colors = colors

    @staticmethod
    def of(settings: Settings, target: FloatArray) -> Palette | None:
        """Return the settings' palette, or the main colours of ``target``; None if any are allowed."""
        if settings.palette:
            return Palette(np.array([solid_color(color) for color in settings.palette], np.float32))
        if settings.colors is None:
            return None
        small, _ = reduced(target)
        pixels = small.reshape(-1, small.shape[2])
        if target.shape[2] == 4:
            pixels = pixels[pixels[:, 3] > SOLID_OPACITY]
        return Palette(main_colors(straight(pixels), np.ones(len(pixels), np.int64), settings.colors))

    @staticmethod
    def of_scene(settings: Settings, scene: Scene) -> Palette | None:
        """Return the settings' palette, or the main colours of a scene, weighted by area."""
        if settings.palette or settings.colors is None:
            return Palette.of(settings, np.zeros((1, 1, 3), np.float32))
        colors, weights = mean_colors(scene), np.maximum(areas(scene), 1.0)
        background = scene.canvas.background
        if background is not None:
            canvas = scene.canvas.width * scene.canvas.height
            colors, weights = np.concatenate([colors, background[None]]), np.append(weights, canvas)
        return Palette(main_colors(colors, np.ceil(weights).astype(np.int64), settings.colors))

    def nearest(self, colors: FloatArray) -> FloatArray:
        """Return the palette's colour nearest to each of ``colors``, shape (color, 3)."""
        return np.asarray(self.colors[_distances(colors, self.colors).argmin(axis=1)])

    def canvas(self, canvas: Canvas) -> Canvas:
        """Return ``canvas`` with a background of the palette."""
        if canvas.background is None:
            return canvas
        return replace(canvas, background=self.nearest(canvas.background[None])[0])

    def is_due(self, state: FitState) -> bool:
        """Return whether to choose: every few steps, and at once when shapes have come or gone."""
        choice_interval = 5  # steps between two choices of colours; a choice takes as long as a step
        return state.step % choice_interval == 0 or state.colored != state.parameters.revision

    def choose(self, step: Step) -> None:
        """Give each shape the colour with the least error."""
        parameters = step.state.parameters
        scene = step.state.scene()
        parameters.assign(replace(scene, colors=self.nearest(best_colors(step, scene))))
        step.state.colored = parameters.revision

    def limited(self, scene: Scene) -> Scene:
        """Return the scene in these colours, opaque and without gradients (see ``solid_shapes``)."""
        colors = self.nearest(mean_colors(scene))
        return replace(
            without_gradients(scene, np.ones(len(scene), np.bool_), colors),
            canvas=self.canvas(scene.canvas),
            frames=np.zeros_like(scene.frames),
            focus=np.zeros_like(scene.focus),
            opacities=np.ones_like(scene.opacities),
        )


def best_colors(step: Step, scene: Scene) -> FloatArray:
    """Return the colour of each shape with the least weighted squared error, all else as it is.

    Least squares over its visible pixels, which are copied to the host; a shape without any keeps its own.
    The colours are sRGB, not clipped, shape (shape, 3).
    """
    step.render()
    seen = step.renderer.visible()
    near = step.objective.quadratic()
    weighted = near.pixel_weights()[seen.tile] * seen.share
    squares = (weighted * seen.share).sum(axis=(1, 2), dtype=np.float64)
    residual = near.residual()[seen.tile]
    residual *= weighted[:, None]
    pulls = residual.sum(axis=(2, 3))
    total = np.bincount(seen.shape, weights=squares, minlength=len(scene))
    colors = scene.colors.copy()
    min_visible = 1e-6  # minimum sum of a shape's squared visibility [pixels] at which it chooses a colour
    for channel in range(3):
        pull = np.bincount(seen.shape, weights=pulls[:, channel], minlength=len(scene))
        colors[:, channel] += np.where(total > min_visible, pull / np.maximum(total, min_visible), 0)
    return colors


def mean_colors(scene: Scene) -> FloatArray:
    """Return the colour of each shape, for gradients the mean of their stops; shape (shape, 3)."""
    channels = [_mean(scene, scene.colors[:, c], scene.stop_colors[:, c]) for c in range(3)]
    return np.stack(channels, axis=1)


def solid_shapes(scene: Scene) -> IndexArray:
    """Return the shapes of at least ``SOLID_OPACITY``; gradients have the mean of their stops."""
    stops = scene.stop_opacities * np.repeat(scene.opacities, np.diff(scene.stop_first))
    return np.flatnonzero(_mean(scene, scene.opacities, stops) >= SOLID_OPACITY)


def _mean(scene: Scene, flat: FloatArray, stops: FloatArray) -> FloatArray:
    """Return each flat shape's own value and each gradient's mean of ``stops``, shape (shape,)."""
    counts = np.diff(scene.stop_first)
    owner = np.repeat(np.arange(len(scene)), counts)
    total = np.bincount(owner, weights=stops, minlength=len(scene))
    return np.where(counts > 0, total / np.maximum(counts, 1), flat).astype(np.float32)


def main_colors(colors: FloatArray, weights: IndexArray, count: int) -> FloatArray:
    """Return the ``count`` 8-bit colours that represent ``colors`` best: k-means, farthest-first start.

    A colour that makes up most of its cluster represents the cluster as it is. ``colors`` and the result are
    sRGB in [0, 1], shape (color, 3), with ``count`` rows or fewer; ``weights`` has shape (color,).
    """
    levels, which = np.unique(np.round(colors * 255), axis=0, return_inverse=True)
    totals = np.bincount(which.reshape(-1), weights=weights).astype(np.float64)
    if len(levels) <= count:
        return np.asarray(levels / 255, np.float32) if len(levels) else np.zeros((1, 3), np.float32)
    centers = levels[[int(totals.argmax())]].astype(np.float64)
    while len(centers) < count:
        gain = totals * _distances(levels, centers).min(axis=1)
        centers = np.concatenate([centers, levels[[int(gain.argmax())]]])
    kmeans_rounds = 20
    for _ in range(kmeans_rounds):
        cluster = _distances(levels, centers).argmin(axis=1)
        size = np.bincount(cluster, weights=totals, minlength=count)
        sums = [np.bincount(cluster, weights=totals * levels[:, c], minlength=count) for c in range(3)]
        means = np.stack(sums, axis=1) / np.maximum(size, 1e-9)[:, None]
        centers = np.where(size[:, None] > 0, means, centers)
    cluster = _distances(levels, centers).argmin(axis=1)
    for i in range(count):
        own = np.flatnonzero(cluster == i)
        if len(own) and totals[own].max() > 0.5 * totals[own].sum():
            centers[i] = levels[own[totals[own].argmax()]]
    return np.asarray(np.round(centers) / 255, np.float32)


def _distances(colors: Floats, others: Floats) -> Floats:
    """Return squared distances, shape (color, other)."""
    return np.asarray(((colors[:, None] - others[None]) ** 2).sum(axis=2))
