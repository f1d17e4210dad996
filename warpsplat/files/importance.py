"""Reading of masks: the weight of each pixel's error."""

from __future__ import annotations

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.files.sources import ImageSource, image_of, source_name
from warpsplat.portable.filters import grey
from warpsplat.scene import FloatArray


def load_importance(
    source: ImageSource, width: int, height: int, name: str | None = None, factor: int = 1
) -> FloatArray:
    """Read the mask of an image of ``width`` x ``height`` px: grey in [0, 1], shape (mask height, mask
    width).

    A mask may be any image of the same proportions. Colours count by their luma (ITU-R BT.601), transparent
    pixels as black. ``factor``: how many times smaller to read it.

    Raises:
        ImageError: As ``image_of``, or the mask has other proportions.
    """
    name = name or source_name(source, "the mask")
    mask = image_of(source, name, paper=0.0, factor=factor)
    tall, wide = factor * mask.shape[0], factor * mask.shape[1]
    # A side of a reduced mask may be off by up to a pixel.
    if min(abs(wide - tall * width / height), abs(tall - wide * height / width)) >= factor:
        raise ImageError(
            f"{name}: {wide}x{tall} pixels; a mask must have the proportions of its {width}x{height} image"
        )
    return np.asarray(grey(mask), np.float32)
