"""Images and SVGs that callers pass: a path, bytes, an open file, a Pillow image, or pixels."""

from __future__ import annotations

import os
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageOps

from warpsplat.errors import ImageError, cause_of
from warpsplat.files.image import check_size, composited, decoded, reduced, without_opacity
from warpsplat.files.inputs import MAX_INPUT, check_data, input_name, read_input
from warpsplat.files.remote import ReadablePath, path_of
from warpsplat.portable.filters import boxed, grey
from warpsplat.scene import FloatArray


@runtime_checkable
class Readable(Protocol):
    """An open file."""

    def read(self, size: int = -1, /) -> Any:
        """Return bytes or text."""


BytesLike = bytes | bytearray | memoryview

FilePath = str | os.PathLike[str] | ReadablePath
"""The path or URL of a file."""

FILE_PATHS = (str, os.PathLike, ReadablePath)
"""Its types, for ``isinstance``."""

ImageSource = FilePath | BytesLike | Readable | Image.Image | npt.NDArray[Any]
"""A file's path or URL, an image file's bytes, a file open for reading, a Pillow image, or pixels: uint8,
uint16, bool, or floats in [0, 1], shape (height, width) or (height, width, channels): grey, grey and opacity,
RGB, or RGB and straight opacity."""


def source_bytes(source: FilePath | BytesLike | Readable, what: str = "an image") -> bytes:
    """Return the content of a path, a URL, bytes or an open file.

    Raises:
        UsageError: A URL, and no package that reads it.
        ImageError: It cannot be read, is empty or larger than ``MAX_INPUT``.
    """
    if isinstance(source, BytesLike):
        return bytes(source)
    if isinstance(source, FILE_PATHS):
        return read_input(path_of(source), what)
    name = source_name(source)
    try:
        data = source.read(MAX_INPUT + 1)
    except OSError as error:
        raise ImageError(f"{name}: cannot be read: {cause_of(error)}") from error
    if isinstance(data, str):
        data = data.encode()
    if not isinstance(data, bytes):
        raise ImageError(f"{name}: gives {type(data).__name__}, not bytes")
    check_data(data, name, MAX_INPUT)
    return data


def held(source: ImageSource) -> ImageSource:
    """Return ``source`` in a form that can be read twice: the bytes of a file; anything else as it is.

    Raises:
        ImageError: As ``source_bytes``.
    """
    return source_bytes(source) if isinstance(source, (*FILE_PATHS, BytesLike, Readable)) else source


def source_name(source: object, default: str = "the image") -> str:
    """Return what messages call a source."""
    if isinstance(source, FILE_PATHS):
        return input_name(path_of(source))
    name = getattr(source, "filename", None) or getattr(source, "name", None)
    return name if isinstance(name, str) else default


def image_of(
    source: ImageSource,
    name: str | None = None,
    *,
    paper: float | FloatArray | None = None,
    factor: int = 1,
) -> FloatArray:
    """Read an image: first frame, EXIF rotation and colour profile applied, transparency on ``paper``.

    The pixels do not depend on the form of the source, except of JPEGs that are read smaller.

    Args:
        source: The image; ``-`` is the standard input.
        name: What messages call the image; None: its path.
        paper: Grey level or colour that transparency is composited on; None: transparency is kept.
        factor: How many times smaller to read it, see ``reduced``. JPEGs are then decoded with less memory
            and time.

    Returns:
        sRGB in [0, 1], shape (height, width, 3), float32; if transparency is kept and there is some,
        premultiplied with opacity, shape (height, width, 4). Grey images of 16 bits keep their precision.

    Raises:
        ImageError: Missing, unreadable, truncated, not an image, too large, too small, pixels of another
            shape or type, or not numbers. The message is one line that names the image and the cause.
        TypeError: Not an ``ImageSource``.
    """
    name = name or source_name(source)
    if isinstance(source, (*FILE_PATHS, BytesLike, Readable)):
        with decoded(source_bytes(source), name, factor) as (image, left):
            return reduced(image, paper, left, name)
    try:
        if isinstance(source, np.ndarray):
            pixels = _from_array(source, paper)
            return pixels if factor == 1 else boxed(pixels, factor)
        if isinstance(source, Image.Image):
            check_size(source.width, source.height)
            return reduced(ImageOps.exif_transpose(source), paper, factor, name)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from None
    except (OSError, ValueError, SyntaxError) as error:  # a file that Pillow has not read yet may be damaged
        raise ImageError(f"{name}: damaged or unsupported image: {error}") from error
    raise TypeError(
        f"an image is a path, bytes, a file, a Pillow image or an array, not {type(source).__name__}"
    )


def _from_array(pixels: npt.NDArray[Any], paper: float | FloatArray | None) -> FloatArray:
    values = pixels[..., None] if pixels.ndim == 2 else pixels
    if values.ndim != 3 or values.shape[2] not in {1, 2, 3, 4}:
        raise ImageError(f"pixels of shape {pixels.shape}, not (height, width[, channels])")
    height, width, channels = values.shape
    check_size(width, height)
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
    return color if opacity is None else without_opacity(composited(color, opacity, paper))


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
