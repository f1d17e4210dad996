"""Reading images: whatever Pillow opens, as sRGB on white, upright."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps, UnidentifiedImageError

from warpsplat.errors import ImageError
from warpsplat.inputs import input_name, read_input
from warpsplat.scene import FloatArray

MIN_SIDE = 2
"""Smallest side of an image [px]: with one pixel there is nothing to fit a curve to."""


def load_image(source: Path | bytes, name: str | None = None) -> FloatArray:
    """Read an image: first frame, EXIF rotation applied, transparency composited on white.

    Args:
        source: a file, or its bytes.
        name: how messages call it; default: the file's.

    Returns:
        sRGB in [0, 1], shape (height, width, 3), float32. 16-bit images keep their precision.

    Raises:
        ImageError: missing, unreadable, truncated, not an image, too large or too small. The message is one
            line that names the file and the cause.
    """
    path = name or (input_name(source) if isinstance(source, Path) else "image")
    data = read_input(source) if isinstance(source, Path) else source
    try:
        with warnings.catch_warnings():
            # Pillow warns of what it can read all the same (odd metadata), and of bombs, which are refused.
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data)) as opened:
                opened.load()
                pixels = to_srgb(ImageOps.exif_transpose(opened))
    except ImageError:
        raise
    except UnidentifiedImageError:
        raise ImageError(f"{path}: not an image, or a format that Pillow cannot read") from None
    except (Image.DecompressionBombError, Image.DecompressionBombWarning):
        limit = (Image.MAX_IMAGE_PIXELS or 0) // 1_000_000
        raise ImageError(f"{path}: too large: more than {limit} million pixels") from None
    except Exception as error:  # Pillow's decoders raise nearly every kind of exception on broken data
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ImageError(f"{path}: damaged or unsupported image: {cause}") from error
    height, width = pixels.shape[:2]
    if min(width, height) < MIN_SIDE:
        raise ImageError(f"{path}: {width}x{height} pixels; at least {MIN_SIDE}x{MIN_SIDE} are needed")
    return pixels


def to_srgb(image: Image.Image) -> FloatArray:
    """A loaded Pillow image of any mode as sRGB in [0, 1] on white, shape (height, width, 3)."""
    if image.mode == "F" or image.mode.startswith("I"):
        grey = np.asarray(image).astype(np.float32)
        # One channel of 16 bits (or 32-bit containers of them); floats are taken as 0..1 if they are.
        top = 1.0 if image.mode == "F" and grey.max() <= 1 else 255.0 if grey.max() <= 255 else 65535.0
        if image.mode.startswith("I;16"):
            top = 65535.0
        return np.repeat(np.clip(grey / top, 0, 1)[..., None], 3, axis=2).astype(np.float32)
    transparent = "transparency" in image.info or "A" in image.getbands() or "a" in image.getbands()
    if not transparent:
        return np.asarray(image.convert("RGB"), np.float32) / np.float32(255)
    rgba = np.asarray(image.convert("RGBA"), np.float32) / np.float32(255)
    alpha = rgba[..., 3:]
    return np.ascontiguousarray(rgba[..., :3] * alpha + (1 - alpha), np.float32)
