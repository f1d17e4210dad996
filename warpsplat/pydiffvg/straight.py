"""Images on a translucent background as DiffVG shows them: means of colours that are not premultiplied.

Without a background ``kernels.composite_straight`` makes such images. Here the share of a pixel that shapes
cover is taken from an image of the same outlines, so faint that their coverages add up.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch

from warpsplat.kernels import constants
from warpsplat.pydiffvg.layout import Layout
from warpsplat.torch import SceneTensors, render

Tensor = torch.Tensor

FAINT = 1 / 256
"""Opacity of the faint outlines. Two shapes that each cover half of a pixel then add up to all of it; at full
opacity compositing would leave a quarter uncovered."""


def on_translucent(image: Tensor, values: Mapping[str, Tensor], layout: Layout, background: Tensor) -> Tensor:
    """Composite an image on a translucent background.

    Args:
        image: of the shapes, premultiplied, shape (height, width, 4).
        values: attributes of ``layout.scene``.
        layout: of the scene.
        background: not premultiplied, shape (height, width, 4).

    Returns:
        the image, not premultiplied, shape (height, width, 4).
    """
    covered = _coverage(values, layout)
    below, opacity = background[..., :3], background[..., 3:]
    # Premultiplied opacity and colour of the covered part, behind which the background shows.
    seen = covered - image[..., 3:]
    total = image[..., 3:] + seen * opacity
    color = (image[..., :3] + seen * opacity * below) * (covered / total.clamp_min(constants.NOTHING))
    return torch.cat([color + (1 - covered) * below, total + (1 - covered) * opacity], dim=2)


def _coverage(values: Mapping[str, Tensor], layout: Layout) -> Tensor:
    """Return the covered share of each pixel, shape (height, width, 1); invisible shapes do not count."""
    own = {name: values[name] for name in ("points", "widths") if name in values}
    own["opacities"] = FAINT * (values["opacities"].detach() > constants.SEEN).float()
    own["colors"] = torch.zeros_like(values["colors"])
    image = render(SceneTensors(layout.outlines, own))
    return (image[..., 3:] / FAINT).clamp_max(1.0)
