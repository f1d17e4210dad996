"""Losses of images and shapes."""

from __future__ import annotations

import torch

from tests.reference.curves import chain, points_of
from warpsplat.scene import Basis, Kind, Scene


def cubics(scene: Scene, points: torch.Tensor) -> torch.Tensor:
    """All Béziers of the scene as cubics, shape by shape, [Bézier, 4, 2]; ``points``: the scene's."""
    found = []
    for shape in range(len(scene)):
        own = points_of(scene, {"points": points}, shape)
        outline = chain(own, scene.kind[shape] == Kind.FILL, Basis(int(scene.basis[shape])))
        found += [outline[i : i + 4] for i in range(0, len(outline) - 1, 3)]
    return torch.stack(found)


def sine(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Sine of the angle from ``a`` to ``b``."""
    return (a[0] * b[1] - a[1] * b[0]) / (a.norm() * b.norm())


def xing(scene: Scene, points: torch.Tensor) -> torch.Tensor:
    """Xing loss of LIVE: mean over all Béziers of the scene."""
    total = torch.zeros(())
    every = cubics(scene, points)
    for cubic in every:
        edges = torch.diff(cubic, dim=0)
        s12, s13 = sine(edges[0], edges[1]), sine(edges[0], edges[2])
        total = total + (torch.relu(-s13) if s12 >= 0 else torch.relu(s13))
    return total / len(every)


def bending(scene: Scene, points: torch.Tensor) -> torch.Tensor:
    """Bending of each Bézier, [Bézier]."""
    p0, p1, p2, p3 = cubics(scene, points).unbind(1)
    a, b = p0 - 2 * p1 + p2, p1 - 2 * p2 + p3
    chord = ((p3 - p0).square().sum(-1) + 1e-24).sqrt()
    return (a.square().sum(-1) + b.square().sum(-1)) / (1 + chord)


def ssim(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """SSIM of one window (Wang et al. 2004, eq. 13), x and y [pixel, channel] -> [channel]."""
    mx, my = x.mean(0), y.mean(0)
    vx, vy = ((x - mx) ** 2).mean(0), ((y - my) ** 2).mean(0)
    covariance = ((x - mx) * (y - my)).mean(0)
    c1, c2 = 0.01**2, 0.03**2
    return (2 * mx * my + c1) * (2 * covariance + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2))
