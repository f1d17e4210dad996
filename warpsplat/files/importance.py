"""Reading masks: how much the error of each pixel of an image counts."""

from __future__ import annotations

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.files.sources import ImageSource, image_of, source_name
from warpsplat.portable.filters import grey
from warpsplat.scene import FloatArray


def load_importance(
    source: ImageSource, width: int, height: int, name: str | None = None, factor: int = 1
) -> FloatArray:
    """Read the mask of an image of ``width`` x ``height`` px: its grey values in [0, 1], at its own size, or
    ``factor`` times smaller.

    Any image will do, of any size of the same proportions: of colours the luma counts (ITU-R BT.601), and
    where it is transparent nothing was painted, which is black.

    Raises:
        ImageError: as ``image_of``, or other proportions than the image has.
    """
    name = name or source_name(source, "the mask")
    mask = image_of(source, name, paper=0.0, factor=factor)
    tall, wide = factor * mask.shape[0], factor * mask.shape[1]
    # A reduced side may be rounded to either neighbour; here, it is rounded up.
    if min(abs(wide - tall * width / height), abs(tall - wide * height / width)) >= factor:
        raise ImageError(
            f"{name}: {wide}x{tall} pixels; a mask must have the proportions of its {width}x{height} image"
        )
    return np.asarray(grey(mask), np.float32)
