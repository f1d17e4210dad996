"""What DiffVG shows on a background that one sees through: means over the pixels of straight colours.

On nothing, ``kernels.composite`` makes that. Here the part of a pixel that shapes lie on is taken
from a picture of the same outlines, so faint that their coverages add up.
"""

from __future__ import annotations

import torch

from warpsplat.kernels.constants import NOTHING
from warpsplat.pydiffvg.assemble import FAINT

Tensor = torch.Tensor


def over(image: Tensor, faint: Tensor, background: Tensor) -> Tensor:
    """Pictures of the shapes, premultiplied, and of the faint outlines on a straight background; each has
    shape (height, width, 4).
    """
    hit = (faint[..., 3:] / FAINT).clamp_max(1.0)
    below, opacity = background[..., :3], background[..., 3:]
    # Of the part that shapes lie on, as if it were all; the background is seen through them there.
    seen = hit - image[..., 3:]
    total = image[..., 3:] + seen * opacity
    color = (image[..., :3] + seen * opacity * below) * (hit / total.clamp_min(NOTHING))
    return torch.cat([color + (1 - hit) * below, total + (1 - hit) * opacity], dim=2)
