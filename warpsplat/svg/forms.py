"""Elements of forms: written from their values, and read."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warpsplat.forms import form_of
from warpsplat.scene import Basis, IndexArray, Scene
from warpsplat.svg.paths import Points


def held_values(scene: Scene, exact: Points) -> Iterator[tuple[IndexArray, Points]]:
    """Yield the rows of forms' values, shape (shape, value), and the values that their elements have.

    ``exact``: the scene's points in units of the file, shape (point, 2).
    """
    for group in scene.alike():
        if group.basis.is_form:
            form = form_of(group.basis.name)
            rows = scene.starts[group.contours][:, None] + np.arange(group.points.shape[1])
            yield rows, form.values(form.numbers(exact[rows]))


def form_elements(scene: Scene, per_pixel: float) -> dict[int, str]:
    """Return the elements, without style, of the shapes that are forms."""
    found: dict[int, str] = {}
    for group in scene.alike():
        if group.basis.is_form:
            form = form_of(group.basis.name)
            numbers = form.numbers(group.points.astype(np.float64) * per_pixel).tolist()
            elements = [form.element(own, group.closed) for own in numbers]
            found.update(zip(group.shapes.tolist(), elements, strict=True))
    return found


def gradient_frames(scene: Scene, per_pixel: float) -> Points:
    """Return the frames of gradients in the coordinates of the shapes' elements, shape (shape, 3, 2)."""
    frames = (scene.frames.astype(np.float64) * per_pixel).reshape(-1, 3, 2)
    for group in scene.alike():
        if group.basis.is_form and form_of(group.basis.name).TURNED:
            from warpsplat.forms.frame import turned_back  # imports Warp

            degrees = form_of(group.basis.name).numbers(group.points.astype(np.float64) * per_pixel)[:, -1]
            for row in range(3):
                frames[group.shapes, row] = turned_back(frames[group.shapes, row], degrees)
    return frames


def read_form(tag: str, points: Points, closed: bool) -> tuple[Basis, Points] | None:
    """Return the form of an element, and its values; None if it has none, or is stretched or rounded.

    ``points``: control points of its outline, of a ring without the repeated end.
    """
    # Largest distance of a form's control points from those of the element that it is read from [px].
    near = 0.01
    for basis in Basis:
        if not basis.is_form or tag not in form_of(basis.name).TAGS:
            continue
        values = form_of(basis.name).read(points, closed)
        outline = form_of(basis.name).outline(values[None], closed)[0]
        is_same = outline.shape == points.shape and np.allclose(outline, points, 0, near)
        return (basis, values) if is_same else None
    return None
