"""Few colours: shapes that have only those of a palette, and which of them each has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight
from warpsplat.fit.place import survey
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step
from warpsplat.scene import Canvas, FloatArray, IndexArray, Scene
from warpsplat.scene.geometry import areas

ROUNDS = 20
"""Of k-means."""

CHOICE_INTERVAL = 5
"""Steps between two choices of colours: a look at all that is seen takes as long as a step."""

UNSEEN = 1e-6
"""Pixels, by the squares of their shares, below which a shape asks for no colour."""

SOLID = 0.5
"""Opacity from which on a pixel's colour counts, and a shape that may not be translucent is painted."""


Floats = npt.NDArray[np.floating]


class Palette:
    """The colours that shapes may have.

    Each shape has the one with which the error is least, all else as it is. Another colour changes the
    squared error by a paraboloid that is as steep in all channels, around the colour that would be best: so
    that of the palette is best which is nearest to it. It is chosen anew every few steps, at once for all
    shapes; in between they are trained as they are.
    """

    def __init__(self, colors: FloatArray) -> None:
        """``colors``: sRGB in [0, 1], shape (color, 3)."""
        self.colors = colors

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
        return Palette(main_colors(straight(pixels), np.ones(len(pixels), np.int64), settings.colors))

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

    def is_due(self, state: FitState) -> bool:
        """Whether it is time to choose: every few steps, and at once where shapes have come or gone."""
        return state.step % CHOICE_INTERVAL == 0 or state.colored != state.parameters.revision

    def choose(self, step: Step) -> None:
        """Give each shape the colour with which the error is least."""
        parameters = step.state.parameters
        scene = step.state.scene()
        parameters.assign(replace(scene, colors=self.colors[self.nearest(best_colors(step, scene))]))
        step.state.colored = parameters.revision

    def limited(self, scene: Scene) -> Scene:
        """A scene in these colours, without gradients and opaque (see ``solid_shapes``)."""
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


def best_colors(step: Step, scene: Scene) -> FloatArray:
    """Of each shape, the colour with which the weighted squared error would be least, all else as it is.

    By least squares over what is seen of it; its own where nothing is. Copies what is seen to the host: for
    use between steps.

    Returns:
        sRGB, not clipped, shape (shape, 3).
    """
    step.render()
    seen = step.renderer.visible()
    weighted = step.weights()[seen.tile] * seen.share
    squares = (weighted * seen.share).sum(axis=(1, 2), dtype=np.float64)
    lacking = step.lacking()[seen.tile]
    lacking *= weighted[:, None]
    pulls = lacking.sum(axis=(2, 3))
    total = np.bincount(seen.shape, weights=squares, minlength=len(scene))
    colors = scene.colors.copy()
    for channel in range(3):
        pull = np.bincount(seen.shape, weights=pulls[:, channel], minlength=len(scene))
        colors[:, channel] += np.where(total > UNSEEN, pull / np.maximum(total, UNSEEN), 0)
    return colors


def mean_colors(scene: Scene) -> FloatArray:
    """Of each shape; of a gradient, the mean of its stops. Shape (shape, 3)."""
    channels = [_mean(scene, scene.colors[:, c], scene.stop_colors[:, c]) for c in range(3)]
    return np.stack(channels, axis=1)


def solid_shapes(scene: Scene) -> IndexArray:
    """Those that are more opaque than not, gradients in the mean of their stops."""
    stops = scene.stop_opacities * np.repeat(scene.opacities, np.diff(scene.stop_first))
    return np.flatnonzero(_mean(scene, scene.opacities, stops) >= SOLID)


def _mean(scene: Scene, flat: FloatArray, stops: FloatArray) -> FloatArray:
    """Of each shape, its own value, or the mean of those of its stops; shape (shape,)."""
    counts = np.diff(scene.stop_first)
    owner = np.repeat(np.arange(len(scene)), counts)
    total = np.bincount(owner, weights=stops, minlength=len(scene))
    return np.where(counts > 0, total / np.maximum(counts, 1), flat).astype(np.float32)


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
