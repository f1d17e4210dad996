"""Reading of raster images as upright sRGB.

A photograph of 50 megapixels takes 600 MB as floats: besides the result only strips are held.
"""

from __future__ import annotations

import contextlib
import io
import threading
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from PIL import ExifTags, Image, ImageOps, UnidentifiedImageError

from warpsplat.errors import ImageError, cause_of
from warpsplat.files.plugins import PLUGINS, plugin_formats
from warpsplat.files.profile import Profile, profile_of
from warpsplat.files.resolution import SWAPPED, Resolution, resolution_of
from warpsplat.native import STRIP_PIXELS, messages_hidden
from warpsplat.portable.filters import boxed
from warpsplat.portable.sequences import interp
from warpsplat.scene import FloatArray

FORMATS = (
    *("PNG", "JPEG", "GIF", "BMP", "PPM", "WEBP", "AVIF", "TIFF", "JPEG2000", "ICO", "QOI", "PCX", "SGI"),
    *("DDS", "PSD", "TGA"),  # TGA last: it has no signature, so that other files may look like it
)
"""Pillow's names of the formats that are read: those of nothing but pixels. Others that Pillow opens are
programs (EPS, which it passes to Ghostscript), drawings (WMF), containers of other formats (IPTC), or rare.
"""

MAX_PIXELS = 120_000_000
"""Largest image [pixels], that of the largest cameras."""

TOO_LARGE = f"more than {MAX_PIXELS / 1e6:g} million pixels"

WEBP_SIDE = 16_383
"""Longest side of a WebP [px]: its header has 14 bits for it."""

TGA_DESCRIPTOR, TGA_ATTRIBUTE_BITS = 17, 0x0F
"""Byte of a TGA's header, and those of its bits that count the bits of opacity of a pixel."""

LEVELS = {"1": 255, "L;2": 85, "L;4": 17}
"""Factors by which Pillow scales samples of PNGs with fewer than 8 bits; it does not scale their transparent
grey."""


@contextlib.contextmanager
def decoded(source: bytes, name: str, factor: int = 1) -> Iterator[tuple[Image.Image, int]]:
    """Decode an image, upright, and yield it with how many times smaller it must still become.

    That is ``factor``, less what decoding has done. Errors in the block become ``ImageError`` as well.

    Raises:
        ImageError: As ``files.sources.image_of``.
    """
    # Larger images with more pixels a byte are bombs, or blank: drawings in two colours have a tenth of that.
    bomb_pixels, pixels_a_byte = 16_000_000, 10_000
    try:
        with _opened(source) as image:
            width, height = image.size
            check_size(width, height)
            if width * height > max(bomb_pixels, pixels_a_byte * len(source)):
                raise ImageError(f"claims {width}x{height} pixels in {len(source)} bytes")
            _check_covered(image)
            rawmode = _rawmode(image)
            left = factor // _draft(image, factor)
            image.load()
            _fix_transparency(image, rawmode, source)
            ImageOps.exif_transpose(image, in_place=True)
            yield _without_unused_alpha(image, source), left
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from None
    except MemoryError:
        raise
    except UnidentifiedImageError:
        formats = ", ".join(sorted([*FORMATS, *(plugin.format for plugin in PLUGINS)]))
        raise ImageError(f"{name}: not an image of a format that is read: {formats}") from None
    except (Image.DecompressionBombError, Image.DecompressionBombWarning):
        raise ImageError(f"{name}: too large: {TOO_LARGE}") from None
    except Exception as error:  # Pillow's decoders raise nearly every kind of exception on broken data
        raise ImageError(f"{name}: damaged or unsupported image: {cause_of(error)}") from error


def check_size(width: int, height: int) -> None:
    """Raise ``ImageError`` for an image of too few or too many pixels."""
    min_side = 2  # smallest side of an image [px]: with one pixel there is nothing to fit a shape to
    if min(width, height) < min_side:
        raise ImageError(f"{width}x{height} pixels; at least {min_side}x{min_side} are needed")
    if width * height > MAX_PIXELS:
        raise ImageError(TOO_LARGE)


_decoding = threading.Lock()
"""Pillow's limit and Python's warnings are global: one thread at a time changes them."""


@contextlib.contextmanager
def _opened(data: bytes) -> Iterator[Image.Image]:
    """Open an image of ``FORMATS`` or a plugin's; raises ``UnidentifiedImageError`` for others.

    The only place that does. Pillow's limit is ``MAX_PIXELS`` in the block, and its warnings about odd
    metadata and those that libtiff prints about any file are hidden.
    """
    with _decoding, warnings.catch_warnings(), messages_hidden():
        warnings.simplefilter("ignore")
        formats = plugin_formats(data) or FORMATS
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        before, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, MAX_PIXELS
        try:
            with Image.open(io.BytesIO(data), formats=formats) as image:
                yield image
        finally:
            Image.MAX_IMAGE_PIXELS = before


def _check_covered(image: Image.Image) -> None:
    """Raise ``ImageError`` for a TIFF with missing strips, which Pillow would show as black."""
    if image.format != "TIFF":  # the frame of a GIF need not fill it
        return
    extents = {tile[1] for tile in getattr(image, "tile", [])}
    # Areas, because the sides of a rotated picture are already swapped, those of its strips are not.
    covered = sum((right - left) * (bottom - top) for left, top, right, bottom in extents)
    if covered < image.width * image.height:
        raise ImageError(f"damaged: pixel data for {covered} of {image.width}x{image.height} pixels only")


def _rawmode(image: Image.Image) -> str:
    """Return the layout of samples in the file of an image not yet loaded; empty: unknown."""
    tiles: list[Any] = getattr(image, "tile", [])
    return tiles[0].args if tiles and isinstance(tiles[0].args, str) else ""


def _fix_transparency(image: Image.Image, rawmode: str, data: bytes) -> None:
    """Correct a PNG's transparent colour (tRNS), which Pillow compares with samples of another depth."""
    transparency = image.info.get("transparency")
    if rawmode in LEVELS and isinstance(transparency, int):
        image.info["transparency"] = LEVELS[rawmode] * transparency
    if rawmode == "RGB;16B" and transparency is not None:
        # Pillow drops the lower bytes, in which a colour may differ from the transparent one.
        deep = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        if deep is None or deep.ndim != 3 or deep.shape[2] != 4:
            raise ImageError("16-bit colours with a transparent one cannot be read")
        del image.info["transparency"]
        image.putalpha(Image.fromarray(np.where(deep[..., 3] == 0, 0, 255).astype(np.uint8)))


def _without_unused_alpha(image: Image.Image, data: bytes) -> Image.Image:
    """Return an image without a channel of opacity that its writer left unused, as viewers show it.

    In these formats samples of 32 bits need not mean that there is opacity.
    """
    if image.format not in {"TGA", "BMP", "ICO"} or image.mode not in {"RGBA", "LA"}:
        return image
    undeclared = image.format == "TGA" and data[TGA_DESCRIPTOR] & TGA_ATTRIBUTE_BITS == 0
    if undeclared or image.getchannel("A").getextrema() == (0, 0):
        return image.convert(image.mode.removesuffix("A"))
    return image


def _draft(image: Image.Image, factor: int) -> int:
    """Let a JPEG be decoded 2, 4 or 8 times smaller, at most ``factor``; return how many times."""
    width, height = image.size
    most = min(factor, 8)
    drafted = image.draft(image.mode, (width // most, height // most)) if image.format == "JPEG" else None
    return round(width / drafted[1][2]) if drafted else 1


def reduced(image: Image.Image, paper: float | FloatArray | None, factor: int, name: str) -> FloatArray:
    """Return an image as ``to_srgb``, ``factor`` times smaller, with its colour profile applied.

    A pixel is the mean of a square, cropped at the right and lower border. Only strips are held besides the
    result, except of deep grey images.
    """
    profile = profile_of(image, name)
    if factor == 1:
        return to_srgb(image, paper, profile)
    if is_deep(image):
        return boxed(to_srgb(image, paper, profile), factor)
    width, height = image.size
    out = np.ones((-(-height // factor), -(-width // factor), 3 if paper is not None else 4), np.float32)
    step = max(1, STRIP_PIXELS // (width * factor))
    for top in range(0, len(out), step):
        part = image.crop((0, factor * top, width, min(factor * (top + step), height)))
        small = boxed(to_srgb(part, paper, profile), factor)
        out[top : top + step, :, : small.shape[2]] = small
    return without_opacity(out)


def without_opacity(image: FloatArray) -> FloatArray:
    """Return an image without its opacity if it is opaque."""
    return image[..., :3] if image.shape[2] == 4 and (image[..., 3] == 1).all() else image


@dataclass(frozen=True)
class ImageFacts:
    """Facts from an image file's header."""

    width: int
    """[px], upright."""
    height: int
    channels: int
    """Most channels of floats that it is read as."""
    decoded: int
    """Most bytes a pixel that decoding takes besides those."""
    drafts: bool
    """Whether it can be decoded smaller."""
    kept: int = 0
    """Bytes a pixel of the whole image that decoding takes at any size."""
    deep: bool = False
    """See ``is_deep``."""
    resolution: Resolution | None = None
    """That the file states, if it does."""


def image_facts(source: bytes) -> ImageFacts | None:
    """Return facts of an image without decoding it; None for what ``image_of`` will refuse."""
    try:
        with _opened(source) as image:
            width, height = image.size
            orientation = image.getexif().get(ExifTags.Base.Orientation, 1)
            taken = 1 if image.mode in {"1", "L", "P"} else 4  # by a pixel in Pillow's memory
            taken = taken * (2 if orientation != 1 else 1) + (0 if image.format in PLAIN_FORMATS else 8)
            if is_deep(image):  # all of it is held as floats
                taken += 16
            if orientation in SWAPPED:
                width, height = height, width
            kept = 6 if image.info.get("progressive") else 0  # the coefficients of a progressive JPEG
            channels = 4 if _is_transparent(image) else 3
            drafts, resolution = image.format == "JPEG", resolution_of(image)
            return ImageFacts(width, height, channels, taken, drafts, kept, is_deep(image), resolution)
    except Exception:  # Pillow's decoders raise nearly every kind of exception on broken data
        return None


PLAIN_FORMATS = {"JPEG", "PNG", "BMP", "GIF", "TIFF", "PPM", "TGA", "MPO"}
"""Formats that are decoded nearly row by row; decoders of others hold another copy of the image."""


def _is_transparent(image: Image.Image) -> bool:
    """Return whether pixels of an image may be transparent."""
    return "transparency" in image.info or image.mode[-1:] in {"A", "a"}


def is_deep(image: Image.Image) -> bool:
    """Return whether an image has one channel of 16 or 32 bits, whose white may depend on all pixels."""
    return image.mode == "F" or image.mode.startswith("I")


def _strips(image: Image.Image) -> Iterator[tuple[slice, Image.Image]]:
    """Yield rows and the part of the image that they are."""
    width, height = image.size
    step = max(1, STRIP_PIXELS // width)
    for top in range(0, height, step):
        bottom = min(top + step, height)
        yield slice(top, bottom), image.crop((0, top, width, bottom))


def to_srgb(image: Image.Image, paper: float | FloatArray | None, profile: Profile | None) -> FloatArray:
    """Return a loaded Pillow image of any mode, or a part of one, as ``image_of``; ``profile``: its colours'.

    Raises:
        ImageError: Pixels are not numbers.
    """
    if is_deep(image):
        grey, opacity = _grey(image)
        if profile:
            grey = interp(grey, np.linspace(0, 1, 256), profile.grey()).astype(np.float32)
        color = np.repeat(grey, 3, axis=2)
        return color if opacity is None else without_opacity(composited(color, opacity, paper))
    transparent = _is_transparent(image)
    out = np.empty((image.height, image.width, 4 if transparent and paper is None else 3), np.float32)
    for rows, part in _strips(image):
        if transparent:
            rgba = profile.rgba(part) if profile else part.convert("RGBA")
            values = np.asarray(rgba, np.float32) / np.float32(255)
            out[rows] = composited(values[..., :3], values[..., 3:], paper)
        else:
            rgb = profile.rgb(part) if profile else part.convert("RGB")
            np.divide(np.asarray(rgb), np.float32(255), out=out[rows])
    return without_opacity(out)


def composited(color: FloatArray, opacity: FloatArray, paper: float | FloatArray | None) -> FloatArray:
    """Return colours (height, width, 3) with an opacity (height, width, 1) on ``paper``; None: premultiplied
    with the opacity, shape (height, width, 4).
    """
    shown = color * opacity
    if paper is None:
        return np.concatenate([shown, opacity], axis=2)
    return np.asarray(shown + np.float32(paper) * (1 - opacity))


def _grey(image: Image.Image) -> tuple[FloatArray, FloatArray | None]:
    """Return the channel of a deep image in [0, 1], and its opacity, each of shape (height, width, 1)."""
    top = _white(image)
    transparent = image.info.get("transparency")
    out = np.empty((image.height, image.width, 1), np.float32)
    opacity = np.ones_like(out) if isinstance(transparent, int) else None
    for rows, part in _strips(image):
        samples = np.asarray(part)
        out[rows, :, 0] = np.clip(samples.astype(np.float32) / np.float32(top), 0, 1)
        if opacity is not None:
            opacity[rows, :, 0] = samples != transparent
    return out, opacity


def _white(image: Image.Image) -> float:
    """Return the value of white samples.

    Raises:
        ImageError: Samples are not numbers.
    """
    whole = image.mode != "F"  # to Pillow a portable float map is a PPM as well
    if whole and (image.mode.startswith("I;16") or image.format in {"PNG", "PPM"}):
        return 65535.0
    largest, missing = -np.inf, 0
    for _, part in _strips(image):
        samples: npt.NDArray[Any] = np.asarray(part)
        finite = samples[np.isfinite(samples)]
        missing += samples.size - finite.size
        largest = max(largest, float(finite.max())) if finite.size else largest
    if missing:
        share = f"{missing} of {image.width * image.height} pixels"
        raise ImageError(f"{share} are not finite numbers")
    # Nothing in the file defines white: take the least of the usual values that no sample exceeds.
    tops = [255.0, 65535.0, 2**31 - 1.0] if image.mode == "I" else [1.0, 255.0, 65535.0]
    return next((top for top in tops if largest <= top), largest)


class ImageRows:
    """The pixels of an image as ``image_of`` returns them, converted strip by strip on demand."""

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


def load_rows(source: bytes, paper: float | FloatArray | None, channels: int) -> ImageRows:
    """Read an image as ``image_of``, but strip by strip; not for deep grey ones (``is_deep``)."""
    with decoded(source, "the image") as (image, _):
        return ImageRows(image, paper, channels)
