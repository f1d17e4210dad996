"""What callers hand over as an image or an SVG: a path, bytes, an open file, or pixels."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageOps

from warpsplat.errors import ImageError
from warpsplat.files.image import MAX_PIXELS, MIN_SIDE, boxed, composited, load_image, reduced
from warpsplat.files.inputs import MAX_INPUT, input_name, read_input
from warpsplat.scene import FloatArray


@runtime_checkable
class Readable(Protocol):
    """An open file."""

    def read(self, size: int = -1, /) -> Any:
        """Bytes, or text."""


ImageSource = str | os.PathLike[str] | bytes | Readable | Image.Image | npt.NDArray[Any]
"""A file's path, an image file's bytes, a file open for reading, a Pillow image, or pixels: uint8, uint16,
bool, or floats in [0, 1], shape (height, width) or (height, width, channels): grey, grey and opacity, RGB, or
RGB and opacity, which is straight."""


def source_bytes(source: str | os.PathLike[str] | bytes | Readable, what: str = "an image") -> bytes:
    """What a path, bytes or an open file hold.

    Raises:
        ImageError: it cannot be read, is empty or larger than ``MAX_INPUT``.
    """
    if isinstance(source, (bytes, bytearray, memoryview)):
        return bytes(source)
    if isinstance(source, (str, os.PathLike)):
        return read_input(Path(source), what)
    name = source_name(source)
    try:
        data = source.read(MAX_INPUT + 1)
    except OSError as error:
        raise ImageError(f"{name}: cannot be read: {error.strerror or error}") from error
    if isinstance(data, str):
        data = data.encode()
    if not isinstance(data, bytes):
        raise ImageError(f"{name}: gives {type(data).__name__}, not bytes")
    if len(data) > MAX_INPUT:
        raise ImageError(f"{name}: is larger than {MAX_INPUT >> 20} MiB")
    if not data:
        raise ImageError(f"{name}: nothing came")
    return data


def held(source: ImageSource) -> ImageSource:
    """``source`` as it can be read twice: the bytes of a file; pixels, and what is no image, as they are.

    Raises:
        ImageError: as ``source_bytes``.
    """
    return source_bytes(source) if isinstance(source, (str, os.PathLike, bytes, Readable)) else source


def source_name(source: object, default: str = "the image") -> str:
    """How messages call a source."""
    if isinstance(source, (str, os.PathLike)):
        return input_name(Path(source))
    name = getattr(source, "filename", None) or getattr(source, "name", None)
    return name if isinstance(name, str) else default


def image_of(
    source: ImageSource,
    name: str | None = None,
    *,
    paper: float | FloatArray | None = None,
    factor: int = 1,
) -> FloatArray:
    """The pixels of ``source``, see ``load_image``; the same image gives the same ones in whatever form, but
    for JPEGs that are read smaller.

    Raises:
        ImageError: as ``load_image``, or pixels of another shape or type.
        TypeError: something else than an ``ImageSource``.
    """
    name = name or source_name(source)
    if isinstance(source, np.ndarray):
        try:
            pixels = _of_array(source, paper)
            return pixels if factor == 1 else boxed(pixels, factor)
        except ImageError as error:
            raise ImageError(f"{name}: {error}") from None
    if isinstance(source, Image.Image):
        return _of_pillow(source, name, paper, factor)
    if isinstance(source, (str, os.PathLike, bytes, bytearray, memoryview, Readable)):
        return load_image(source_bytes(source), name, paper=paper, factor=factor)
    raise TypeError(
        f"an image is a path, bytes, a file, a Pillow image or an array, not {type(source).__name__}"
    )


def _of_pillow(image: Image.Image, name: str, paper: float | FloatArray | None, factor: int) -> FloatArray:
    """As ``load_image``: upright; a file that Pillow has not read yet may be damaged."""
    _check_size(image.width, image.height)
    try:
        return reduced(ImageOps.exif_transpose(image), paper, factor, name)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from None
    except (OSError, ValueError, SyntaxError) as error:
        raise ImageError(f"{name}: damaged or unsupported image: {error}") from error


def _of_array(pixels: npt.NDArray[Any], paper: float | FloatArray | None) -> FloatArray:
    values = pixels[..., None] if pixels.ndim == 2 else pixels
    if values.ndim != 3 or values.shape[2] not in {1, 2, 3, 4}:
        raise ImageError(f"pixels of shape {pixels.shape}, not (height, width[, channels])")
    height, width, channels = values.shape
    _check_size(width, height)
    if values.dtype in (np.uint8, np.uint16, np.bool_):
        white = {np.dtype(np.uint8): 255, np.dtype(np.uint16): 65535}.get(values.dtype, 1)
        levels = values.astype(np.float32) / np.float32(white)
    elif values.dtype.kind == "f":
        levels = values.astype(np.float32)
        wrong = int((~(levels >= 0) | ~(levels <= 1)).sum())  # NaN is neither
        if wrong:
            raise ImageError(f"{wrong} of {levels.size} values are not in [0, 1]")
    else:
        raise ImageError(f"pixels of type {values.dtype}: uint8, uint16, bool or floats are needed")
    colors = 1 if channels < 3 else 3
    opacity = levels[..., colors:] if channels in {2, 4} else None
    color = np.ascontiguousarray(np.broadcast_to(levels[..., :colors], (height, width, 3)))
    if opacity is None:
        return color
    return composited([(slice(None), color, opacity)], (width, height), paper)


def _check_size(width: int, height: int) -> None:
    if min(width, height) < MIN_SIDE:
        raise ImageError(f"{width}x{height} pixels; at least {MIN_SIDE}x{MIN_SIDE} are needed")
    if width * height > MAX_PIXELS:
        raise ImageError(f"more than {MAX_PIXELS / 1e6:g} million pixels")
