"""Scenes that grids of Gaussians can show: shapes of one chain of cubics each, of fills an even number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.scene.attributes import NO_DASHES, Basis, Cap, Join, Kind, Rule
from warpsplat.scene.geometry import beziers
from warpsplat.scene.scene import FloatArray, Scene, starts_of


def as_chains(scene: Scene) -> Scene:
    """Return the shapes as single contours of cubics, closed ones of an even number, without twins.

    Raises:
        ValueError: a shape cannot be shown so; the message says why.
    """
    _check(scene)
    rings = [_chain(scene, shape) for shape in range(len(scene))]
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


def _chain(scene: Scene, shape: int) -> FloatArray:
    """Return the control points of one shape as cubics."""
    ((points, closed),) = scene.contours_of(shape)
    cubics = beziers(points[None], closed, Basis(int(scene.basis[shape])))[0]
    if scene.kind[shape] == Kind.STROKE:
        return np.concatenate([cubics[:, :3].reshape(-1, 2), cubics[-1:, 3]])
    if not closed:
        start, end = cubics[-1, 3], cubics[0, 0]
        share = np.arange(4, dtype=np.float32)[:, None] / 3
        cubics = np.concatenate([cubics, (start + share * (end - start))[None]])
    if len(cubics) % 2:
        cubics = np.concatenate([_halves(cubics[0]), cubics[1:]])
    return cubics[:, :3].reshape(-1, 2)


def _halves(cubic: FloatArray) -> FloatArray:
    """Return both halves of a cubic, shape (2, 4, 2)."""
    rows: list[FloatArray] = [cubic]
    while len(rows[-1]) > 1:
        rows.append(np.float32(0.5) * (rows[-1][:-1] + rows[-1][1:]))
    return np.stack([[row[0] for row in rows], [row[-1] for row in reversed(rows)]]).astype(np.float32)


def check_chains(scene: Scene) -> None:
    """Check that all shapes are one contour of cubics, and that each fill can be halved into two chains.

    Raises:
        ValueError: one is a spline, or has several contours or an odd number of cubics.
    """
    for wrong, what in (
        (
            np.bincount(scene.contour_shapes(), minlength=len(scene)) > 1,
            "has several contours, splats have one",
        ),
        (scene.basis != Basis.CUBIC, "is a spline, not cubics"),
        ((scene.kind == Kind.FILL) & (scene.point_counts() % 6 != 0), "has an odd number of cubics"),
    ):
        if wrong.any():
            raise ValueError(f"shape {int(np.flatnonzero(wrong)[0])} {what}")
