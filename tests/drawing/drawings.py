"""Drawings for tests: shapes of corners, lines and smooth joints."""

from __future__ import annotations

import itertools
from collections import defaultdict
from dataclasses import replace

import numpy as np

from warpsplat.fit.constraints import Drawing
from warpsplat.scene import Canvas, FloatArray, Kind, Scene
from warpsplat.scene.joints import Joint
from warpsplat.scene.scene import starts_of

Outline = tuple[np.ndarray, list[Joint]]

ARC = 0.5522847498
"""Handles of a quarter of a circle, over its radius."""

LINE = [Joint.CORNER, Joint.LINE_HANDLE, Joint.LINE_HANDLE]
ROUND = [Joint.SMOOTH, Joint.FREE, Joint.FREE]


def turned(points: np.ndarray, angle: float, centre: tuple[float, float]) -> np.ndarray:
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return (points - centre) @ turn + centre


def polygon(*corners: tuple[float, float]) -> Outline:
    points = []
    for a, b in itertools.pairwise([*corners, corners[0]]):
        points += [np.add(a, np.subtract(b, a) * k / 3) for k in range(3)]
    return np.array(points), LINE * len(corners)


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
    """Shapes of a colour and contours; points at one place in several shapes are the same.

    ``spread``: standard deviation by which each place is off [px], neighbours by themselves.
    """
    outlines = [outline for _, contours in shapes for outline in contours]
    points = np.concatenate([points for points, _ in outlines])
    owner = np.repeat(np.arange(len(shapes)), [sum(len(p) for p, _ in contours) for _, contours in shapes])
    places: dict[tuple[float, float], list[int]] = defaultdict(list)
    for i, (x, y) in enumerate(np.round(points, 6).tolist()):
        places[x, y].append(i)
    same = np.full(len(points), -1, np.int32)
    rng = np.random.default_rng(0)
    moved = points.copy()
    for number, members in enumerate(places.values()):
        moved[members] += rng.normal(0, spread, 2) if spread else 0
        if len(set(owner[members])) > 1:
            same[members] = number
    scene = Scene.of(
        canvas,
        np.full(len(shapes), Kind.FILL, np.int32),
        starts_of(np.bincount(owner, minlength=len(shapes))),
        starts=starts_of(np.array([len(p) for p, _ in outlines])),
        closed=np.ones(len(outlines), np.int32),
        points=moved.astype(np.float32),
        colors=np.array([color for color, _ in shapes], np.float32),
        opacities=np.ones(len(shapes), np.float32),
    )
    return Drawing(scene, np.array([j for _, joints in outlines for j in joints], np.int32), same)


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
    down = [top, (16, 6), (21.0, 11.0), middle, (27, 21), (24, 27), bottom]
    line = [np.array(middle) + np.subtract((48, 16), middle) * k / 3 for k in range(4)]
    left = np.array(
        [
            *down,
            (44 / 3, 32),
            (22 / 3, 32),
            (0, 32),
            (0, 64 / 3),
            (0, 32 / 3),
            (0, 0),
            (20 / 3, 0),
            (40 / 3, 0),
        ]
    )
    left_joints = [Joint.CORNER, Joint.FREE, Joint.FREE, Joint.SMOOTH, Joint.FREE, Joint.FREE, *LINE * 3]
    upper = np.array(
        [
            top,
            (88 / 3, 0),
            (116 / 3, 0),
            (48, 0),
            (48, 16 / 3),
            (48, 32 / 3),
            *line[:0:-1],
            middle,
            *down[2:0:-1],
        ]
    )
    upper_joints = [*LINE * 3, Joint.CORNER, Joint.FREE, Joint.FREE]
    lower = np.array(
        [
            middle,
            *line[1:],
            (48, 64 / 3),
            (48, 80 / 3),
            (48, 32),
            (118 / 3, 32),
            (92 / 3, 32),
            bottom,
            *down[5:3:-1],
        ]
    )
    lower_joints = [*LINE * 3, Joint.CORNER, Joint.FREE, Joint.FREE]
    made = drawing(
        Canvas(48, 32, WHITE),
        (BLUE, [(left, left_joints)]),
        (GOLD, [(upper, upper_joints)]),
        (RED, [(lower, lower_joints)]),
        spread=spread,
    )
    if not spread:
        return made
    exact = seam().scene.points
    inner = (exact > 0) & (exact < (48, 32))  # the border stays
    return replace(made, scene=replace(made.scene, points=np.where(inner, made.scene.points, exact)))
