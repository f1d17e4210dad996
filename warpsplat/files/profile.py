"""Colour profiles (ICC): pixels as the screen's usual colours, sRGB.

Little CMS, which comes with Pillow, converts 8 bits a channel. Relative to white, black as black: what
programs that show photographs do.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from PIL import Image

log = logging.getLogger(__name__)

SPACES = {"RGB": "RGB", "GRAY": "L", "CMYK": "CMYK"}
"""What a profile calls the colours that it describes, and the mode that Pillow has them in."""

SAME = 1
"""Levels of 255 up to which a profile is sRGB itself: there are several, that differ by rounding."""

GRID = 9
"""Levels of each channel that are tried for that."""

Levels = npt.NDArray[np.uint8]


class Profile:
    """Of an image: how its colours become sRGB."""

    def __init__(self, mode: str, convert: Callable[[Image.Image], Image.Image]) -> None:
        """Use ``profile_of``.

        Args:
            mode: that the profile describes, RGB, L or CMYK.
            convert: an image of that mode -> RGB.
        """
        self._mode, self._convert = mode, convert

    def rgb(self, image: Image.Image) -> Image.Image:
        """An image, or a part of it, as RGB; of opacity nothing is left."""
        return self._convert(image if image.mode == self._mode else image.convert(self._mode))

    def rgba(self, image: Image.Image) -> Image.Image:
        """With its opacity, as RGBA."""
        straight = image.convert("RGBA")
        made = self.rgb(straight.convert("RGB"))
        made.putalpha(straight.getchannel("A"))
        return made

    def grey(self) -> npt.NDArray[np.float32]:
        """sRGB in [0, 1] of 256 levels of grey, shape (256,)."""
        ramp = Image.fromarray(np.arange(256, dtype=np.uint8)[None])
        return np.asarray(self.rgb(ramp), np.float32)[0].mean(axis=1) / np.float32(255)


def profile_of(image: Image.Image, name: str | None = "the image") -> Profile | None:
    """The profile that ``image`` has, or None where it has none, or one that changes nothing.

    One that cannot be used, or not with such an image, is ignored; with a ``name``, with a warning that
    begins with it.
    """
    data = image.info.get("icc_profile")
    if not data:
        return None
    try:
        return _profile(data, image)
    except Exception as error:  # of broken ones Little CMS and Pillow raise several kinds
        cause = (str(error).strip().splitlines() or [type(error).__name__])[0]
        if name is not None:
            log.warning("%s: its colour profile is ignored: %s", name, cause)
        return None


def _profile(data: bytes, image: Image.Image) -> Profile | None:
    """As ``profile_of``.

    Raises:
        Exception: it cannot be used.
    """
    from PIL import ImageCms

    source = ImageCms.ImageCmsProfile(io.BytesIO(data))
    space = source.profile.xcolor_space.strip()
    mode = SPACES.get(space)
    if mode is None or mode != color_mode(image):
        raise ValueError(f"it is of {space} colours, the image of {image.mode}")
    transform = ImageCms.buildTransform(
        source,
        ImageCms.createProfile("sRGB"),
        mode,
        "RGB",
        ImageCms.Intent.RELATIVE_COLORIMETRIC,
        ImageCms.Flags.BLACKPOINTCOMPENSATION,
    )

    def convert(part: Image.Image) -> Image.Image:
        return ImageCms.applyTransform(part, transform) or part

    return None if _changes_nothing(mode, convert) else Profile(mode, convert)


def color_mode(image: Image.Image) -> str:
    """The mode of the colours alone, without opacity, palette and depth."""
    if image.mode in {"1", "L", "LA", "La", "F"} or image.mode.startswith("I"):
        return "L"
    return image.mode if image.mode == "CMYK" else "RGB"


def _changes_nothing(mode: str, convert: Callable[[Image.Image], Image.Image]) -> bool:
    if mode == "CMYK":
        return False
    levels = np.linspace(0, 255, GRID).round().astype(np.uint8)
    if mode == "L":
        grid: Levels = np.arange(256, dtype=np.uint8)[None]
        shown = np.repeat(grid[..., None], 3, axis=2)
    else:
        grid = shown = np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(1, -1, 3)
    found = np.asarray(convert(Image.fromarray(grid)))
    return bool((np.abs(found.astype(int) - shown) <= SAME).all())
