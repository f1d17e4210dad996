"""An image of which only strips are held as floats: what a large one is measured by."""

from __future__ import annotations

import numpy as np
from PIL import Image

from warpsplat.files.image import read_image, to_srgb
from warpsplat.files.profile import profile_of
from warpsplat.scene import FloatArray


class Whole:
    """The pixels of an image as ``load_image`` gives them, made of strips of it when they are asked for."""

    def __init__(self, image: Image.Image, paper: float | FloatArray | None, channels: int) -> None:
        """``image`` is upright; ``paper`` and ``channels``: as the image that was fitted has them."""
        self._image, self._paper = image, paper
        self._profile = profile_of(image, None)
        self.shape = (image.height, image.width, channels)
        self._rows, self._held = slice(0, 0), np.zeros((0, image.width, channels), np.float32)

    def __getitem__(self, rows: slice) -> FloatArray:
        """Rows from ``start`` to ``stop``. Those that were asked for last are held."""
        if rows != self._rows:
            strip = self._image.crop((0, rows.start, self.shape[1], rows.stop))
            part = to_srgb(strip, self._paper, self._profile)
            if part.shape[2] < self.shape[2]:  # nothing of this strip is transparent
                part = np.concatenate([part, np.ones_like(part[..., :1])], axis=2)
            self._rows, self._held = rows, part
        return self._held


def load_whole(source: bytes, paper: float | FloatArray | None, channels: int) -> Whole:
    """As ``load_image``, but strip by strip. Not of deep grey images, whose white all of them tells."""
    return read_image(source, None, lambda image, _: Whole(image, paper, channels))
