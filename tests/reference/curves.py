"""A scene's arrays as tensors; chains of Béziers and B-splines."""

from __future__ import annotations

import itertools

import torch

from warpsplat.scene import ATTRIBUTES, Basis, Scene

Tensors = dict[str, torch.Tensor]


def tensors(scene: Scene) -> Tensors:
    """The scene's attributes as leaves that require gradients."""
    return {
        a.name: torch.tensor(getattr(scene, a.name), dtype=torch.float64, requires_grad=True)
        for a in ATTRIBUTES
    }


def points_of(scene: Scene, p: Tensors, shape: int) -> torch.Tensor:
    """Control points of one shape, [point, 2] canvas units."""
    return p["points"][int(scene.first[shape]) : int(scene.first[shape + 1])]


def bezier(p: torch.Tensor, t: torch.Tensor) -> torch.Tensor:
    """Chain of cubics: p [3 n + 1, 2], t [m] in [0, n] -> [m, 2], by de Casteljau."""
    n = (len(p) - 1) // 3
    segment = torch.clamp(t.floor().long(), 0, n - 1)
    s = (t - segment)[:, None]
    q = [p[3 * segment + j] for j in range(4)]
    while len(q) > 1:
        q = [(1 - s) * a + s * b for a, b in itertools.pairwise(q)]
    return q[0]


def tangent(p: torch.Tensor, t: torch.Tensor) -> torch.Tensor:
    """Derivative of ``bezier`` by t, from differences of control points."""
    n = (len(p) - 1) // 3
    segment = torch.clamp(t.floor().long(), 0, n - 1)
    s = (t - segment)[:, None]
    d = [3 * (p[3 * segment + j + 1] - p[3 * segment + j]) for j in range(3)]
    return (1 - s) ** 2 * d[0] + 2 * s * (1 - s) * d[1] + s**2 * d[2]


def chain(points: torch.Tensor, ring: bool, basis: Basis) -> torch.Tensor:
    """A contour as a chain of cubics [3 n + 1, 2]; a ring's ends where it begins."""
    if basis == Basis.CUBIC:
        return torch.cat([points, points[:1]]) if ring else points
    knots, poles = spline(points, ring)
    # A quadratic, its degree elevated: the inner control points lie at two thirds of the way to its own.
    pieces = [
        torch.stack([a, a + (pole - a) * 2 / 3, b + (pole - b) * 2 / 3])
        for (a, b), pole in zip(itertools.pairwise(knots), poles, strict=True)
    ]
    return torch.cat([*pieces, knots[-1:]])


def spline(points: torch.Tensor, ring: bool) -> tuple[torch.Tensor, torch.Tensor]:
    """Where the quadratics of a B-spline begin and end [n + 1, 2], and their middle control points [n, 2].

    By inserting knots (Boehm 1980): each inner knot of a quadratic spline doubled gives the point half-way.
    """
    if ring:
        halves = (points + points.roll(1, dims=0)) / 2
        return torch.cat([halves, halves[:1]]), points
    halves = (points[1:-2] + points[2:-1]) / 2
    return torch.cat([points[:1], halves, points[-1:]]), points[1:-1]


def spline_at(points: torch.Tensor, ring: bool, t: torch.Tensor) -> torch.Tensor:
    """A quadratic B-spline at t [m] in [0, n], by de Boor's recursion on its knots; [m, 2]."""
    if ring:
        points = torch.cat([points[-1:], points, points[:1]])
    count = len(points) - 2
    knots = torch.arange(-2, count + 3, dtype=points.dtype)
    if not ring:
        knots = knots.clamp(0, count)
    span = torch.clamp(t.floor().long(), 0, count - 1) + 2
    d = [points[span - 2 + j] for j in range(3)]
    for level in (1, 2):
        for j in range(2, level - 1, -1):
            low, high = knots[span - 2 + j], knots[span - 1 + j + 2 - level]
            share = ((t - low) / (high - low))[:, None]
            d[j] = (1 - share) * d[j - 1] + share * d[j]
    return d[2]
