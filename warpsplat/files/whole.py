"""Images of which only strips are held as floats, to compare large ones with."""

from __future__ import annotations

import numpy as np
from PIL import Image

from warpsplat.files.image import read_image, to_srgb
from warpsplat.files.profile import profile_of
from warpsplat.scene import FloatArray


class Whole:
    """The pixels of an image as ``load_image`` returns them, converted strip by strip on demand."""

    def __init__(self, image: Image.Image, paper: float | FloatArray | None, channels: int) -> None:
        """``image`` is upright; ``paper`` and ``channels`` are those of the image that was fitted."""
        self._image, self._paper = image, paper
        self._profile = profile_of(image, None)
        self.shape = (image.height, image.width, channels)
        self._rows, self._held = slice(0, 0), np.zeros((0, image.width, channels), np.float32)

    def __getitem__(self, rows: slice) -> FloatArray:
        """Return rows; the last ones asked for are cached."""
        if rows != self._rows:
            strip = self._image.crop((0, rows.start, self.shape[1], rows.stop))
            part = to_srgb(strip, self._paper, self._profile)
            if part.shape[2] < self.shape[2]:  # this strip is opaque
                part = np.concatenate([part, np.ones_like(part[..., :1])], axis=2)
            self._rows, self._held = rows, part
        return self._held


def load_whole(source: bytes, paper: float | FloatArray | None, channels: int) -> Whole:
    """Read an image as ``load_image``, but strip by strip; not for deep grey ones (``is_deep``)."""
    return read_image(source, "the image", lambda image, _: Whole(image, paper, channels))
