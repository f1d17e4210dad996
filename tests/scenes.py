"""Small scenes for tests."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpsplat.forms import form_of
from warpsplat.scene import Basis, Canvas, Cap, FloatArray, Join, KeptPicture, Kind, Paint, Rule, Scene
from warpsplat.scene.attributes import NO_DASHES
from warpsplat.scene.geometry import bounds
from warpsplat.scene.scene import starts_of

CURVES = CUBIC, SPLINE = Basis.CUBIC, Basis.SPLINE
FILL_CUBICS, STROKE_CUBICS = 4, 3
FILL_QUADRATICS, STROKE_QUADRATICS = 12, 5
"""Béziers of a shape, about as many as in a run."""


def canvas(width: int, height: int) -> Canvas:
    return Canvas(width, height, np.array([0.2, 0.5, 0.7], np.float32))


def random_scene(
    kind: Kind,
    count: int = 4,
    width: int = 40,
    height: int = 36,
    *,
    seed: int = 0,
    basis: Basis = CUBIC,
    beziers: int | None = None,
) -> Scene:
    """Return wobbly blobs or strokes of ``beziers`` each, some of them partly off the canvas."""
    rng = np.random.default_rng(seed)
    centre = rng.uniform(0, 1, (count, 1, 2)) * np.array([width, height])
    outlines = _blobs if kind == Kind.FILL else _strokes
    usual = {CUBIC: (FILL_CUBICS, STROKE_CUBICS), SPLINE: (FILL_QUADRATICS, STROKE_QUADRATICS)}
    beziers = beziers or usual[basis][kind == Kind.STROKE]
    points = outlines(rng, centre, point_count(kind, basis, beziers))
    values = {"colors": rng.uniform(0.05, 0.95, (count, 3)), "opacities": rng.uniform(0.4, 0.95, count)}
    values["widths"] = rng.uniform(1.5, 7, count) if kind == Kind.STROKE else np.zeros(count)
    return Scene.uniform(kind, canvas(width, height), points, basis, **values)


def point_count(kind: Kind, basis: Basis, beziers: int) -> int:
    """Return the number of control points of a shape of ``beziers``."""
    if basis == CUBIC:
        return 3 * beziers + (kind == Kind.STROKE)
    return beziers + 2 * (kind == Kind.STROKE)


def _blobs(rng: np.random.Generator, centre: np.ndarray, count: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return centre + rng.uniform(4, 12, (len(centre), count, 1)) * 1.15 * ring


def _strokes(rng: np.random.Generator, centre: np.ndarray, count: int) -> np.ndarray:
    direction = rng.uniform(0, 2 * np.pi, (len(centre), 1, 1))
    along = np.linspace(-14, 14, count)[None, :, None]
    line = centre + along * np.concatenate([np.cos(direction), np.sin(direction)], axis=2)
    return line + rng.normal(0, 2.0, line.shape)


Outline = tuple[Kind, Basis, int]
"""Kind and basis of a shape, and its number of Béziers."""


def ragged_scene(shapes: Sequence[Outline], width: int = 40, height: int = 36, *, seed: int = 0) -> Scene:
    """Return a random shape for each outline, the first one at the back."""
    scenes = [
        random_scene(kind, 1, width, height, seed=100 * seed + i, basis=basis, beziers=beziers)
        for i, (kind, basis, beziers) in enumerate(shapes)
    ]
    return functools.reduce(Scene.append, scenes)


FILL, STROKE = Kind.FILL, Kind.STROKE
FORMS: tuple[tuple[Basis, Kind, int], ...] = (
    *((basis, FILL, 5) for basis in Basis if basis.is_form),
    *(
        (Basis.POLYGON, STROKE, 2),
        (Basis.POLYGON, FILL, 3),
        (Basis.POLYGON, STROKE, 4),
        (Basis.CIRCLE, FILL, 0),
    ),
)
"""Forms, kinds, and numbers of vertices where the form has them."""
MIXED_CUBICS: tuple[Outline, ...] = (
    *((FILL, CUBIC, 4), (STROKE, CUBIC, 3), (STROKE, CUBIC, 1), (FILL, CUBIC, 2)),
    *((STROKE, CUBIC, 5), (FILL, CUBIC, 6), (STROKE, CUBIC, 2), (FILL, CUBIC, 4)),
)
"""Fills and strokes of different numbers of cubics, even ones for fills, as splats need."""

MIXED: tuple[Outline, ...] = (
    *((FILL, SPLINE, 12), (STROKE, CUBIC, 3), (STROKE, SPLINE, 1), (FILL, CUBIC, 3), (FILL, SPLINE, 3)),
    *((STROKE, SPLINE, 6), (STROKE, CUBIC, 1), (FILL, CUBIC, 4), (FILL, SPLINE, 7), (STROKE, SPLINE, 2)),
)
"""Fills and strokes of both bases, from the fewest points on."""


def mixed_scene(width: int = 40, height: int = 36, *, seed: int = 0, splines: bool = True) -> Scene:
    """Return fills and strokes of different lengths; without splines, as splats need."""
    return ragged_scene(MIXED if splines else MIXED_CUBICS, width, height, seed=seed)


def contours_scene(kind: Kind, rule: Rule = Rule.NONZERO, *, seed: int = 0) -> Scene:
    """Return shapes of several contours each, of both bases, closed and open, that overlap themselves."""
    shapes = []
    for i, basis in enumerate((CUBIC, SPLINE, CUBIC)):
        parts = [
            random_scene(like, 1, seed=seed + 10 * i + k, basis=basis, beziers=5 + k)
            for k, like in enumerate((Kind.FILL, Kind.STROKE, Kind.FILL))
        ]
        points = [part.points - part.points.mean(axis=0) + [12 + 8 * i, 18] for part in parts]
        counts = [len(own) for own in points]
        shapes.append(
            Scene(
                canvas(40, 36),
                np.array([kind], np.int32),
                np.array([0, sum(counts)], np.int32),
                np.array([basis], np.int32),
                starts=starts_of(np.array(counts)),
                closed=np.array([part.kind[0] == Kind.FILL for part in parts], np.int32),
                rule=np.array([rule], np.int32),
                points=np.concatenate(points).astype(np.float32),
                colors=parts[0].colors,
                opacities=parts[0].opacities,
                widths=np.full(1, 2.5 if kind == Kind.STROKE else 0, np.float32),
            )
        )
    return functools.reduce(Scene.append, shapes)


def forms_scene(width: int = 40, height: int = 36, *, seed: int = 0) -> Scene:
    """Return shapes of all forms, filled and stroked, turned and partly off the canvas."""
    rng = np.random.default_rng(seed)
    scenes = []
    for basis, kind, count in FORMS:
        scene = random_scene(kind, 1, width, height, seed=seed + len(scenes))
        centre, area = rng.uniform(0.2, 0.8, (1, 2)) * [width, height], rng.uniform(90, 250, 1)
        values = form_of(basis.name).start(centre, area, rng.uniform(0.2, 1.3, 1), max(count, 3))
        values = values[:, : count or None]
        values[:, 1:] *= rng.uniform(0.7, 1.2, values[:, 1:].shape)
        values = np.ascontiguousarray(values, np.float32).reshape(-1, 2)
        first = np.array([0, len(values)], np.int32)
        scenes.append(
            replace(scene, basis=np.array([basis], np.int32), points=values, first=first, starts=first)
        )
    return functools.reduce(Scene.append, scenes)


def with_gradients(scene: Scene, *, seed: int = 0) -> Scene:
    """Give every shape but the last a gradient of one to three stops, linear and radial in turn."""
    rng = np.random.default_rng(seed)
    count = len(scene)
    stops = np.arange(count) % 3 + 1
    stops[-1] = 0
    total = int(stops.sum())
    low, high = bounds(scene)[:, :2], bounds(scene)[:, 2:]
    axes = rng.uniform(0.3, 0.5, (count, 2)) * (high - low)
    turned = np.stack([-axes[:, 1], axes[:, 0]], axis=1) * rng.uniform(0.6, 1.4, (count, 1)) + 0.1 * axes
    offsets = [np.sort(rng.uniform(0.1, 0.9, n)) for n in stops]
    paint = np.where(stops == 0, Paint.FLAT, 1 + np.arange(count) % 2)
    return replace(
        scene,
        paint=paint.astype(np.int32),
        spread=(np.arange(count) % 3).astype(np.int32),
        frames=np.concatenate([(low + high) / 2, axes, turned], axis=1).astype(np.float32),
        focus=(rng.uniform(0, 0.3, (count, 3)) * (paint == Paint.RADIAL)[:, None]).astype(np.float32),
        stop_first=starts_of(stops),
        stop_offsets=np.concatenate(offsets).astype(np.float32),
        stop_colors=rng.uniform(0.05, 0.95, (total, 3)).astype(np.float32),
        stop_opacities=rng.uniform(0.3, 1.0, total).astype(np.float32),
    )


def with_stops(scene: Scene, offsets: Sequence[float] = (0.1, 0.8), *, seed: int = 0) -> Scene:
    """Give each shape but the last a padded gradient with stops at ``offsets``, linear or radial in turn."""
    scene = with_gradients(scene, seed=seed)
    rng = np.random.default_rng(seed)
    stops = len(offsets) * (scene.paint != Paint.FLAT)
    total = int(stops.sum())
    return replace(
        scene,
        spread=np.zeros_like(scene.spread),
        focus=np.zeros_like(scene.focus),
        stop_first=starts_of(stops),
        stop_offsets=np.tile(np.array(offsets, np.float32), total // len(offsets)),
        stop_colors=rng.uniform(0.05, 0.95, (total, 3)).astype(np.float32),
        stop_opacities=rng.uniform(0.3, 1.0, total).astype(np.float32),
    )


def with_points(scene: Scene, points: FloatArray) -> FloatArray:
    """Return points of alike shapes, shape (shape, point, 2), as rows of the scene."""
    return np.ascontiguousarray(points, np.float32).reshape(scene.points.shape)


def points_by_shape(scene: Scene) -> FloatArray:
    """Return a copy of the points of alike shapes, shape (shape, point, 2)."""
    (group,) = scene.alike()
    return group.points.copy()


RING_STEPS = {SPLINE: 1, CUBIC: 3}
"""Points between two at which a ring may start."""


def started_alike(scene: Scene, like: Scene) -> Scene:
    """Return ``scene`` with its rings rolled to start as those of ``like``: files do not keep the start."""
    points = scene.points.copy()
    for i in np.flatnonzero(scene.kind == Kind.FILL):
        ring, other = scene.points_of(i), like.points_of(i)
        rolled = [np.roll(ring, shift, axis=0) for shift in range(0, len(ring), RING_STEPS[scene.basis[i]])]
        points[scene.first[i] : scene.first[i + 1]] = min(rolled, key=lambda r: np.abs(r - other).sum())
    return replace(scene, points=points)


def picture_scene(canvas: Canvas, picture: KeptPicture) -> Scene:
    """Return a picture on all of a canvas."""
    return replace(
        disc(500, canvas.width, canvas.width / 2),
        canvas=canvas,
        opacities=np.ones(1, np.float32),
        paint=np.array([Paint.PICTURE], np.int32),
        picture=np.zeros(1, np.int32),
        pictures=(picture,),
    )


def disc(radius: float, size: int, centre: float, cubics: int = FILL_CUBICS) -> Scene:
    """Return a white, opaque disc on black, a ring of cubics."""
    k = 4 / 3 * np.tan(np.pi / (2 * cubics))
    points = []
    for i in range(cubics):
        a, b = 2 * np.pi * i / cubics, 2 * np.pi * (i + 1) / cubics
        p0, p3 = np.array([np.cos(a), np.sin(a)]), np.array([np.cos(b), np.sin(b)])
        points += [p0, p0 + k * np.array([-p0[1], p0[0]]), p3 - k * np.array([-p3[1], p3[0]])]
    return Scene.uniform(
        Kind.FILL,
        Canvas(size, size, np.zeros(3, np.float32)),
        np.array(points)[None] * radius + centre,
        colors=np.ones((1, 3)),
        opacities=np.ones(1),
    )


DASHES = (
    (0.0, 7.0, 5.0),
    (-3.0, 9.0, 6.5, 2.0, 7.0),
    (2.5, 0.0, 6.0),
    (1.0, 300.0, 5.0),
)
"""Patterns with offsets, of several dashes, of dots, and longer than their strokes."""


def styled_scene(cap: Cap, join: Join, dash: int = NO_DASHES, *, seed: int = 0, limit: float = 4.0) -> Scene:
    """Return strokes of several contours, closed and open, smooth and with corners."""
    return styled(replace(contours_scene(Kind.STROKE, seed=seed), dashes=DASHES), cap, join, limit, dash)


def styled(scene: Scene, cap: Cap, join: Join, limit: float, dash: int) -> Scene:
    """Return strokes with these styles."""
    count = len(scene)
    return replace(
        scene,
        cap=np.full(count, cap, np.int32),
        join=np.full(count, join, np.int32),
        miter_limits=np.full(count, limit, np.float32),
        dash=np.full(count, dash, np.int32),
    )


def polyline_scene(
    contours: Sequence[tuple[Sequence[tuple[float, float]], bool]],
    width: float,
    size: tuple[int, int] = (64, 64),
    *,
    cap: Cap,
    join: Join,
    miter_limits: float = 4.0,
    dash: int = NO_DASHES,
    dashes: tuple[tuple[float, ...], ...] = (),
) -> Scene:
    """Return a white stroke on black along straight lines, closed or not."""
    points = []
    for corners, closed in contours:
        ring = np.array([*corners, corners[0]] if closed else corners, np.float64)
        sides = [a + (b - a) * t for a, b in itertools.pairwise(ring) for t in (0, 1 / 3, 2 / 3)]
        points.append(np.array(sides if closed else [*sides, ring[-1]]))
    counts = np.array([len(own) for own in points])
    scene = Scene(
        Canvas(*size, np.zeros(3, np.float32)),
        np.array([Kind.STROKE], np.int32),
        np.array([0, counts.sum()], np.int32),
        starts=starts_of(counts),
        closed=np.array([closed for _, closed in contours], np.int32),
        points=np.concatenate(points).astype(np.float32),
        colors=np.ones((1, 3), np.float32),
        opacities=np.ones(1, np.float32),
        widths=np.array([width], np.float32),
        dashes=dashes,
    )
    return styled(scene, cap, join, miter_limits, dash)
