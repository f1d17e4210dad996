"""Colour profiles (ICC): conversion of pixels to sRGB.

Little CMS, which comes with Pillow, converts 8 bits a channel. The rendering intent is relative colorimetric
with black point compensation, as in programs that show photographs.
"""

from __future__ import annotations

import io
import logging
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image

from warpsplat.errors import cause_of

if TYPE_CHECKING:
    from PIL.ImageCms import ImageCmsTransform

log = logging.getLogger(__name__)

SPACES = {"RGB": "RGB", "GRAY": "L", "CMYK": "CMYK"}
"""Colour spaces of profiles, and Pillow's modes for them."""


class Profile:
    """A conversion of an image's colours to sRGB; made by ``profile_of``."""

    def __init__(self, mode: str, transform: ImageCmsTransform) -> None:
        """``transform`` makes RGB of an image of ``mode``: RGB, L or CMYK."""
        self._mode, self._transform = mode, transform

    def rgb(self, image: Image.Image) -> Image.Image:
        """Return an image, or a part of it, as RGB, without opacity."""
        from PIL import ImageCms

        image = image if image.mode == self._mode else image.convert(self._mode)
        return ImageCms.applyTransform(image, self._transform) or image

    def rgba(self, image: Image.Image) -> Image.Image:
        """Return an image, or a part of it, as RGBA."""
        straight = image.convert("RGBA")
        converted = self.rgb(straight.convert("RGB"))
        converted.putalpha(straight.getchannel("A"))
        return converted

    def grey(self) -> npt.NDArray[np.float32]:
        """Return sRGB in [0, 1] of 256 levels of grey, shape (256,)."""
        ramp = Image.fromarray(np.arange(256, dtype=np.uint8)[None])
        return np.asarray(self.rgb(ramp), np.float32)[0].mean(axis=1) / np.float32(255)

    def is_srgb(self) -> bool:
        """Return whether the conversion changes nothing."""
        if self._mode == "CMYK":
            return False
        levels = np.linspace(0, 255, 9).round().astype(np.uint8)
        colors = np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(1, -1, 3)
        given = np.arange(256, dtype=np.uint8)[None] if self._mode == "L" else colors
        found = np.asarray(self.rgb(Image.fromarray(given)))
        # Largest difference from sRGB, in levels of 255, of a profile for sRGB itself; several exist.
        same = 1
        return bool((np.abs(found.astype(int) - np.atleast_3d(given)) <= same).all())


def profile_of(image: Image.Image, name: str | None) -> Profile | None:
    """Return the profile of ``image``; None: it has none, or one that changes nothing.

    A profile that cannot be used is ignored, with a warning that begins with ``name`` if there is one.
    """
    data = image.info.get("icc_profile")
    if not data:
        return None
    try:
        return _profile(data, image)
    except Exception as error:  # Little CMS and Pillow raise several kinds on broken profiles
        if name is not None:
            log.warning("%s: its colour profile is ignored: %s", name, cause_of(error))
        return None


def _profile(data: bytes, image: Image.Image) -> Profile | None:
    """Return the profile as ``profile_of``, or raise an exception if it cannot be used."""
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
    profile = Profile(mode, transform)
    return None if profile.is_srgb() else profile


def color_mode(image: Image.Image) -> str:
    """Return the mode of the colours alone, regardless of opacity, palette and depth."""
    if image.mode in {"1", "L", "LA", "La", "F"} or image.mode.startswith("I"):
        return "L"
    return image.mode if image.mode == "CMYK" else "RGB"
