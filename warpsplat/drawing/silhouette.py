"""Silhouettes: the outlines of objects photographed on plain ground, in black."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.constraints import of_contours
from warpsplat.drawing.draw import draw_regions
from warpsplat.drawing.trace.grids import Bools, Floats
from warpsplat.drawing.without_background import opacity_on_ground
from warpsplat.errors import ImageError
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.scene import FloatArray, Scene


def silhouettes(image: FloatArray, name: str) -> FloatArray:
    """Return the objects of an image in black on nothing, premultiplied, shape (height, width, 4).

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); with opacity, shape (height, width, 4), it is cut out
            already.
        name: Of the image, for messages.

    Raises:
        ImageError: there is nothing on the ground.
    """
    opaque = image.shape[2] == 3
    opacity = opacity_on_ground(image, everywhere=True) if opaque else image[..., 3]
    if not opacity.any():
        raise ImageError(f"{name}: nothing but plain ground, so there is no silhouette")
    return np.concatenate([np.zeros_like(image[..., :3]), opacity[..., None]], axis=2)


def draw_silhouettes(problem: Problem, run: Run) -> Fit:
    """Trace silhouettes, as a path for each object with its holes."""
    # Edges are found to half a pixel, so that less detail is worth a node, and their form tells no optics.
    detail = problem.settings.detail / 2
    made = draw_regions(problem.having(optics="none", detail=detail), run)
    return replace(made, scene=by_object(made.scene))


def by_object(scene: Scene) -> Scene:
    """Return a scene in which each outline that is no hole has a shape with its holes.

    Shapes of one colour are taken apart; the largest come first.
    """
    if not len(scene):
        return scene
    corners = [scene.points[low:high] for low, high in zip(scene.starts, scene.starts[1:], strict=False)]
    areas = np.array([_area(each) for each in corners])
    is_outer = areas * areas[np.abs(areas).argmax()] > 0
    outers = np.flatnonzero(is_outer)
    outers = outers[np.argsort(-np.abs(areas[outers]), kind="stable")]
    owners = {int(outer): [int(outer)] for outer in outers}
    for hole in np.flatnonzero(~is_outer).tolist():
        around = [outer for outer in outers[::-1].tolist() if _is_inside(corners[hole][0], corners[outer])]
        if around:
            owners[around[0]].append(hole)
    shapes = [of_contours(scene, np.array(owners[int(outer)])) for outer in outers]
    made = shapes[0]
    for shape in shapes[1:]:
        made = made.append(shape)
    return made


def _area(points: Floats) -> float:
    """Return the signed area of a polygon, shape (point, 2)."""
    x, y = points.T.astype(np.float64)
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def _is_inside(point: Floats, polygon: Floats) -> bool:
    """Return whether a point lies inside a polygon, shape (point, 2)."""
    x, y = polygon.T.astype(np.float64)
    before: Bools = (y > point[1]) != (np.roll(y, -1) > point[1])
    rise = np.where(before, np.roll(y, -1) - y, 1)
    crossing = x + (point[1] - y) / rise * (np.roll(x, -1) - x)
    return bool((before & (crossing > point[0])).sum() % 2)
