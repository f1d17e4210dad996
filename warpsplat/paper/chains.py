"""Scenes that grids of Gaussians can show: one chain of cubics per shape, an even number in fills."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat.scene.attributes import NO_DASHES, Basis, Cap, Join, Kind, Rule
from warpsplat.scene.geometry import beziers
from warpsplat.scene.scene import FloatArray, Scene, starts_of


def as_chains(scene: Scene) -> Scene:
    """Return the shapes as single contours of cubics, an even number in closed ones, and without twins.

    Raises:
        ValueError: A shape has no such form; the message says why.
    """
    _check(scene)
    rings = [_chain(scene, shape, scene.points_of(shape)) for shape in range(len(scene))]
    first = starts_of(np.array([len(points) for points in rings], np.int32))
    return replace(
        scene,
        basis=np.full(len(scene), Basis.CUBIC, np.int32),
        first=first,
        starts=first,
        closed=(scene.kind == Kind.FILL).astype(np.int32),
        points=np.concatenate([*rings, np.empty((0, 2), np.float32)]).astype(np.float32),
        twin=np.zeros(len(scene), np.int32),
    )


def _check(scene: Scene) -> None:
    stroke = scene.kind == Kind.STROKE
    several = np.bincount(scene.contour_shapes(), minlength=len(scene)) > 1
    ends = stroke[scene.contour_shapes()] & (scene.closed == 1)
    for what, is_so in (
        ("has shapes of several contours", several),
        ("has fills by the even-odd rule", ~stroke & (scene.rule == Rule.EVENODD)),
        ("has closed strokes", ends),
        ("has dashes", stroke & (scene.dash != NO_DASHES)),
        ("has strokes whose caps are not round", stroke & (scene.cap != Cap.ROUND)),
        ("has strokes whose joins are not round", stroke & (scene.join != Join.ROUND)),
    ):
        if is_so.any():
            raise ValueError(what)


def chain_weights(scene: Scene) -> list[FloatArray]:
    """Return, by shape, the weights of its points in those of ``as_chains``, shape (new, old); empty if the
    scene has that form, but for twins.

    Raises:
        ValueError: As ``as_chains``; or the new points are not sums of the old ones.
    """
    drawn = scene.drawn()
    if not _faults(drawn):
        return []
    _check(scene)
    if scene.forms():
        raise ValueError(f"has {scene.forms()[0].name.lower()}s beside other shapes")
    counts = scene.point_counts().tolist()
    return [_chain(scene, shape, np.eye(n, dtype=np.float32)) for shape, n in enumerate(counts)]


def _chain(scene: Scene, shape: int, points: FloatArray) -> FloatArray:
    """Return the control points of one shape as cubics, shape (point, dimension), made of its ``points``."""
    ((_, closed),) = scene.contours_of(shape)
    cubics = beziers(points[None], closed, Basis(int(scene.basis[shape])))[0]
    if scene.kind[shape] == Kind.STROKE:
        return np.concatenate([cubics[:, :3].reshape(-1, points.shape[1]), cubics[-1:, 3]])
    if not closed:
        start, end = cubics[-1, 3], cubics[0, 0]
        share = np.arange(4, dtype=np.float32)[:, None] / 3
        cubics = np.concatenate([cubics, (start + share * (end - start))[None]])
    if len(cubics) % 2:
        cubics = np.concatenate([_halves(cubics[0]), cubics[1:]])
    return cubics[:, :3].reshape(-1, points.shape[1])


def _halves(cubic: FloatArray) -> FloatArray:
    """Return both halves of a cubic, shape (2, 4, dimension)."""
    rows: list[FloatArray] = [cubic]
    while len(rows[-1]) > 1:
        rows.append(np.float32(0.5) * (rows[-1][:-1] + rows[-1][1:]))
    return np.stack([[row[0] for row in rows], [row[-1] for row in reversed(rows)]]).astype(np.float32)


def check_chains(scene: Scene) -> None:
    """Check that all shapes are one contour of cubics, and that each fill can be halved into two chains.

    Raises:
        ValueError: one is a spline, or has several contours or an odd number of cubics.
    """
    for wrong, what in _faults(scene):
        raise ValueError(f"shape {int(np.flatnonzero(wrong)[0])} {what}")


def _faults(scene: Scene) -> list[tuple[npt.NDArray[np.bool_], str]]:
    """Return which shapes have another form, and why."""
    found = (
        (
            np.bincount(scene.contour_shapes(), minlength=len(scene)) > 1,
            "has several contours, splats have one",
        ),
        (scene.basis != Basis.CUBIC, "is a spline, not cubics"),
        ((scene.kind == Kind.FILL) & (scene.point_counts() % 6 != 0), "has an odd number of cubics"),
    )
    return [(wrong, what) for wrong, what in found if wrong.any()]
