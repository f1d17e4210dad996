"""Flat colours by least squares through optics: no pixel may show that of a letter or a line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.drawing.optics import RIDGE, Seen
from warpsplat.drawing.trace.grids import Floats, channel_max
from warpsplat.drawing.trace.seeds import ROUNDING
from warpsplat.fit.optics import Kernel
from warpsplat.portable.linear import product, solve
from warpsplat.scene import FloatArray, Paint, Scene

MOST_COLORS = 15
"""Flat colours that are solved for, at the most: each three take a render."""

STEPS = 4096
"""Steps of shares from 0 to 1, so that sums of their products are exact."""


def with_seen_colors(scene: Scene, seen: Seen, kernel: Kernel, draw: Callable[[Scene], FloatArray]) -> Scene:
    """Return a scene whose flat colours explain a picture best through its optics.

    Args:
        scene: Of the picture.
        seen: The picture.
        kernel: Its optics.
        draw: Renders a scene.
    """
    is_flat, ground = (scene.paint == Paint.FLAT) & (scene.opacities == 1), scene.canvas.background
    beyond = np.zeros((0, 3)) if ground is None else ground[None]
    colors, number = np.unique(
        np.round(255 * np.concatenate([scene.colors[is_flat], beyond])), axis=0, return_inverse=True
    )
    if not 0 < len(colors) <= MOST_COLORS or seen.is_halved:
        return scene
    number = number.reshape(-1)

    def painted(colors: Floats, others: FloatArray, stops: FloatArray) -> Scene:
        """Return the scene in flat colours, shape (color, 3), beside the others."""
        values, own = np.asarray(colors, np.float32)[number], others.copy()
        own[is_flat] = values[: is_flat.sum()]
        canvas = scene.canvas if ground is None else replace(scene.canvas, background=values[-1])
        return replace(scene, colors=own, stop_colors=stops, canvas=canvas)

    some = np.nonzero(seen.near_edges)
    black, shares = (np.zeros_like(scene.colors), np.zeros_like(scene.stop_colors)), []
    for first in range(0, len(colors), 3):
        unit = np.eye(len(colors), 3, -first)
        image = seen.through(draw(seen.scenes(painted(unit, *black))[0]), kernel, some)
        shares.append(np.round(image[:, : min(3, len(colors) - first)] * (STEPS / 255)) / STEPS)
    share, light = np.concatenate(shares, axis=1), seen.in_light(seen.levels[some])[:, :3]
    before = seen.in_light(colors)
    if not is_flat.all():
        fine = draw(seen.scenes(scene)[-1])
        light = light - np.round(seen.through(fine, kernel, some)[:, :3] - product(share, before))
    after, plain = before.copy(), seen.levels[~seen.near_edges][:, :3]
    # What areas show, they show.
    shown = np.array(
        [(channel_max(np.abs(plain - color)) <= ROUNDING + seen.noise).sum() for color in colors]
    )
    for channel in range(3):
        goal, now = light[:, channel], product(share, before[:, channel])
        # What is beyond black or white tells no more than that.
        free = ~(((goal <= 0) & (now < 0)) | ((goal >= 255) & (now > 255)))
        own = share[free].T
        normal = np.array([[(one * other).sum() for one in own] for other in own])
        held = RIDGE * np.diag(normal) + shown + 1e-6
        right = np.array([(one * goal[free]).sum() for one in own]) + held * before[:, channel]
        after[:, channel] = solve(normal + np.diag(held), right)
    found = seen.in_srgb(after)
    is_off = np.abs(found - colors).max(axis=1, keepdims=True) > ROUNDING + seen.noise
    return painted(np.where(is_off, found, colors) / 255, scene.colors, scene.stop_colors)
