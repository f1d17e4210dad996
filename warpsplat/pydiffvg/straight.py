"""Premultiplied pictures -> what DiffVG shows: means over the pixels of colours that are not premultiplied.

Where nothing is, a colour is black; so it fades as the part of a pixel that shapes lie on does. That part is
taken from a picture of the same outlines, so faint that their coverages add up.
"""

from __future__ import annotations

from typing import Any

import torch

from warpsplat.pydiffvg.assemble import FAINT

Tensor = torch.Tensor

NOTHING = 1e-4
"""Opacity below which colours are no longer divided by it."""


class Straight(torch.autograd.Function):
    """Pictures of the shapes and of the faint outlines, shape (height, width, 4), -> the picture, on nothing.

    One function, as each operation that torch records walks through the picture twice again.
    """

    @staticmethod
    def forward(ctx: Any, image: Tensor, faint: Tensor) -> Tensor:
        """``color / opacity * part``."""
        hit = (faint[..., 3:] / FAINT).clamp_max_(1.0)
        divisor = image[..., 3:].clamp_min(NOTHING)
        ctx.save_for_backward(image, hit, divisor)
        result = image * (hit / divisor)
        result[..., 3] = image[..., 3]
        return result

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, Tensor]:
        """The product rule; no gradient of a part that is all, of an opacity that is nothing."""
        image, hit, divisor = ctx.saved_tensors
        along = torch.einsum("yxc,yxc->yx", grad[..., :3], image[..., :3])[..., None] / divisor
        image_grad = grad * (hit / divisor)
        seen = image[..., 3:] > NOTHING
        image_grad[..., 3:] = grad[..., 3:] - along * (hit / divisor) * seen
        faint_grad = torch.zeros_like(image)
        faint_grad[..., 3:] = along * (hit < 1) / FAINT
        return image_grad, faint_grad


def over(image: Tensor, faint: Tensor, background: Tensor) -> Tensor:
    """The same on a background that is not premultiplied, shape (height, width, 4)."""
    hit = (faint[..., 3:] / FAINT).clamp_max(1.0)
    below, opacity = background[..., :3], background[..., 3:]
    # Of the part that shapes lie on, as if it were all; the background is seen through them there.
    seen = hit - image[..., 3:]
    total = image[..., 3:] + seen * opacity
    color = (image[..., :3] + seen * opacity * below) * (hit / total.clamp_min(NOTHING))
    return torch.cat([color + (1 - hit) * below, total + (1 - hit) * opacity], dim=2)
