"""Signed distances against float64: outlines of many points, and central differences."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
import pytest
import torch

from tests.pydiffvg.helpers import SIZE, tensor
from warpsplat import pydiffvg
from warpsplat.pydiffvg.shape import Shape, ShapeGroup

Tensor = torch.Tensor
Points = np.ndarray

FINE = 1000
"""Points of each curve of the reference."""
POSITIONS = tensor(np.random.default_rng(3).uniform(-8, SIZE + 8, (400, 2)))
MATRIX = tensor([[0.8, -0.5, 14.0], [0.5, 0.9, -8.0], [0, 0, 1]])
MIXED = tensor([[9, 9], [40, 10], [46, 30], [34, 40], [20, 46], [6, 30]])
LOOP = tensor([[10, 10], [60, 44], [-16, 40], [38, 8]])
CUBICS = tensor([[8, 20], [10, -4], [36, 6], [40, 22], [42, 40], [12, 44]])


def signed(
    shapes: Sequence[Shape], groups: Sequence[ShapeGroup], positions: Tensor | None = POSITIONS
) -> Tensor:
    scene = pydiffvg.RenderFunction.serialize_scene(
        SIZE, SIZE, shapes, groups, output_type=pydiffvg.OutputType.sdf, eval_positions=positions
    )
    return pydiffvg.RenderFunction.apply(SIZE, SIZE, 1, 1, 0, None, *scene)


def beziers(points: Points, counts: Sequence[int], *, is_closed: bool) -> Points:
    """Return the many points of a path, shape (point, 2)."""
    t = np.linspace(0, 1, FINE)[:, None]
    closed, at, found = np.concatenate([points, points[:1]]) if is_closed else points, 0, []
    for count in counts:
        p = list(closed[at : at + count + 2])
        while len(p) > 1:  # de Casteljau
            p = [(1 - t) * a + t * b for a, b in itertools.pairwise(p)]
        found.append(p[0])
        at += count + 1
    return np.concatenate(found)


def ellipse(center: tuple[float, float], radii: tuple[float, float]) -> Points:
    t = np.linspace(0, 2 * np.pi, 4 * FINE)
    return np.array(center) + np.array(radii) * np.stack([np.cos(t), np.sin(t)], axis=1)


def expected(outline: Points, positions: Points, *, even_odd: bool | None) -> Points:
    """Return signed distances from a polyline of many points; ``even_odd``: None where it is not filled."""
    found = []
    starts, ends = outline, np.roll(outline, -1, axis=0)
    edges = np.diff(outline, axis=0)
    for p in positions:
        down = (starts[:, 1] <= p[1]) & (ends[:, 1] > p[1])
        up = (starts[:, 1] > p[1]) & (ends[:, 1] <= p[1])
        crossed = np.where(down, 1, 0) - np.where(up, 1, 0)
        rise = np.where(crossed == 0, 1, ends[:, 1] - starts[:, 1])
        x = starts[:, 0] + (p[1] - starts[:, 1]) / rise * (ends[:, 0] - starts[:, 0])
        winding = int(crossed[x < p[0]].sum())
        inside = even_odd is not None and (winding % 2 if even_odd else winding) != 0
        along = ((p - starts[:-1]) * edges).sum(axis=1) / np.maximum((edges**2).sum(axis=1), 1e-30)
        nearest = starts[:-1] + np.clip(along, 0, 1)[:, None] * edges
        found.append((-1 if inside else 1) * np.hypot(*(nearest - p).T).min())
    return np.array(found)


CASES: dict[str, tuple[Callable[[], Shape], Callable[[], Points]]] = {
    "circle": (lambda: pydiffvg.Circle(tensor(9.0), tensor(20, 25)), lambda: ellipse((20, 25), (9, 9))),
    "ellipse": (
        lambda: pydiffvg.Ellipse(tensor(16.0, 5), tensor(24, 22)),
        lambda: ellipse((24, 22), (16, 5)),
    ),
    "rectangle": (
        lambda: pydiffvg.Rect(tensor(8, 12), tensor(36, 30)),
        lambda: beziers(np.array([[8, 12], [36, 12], [36, 30], [8, 30.0]]), (0, 0, 0, 0), is_closed=True),
    ),
    "cubics": (
        lambda: pydiffvg.Path(torch.tensor([2, 2]), CUBICS, True),
        lambda: beziers(CUBICS.numpy(), (2, 2), is_closed=True),
    ),
    "mixed path": (
        lambda: pydiffvg.Path(torch.tensor([0, 1, 2]), MIXED, True),
        lambda: beziers(MIXED.numpy(), (0, 1, 2), is_closed=True),
    ),
    "open loop": (
        lambda: pydiffvg.Path(torch.tensor([2]), LOOP, False),
        lambda: beziers(LOOP.numpy(), (2,), is_closed=False),
    ),
}


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("filled", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_distances_match_dense_polylines(name: str, filled: bool, moved: bool) -> None:
    shape, outline = CASES[name]
    matrix = MATRIX if moved else torch.eye(3)
    color = tensor(1, 0, 0, 1)
    group = pydiffvg.ShapeGroup(torch.tensor([0]), color if filled else None, False, color, matrix)
    points = outline().astype(np.float64) @ matrix[:2, :2].T.numpy() + matrix[:2, 2].numpy()
    wanted = expected(points, POSITIONS.numpy(), even_odd=False if filled else None)
    np.testing.assert_allclose(signed([shape()], [group])[:, 0].numpy(), wanted, atol=2e-4)


VARIED: dict[str, tuple[Tensor, Callable[[Tensor], Shape]]] = {
    "circle": (tensor(9, 20, 25), lambda v: pydiffvg.Circle(v[0], v[1:])),
    "ellipse": (tensor(16, 5, 24, 22), lambda v: pydiffvg.Ellipse(v[:2], v[2:])),
    "rectangle": (tensor(8, 12, 36, 30), lambda v: pydiffvg.Rect(v[:2], v[2:])),
    "cubics": (CUBICS, lambda v: pydiffvg.Path(torch.tensor([2, 2]), v, True)),
    "mixed path": (MIXED, lambda v: pydiffvg.Path(torch.tensor([0, 1, 2]), v, True)),
}


@pytest.mark.parametrize("name", VARIED)
def test_gradients_match_finite_differences(name: str) -> None:
    """Of shapes, transforms and positions, along a direction."""
    values, shape = VARIED[name]
    generator = torch.Generator().manual_seed(1)
    inputs = [values, MATRIX, POSITIONS]
    weights = torch.rand(len(POSITIONS), generator=generator)

    def loss(given: Sequence[Tensor]) -> Tensor:
        v, matrix, positions = given
        group = pydiffvg.ShapeGroup(torch.tensor([0]), tensor(1, 0, 0, 1), shape_to_canvas=matrix)
        return (weights * signed([shape(v)], [group], positions)[:, 0]).double().sum()

    leaves = [each.clone().requires_grad_() for each in inputs]
    gradients = torch.autograd.grad(loss(leaves), leaves)
    for i, gradient in enumerate(gradients):
        direction = torch.randn(inputs[i].shape, generator=generator)
        if inputs[i] is MATRIX:
            direction *= tensor([[0.02, 0.02, 1], [0.02, 0.02, 1], [0, 0, 0]])
        step = 0.005 * direction
        with torch.no_grad():
            ahead, behind = (loss([*inputs[:i], inputs[i] + s * step, *inputs[i + 1 :]]) for s in (1, -1))
        found = float((gradient * direction).sum())
        assert found == pytest.approx(
            float(ahead - behind) / 0.01, rel=0.01, abs=0.01 * float(gradient.norm())
        )


def test_pixels_are_distances_of_their_centres_from_the_nearest_group() -> None:
    shapes: list[Shape] = [
        pydiffvg.Circle(tensor(6.0), tensor(12, 12)),
        pydiffvg.Rect(tensor(24, 20), tensor(40, 44)),
    ]
    color = tensor(1, 0, 0, 1)
    groups = [pydiffvg.ShapeGroup(torch.tensor([i]), color) for i in range(2)]
    image = signed(shapes, groups, None)
    assert image.shape == (SIZE, SIZE, 1)
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    circle = np.hypot(x - 12, y - 12) - 6
    dx, dy = np.maximum(24 - x, x - 40), np.maximum(20 - y, y - 44)
    rect = np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)) + np.minimum(np.maximum(dx, dy), 0)
    wanted = np.where(abs(circle) < abs(rect), circle, rect)
    np.testing.assert_allclose(image[..., 0].numpy(), wanted, atol=1e-5)


def test_an_empty_scene_has_no_distances() -> None:
    assert not signed([], []).any()
