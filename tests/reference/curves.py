"""A scene's arrays as tensors; Bézier chains."""

from __future__ import annotations

import itertools

import torch

from warpsplat.scene import ATTRIBUTES, Scene

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
