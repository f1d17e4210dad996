"""Small scenes for tests."""

from __future__ import annotations

import numpy as np

from warpsplat.scene import Kind, Scene


def random_scene(
    kind: Kind,
    count: int = 4,
    width: int = 40,
    height: int = 36,
    *,
    seed: int = 0,
    chain_cubics: int = 2,
    opacity_count: int = 1,
    stroke_cubics: int = 3,
) -> Scene:
    """Wobbly blobs or strokes, some of them partly off the canvas."""
    rng = np.random.default_rng(seed)
    size = np.array([width, height])
    centre = rng.uniform(0, 1, (count, 1, 2)) * size
    if kind == "closed":
        points = 6 * chain_cubics
        angle = 2 * np.pi * np.arange(points) / points
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        radius = rng.uniform(4, 12, (count, points, 1)) * 1.15
        outline = centre + radius * ring
    else:
        points = 3 * stroke_cubics + 1
        direction = rng.uniform(0, 2 * np.pi, (count, 1, 1))
        along = np.linspace(-14, 14, points)[None, :, None]
        outline = centre + along * np.concatenate([np.cos(direction), np.sin(direction)], axis=2)
        outline = outline + rng.normal(0, 2.0, outline.shape)
    return Scene(
        kind=kind,
        width=width,
        height=height,
        points=outline.astype(np.float32),
        colors=rng.uniform(0.05, 0.95, (count, 3)).astype(np.float32),
        opacities=rng.uniform(0.4, 0.95, (count, opacity_count)).astype(np.float32),
        widths=(rng.uniform(1.5, 7, count) if kind == "open" else np.zeros(count)).astype(np.float32),
        background=np.array([0.2, 0.5, 0.7], np.float32),
    )


def disc(radius: float, size: int, centre: float, chain_cubics: int = 2) -> Scene:
    """One white, opaque disc on black; four-point circle approximations of cubics."""
    n = 2 * chain_cubics
    k = 4 / 3 * np.tan(np.pi / (2 * n))
    points = []
    for i in range(n):
        a, b = 2 * np.pi * i / n, 2 * np.pi * (i + 1) / n
        p0, p3 = np.array([np.cos(a), np.sin(a)]), np.array([np.cos(b), np.sin(b)])
        points += [p0, p0 + k * np.array([-p0[1], p0[0]]), p3 - k * np.array([-p3[1], p3[0]])]
    return Scene(
        kind="closed",
        width=size,
        height=size,
        points=(np.array(points)[None] * radius + centre).astype(np.float32),
        colors=np.ones((1, 3), np.float32),
        opacities=np.ones((1, 1), np.float32),
        widths=np.zeros(1, np.float32),
        background=np.zeros(3, np.float32),
    )
