"""Drawings for tests: shapes of corners, lines and smooth joints; and whole runs."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np

from tests.runs import vectorize
from warpsplat.drawing.constraints import Drawing
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.run.result import Result
from warpsplat.scene import Canvas, FloatArray, Kind, Scene
from warpsplat.scene.attributes import Joint
from warpsplat.scene.scene import starts_of

Outline = tuple[np.ndarray, list[Joint]]
Point = tuple[float, float]

ARC = 0.5522847498
"""Handles of a quarter of a circle, over its radius."""

LINE = [Joint.CORNER, Joint.LINE_HANDLE, Joint.LINE_HANDLE]
ROUND = [Joint.SMOOTH, Joint.FREE, Joint.FREE]


def vectorized(image: FloatArray, device: str, subject: str = "drawing", **options: Any) -> Result:
    return vectorize(image, make_settings(subject=subject, **options), Backend.on(device))


def turned(points: np.ndarray, angle: float, centre: tuple[float, float]) -> np.ndarray:
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return (points - centre) @ turn + centre


def outline(start: Point, *pieces: tuple[Point, ...]) -> Outline:
    """A ring of lines (end,) and cubics (handle, handle, end), smooth where two cubics meet."""
    points, joints = [], []
    before = 1
    for piece in pieces:
        if len(piece) == 1:
            points += [np.add(start, np.subtract(piece[0], start) * k / 3) for k in range(3)]
            joints += LINE
        else:
            points += [start, *piece[:2]]
            joints += [Joint.CORNER if before == 1 else Joint.SMOOTH, Joint.FREE, Joint.FREE]
        start, before = piece[-1], len(piece)
    return np.array(points), joints


def polygon(*corners: Point) -> Outline:
    return outline(corners[0], *((corner,) for corner in (*corners[1:], corners[0])))


def star(x: float, y: float, outer: float, inner: float) -> Outline:
    angle = -np.pi / 2 + np.pi * np.arange(10) / 5
    radius = np.where(np.arange(10) % 2, inner, outer)
    return polygon(*zip(x + radius * np.cos(angle), y + radius * np.sin(angle), strict=True))


def disc(x: float, y: float, radius: float, angle: float = 0.0) -> Outline:
    quarter = np.array([[1, 0], [1, ARC], [ARC, 1]])
    quarters = [turned(quarter, k * np.pi / 2, (0, 0)) for k in range(4)]
    return turned(radius * np.concatenate(quarters) + (x, y), angle, (x, y)), ROUND * 4


def rounded(x: float, y: float, half: float, radius: float, angle: float = 0.0) -> Outline:
    """A square with rounded corners."""
    arc = radius * np.array([[1, 0], [1, ARC], [ARC, 1], [0, 1]]) + (half - radius)
    side = np.array([[-(half - radius), half], [half - radius, half]])
    corner = np.concatenate([arc[:3], [side[1], side[1] + (side[0] - side[1]) / 3]])
    corner = np.concatenate([corner, [side[1] + (side[0] - side[1]) * 2 / 3]])
    corners = [turned(corner, k * np.pi / 2, (0, 0)) for k in range(4)]
    points = turned(np.concatenate(corners) + (x, y), angle, (x, y))
    return points, [*ROUND, Joint.SMOOTH, Joint.LINE_HANDLE, Joint.LINE_HANDLE] * 4


def drawing(
    canvas: Canvas, *shapes: tuple[tuple[float, float, float], list[Outline]], spread: float = 0.0
) -> Drawing:
    """Shapes of a colour and contours.

    ``spread``: standard deviation by which each place is off [px], neighbours by themselves.
    """
    outlines = [outline for _, contours in shapes for outline in contours]
    points = np.concatenate([points for points, _ in outlines])
    owner = np.repeat(np.arange(len(shapes)), [sum(len(p) for p, _ in contours) for _, contours in shapes])
    places: dict[tuple[float, float], list[int]] = defaultdict(list)
    for i, (x, y) in enumerate(np.round(points, 6).tolist()):
        places[x, y].append(i)
    rng = np.random.default_rng(0)
    moved = points.copy()
    for members in places.values():
        moved[members] += rng.normal(0, spread, 2) if spread else 0
    scene = Scene(
        canvas,
        np.full(len(shapes), Kind.FILL, np.int32),
        starts_of(np.bincount(owner, minlength=len(shapes))),
        starts=starts_of(np.array([len(p) for p, _ in outlines])),
        closed=np.ones(len(outlines), np.int32),
        points=moved.astype(np.float32),
        colors=np.array([color for color, _ in shapes], np.float32),
        opacities=np.ones(len(shapes), np.float32),
    )
    return Drawing(scene, np.array([j for _, joints in outlines for j in joints], np.int32))


WHITE = np.ones(3, np.float32)
BLUE, RED, GOLD = (0.0, 0.2, 0.8), (0.8, 0.2, 0.2), (1.0, 0.8, 0.0)


def logo(background: FloatArray | None = WHITE, spread: float = 0.0) -> Drawing:
    """A rounded square, a star, a ring and a tilted rounded square, 64 px."""
    return drawing(
        Canvas(64, 64, background),
        (BLUE, [rounded(32, 32, 28, 10)]),
        (RED, [disc(46, 20, 9, 0.3), (disc(46, 20, 4, 0.3)[0][::-1][[-1, *range(11)]], ROUND * 4)]),
        (GOLD, [star(24, 28, 15, 6)]),
        ((1.0, 1.0, 1.0), [rounded(42, 46, 9, 3, 0.2)]),
        spread=spread,
    )


def seam(spread: float = 0.0) -> Drawing:
    """Two regions that fill the canvas and share a wavy edge, which a third one meets, 48 x 32 px."""
    top, middle, bottom = (20.0, 0.0), (24.0, 16.0), (22.0, 32.0)
    above, below = ((16.0, 6.0), (21.0, 11.0)), ((27.0, 21.0), (24.0, 27.0))
    corner, side, end = (48.0, 0.0), (48.0, 16.0), (48.0, 32.0)
    left = outline(top, (*above, middle), (*below, bottom), ((0, 32),), ((0, 0),), (top,))
    upper = outline(top, (corner,), (side,), (middle,), (*above[::-1], top))
    lower = outline(middle, (side,), (end,), (bottom,), (*below[::-1], middle))
    canvas = Canvas(48, 32, WHITE)
    made = drawing(canvas, (BLUE, [left]), (GOLD, [upper]), (RED, [lower]), spread=spread)
    if not spread:
        return made
    exact = seam().scene.points
    inner = (exact > 0) & (exact < (48, 32))  # the border stays
    return replace(made, scene=replace(made.scene, points=np.where(inner, made.scene.points, exact)))
