"""Reading images: rasters of the formats that are read, as sRGB on white, upright.

A photograph of 50 megapixels is 600 MB as floats, so that beside the result only strips of it are held.
"""

from __future__ import annotations

import contextlib
import io
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
import numpy.typing as npt
from PIL import ExifTags, Image, ImageOps, UnidentifiedImageError

from warpsplat.errors import ImageError
from warpsplat.files.inputs import input_name, read_input
from warpsplat.files.profile import Profile, profile_of
from warpsplat.native import messages_hidden
from warpsplat.portable.filters import resize_area
from warpsplat.portable.sequences import interp
from warpsplat.scene import FloatArray

Taken = TypeVar("Taken")

FORMATS = (
    *("PNG", "JPEG", "GIF", "BMP", "PPM", "WEBP", "AVIF", "TIFF", "JPEG2000", "ICO", "QOI", "PCX", "SGI"),
    *("DDS", "PSD", "TGA"),  # TGA last: it has no mark of its own, so that much else may look like it
)
"""Formats that are read, by Pillow's names: those that are nothing but pixels. Others that Pillow opens are
programs (EPS, which it gives to Ghostscript), drawings (WMF), containers of other formats (IPTC), or rare."""

MIN_SIDE = 2
"""Smallest side of an image [px]: with one pixel there is nothing to fit a shape to."""

MAX_PIXELS = 120_000_000
"""Largest image [pixels]: the largest that cameras give. A small file may claim any size (a bomb)."""

BOMB_PIXELS = 16_000_000
PIXELS_A_BYTE = 10_000
"""A large image of more pixels a byte is a bomb, or blank: drawings in two colours have a tenth of that."""

STRIP_PIXELS = 1 << 20
"""Pixels that are converted at a time."""

WEBP_SIDE = 16_383
"""Longest side of a WebP [px]: its head has 14 bits for one."""

LEVELS = {"1": 255, "L;2": 85, "L;4": 17}
"""What Pillow makes of a sample 1 in PNGs of fewer than 8 bits; their transparent grey it leaves as it is."""


def load_image(
    source: Path | bytes,
    name: str | None = None,
    *,
    paper: float | FloatArray | None = 1.0,
    factor: int = 1,
) -> FloatArray:
    """Read an image: first frame, EXIF rotation and colour profile applied, transparency on ``paper``.

    Args:
        source: a file, ``-`` for the standard input, or the bytes of an image.
        name: what messages call it; without, the path.
        paper: grey level or colour that transparency is composited on; None: it is kept.
        factor: how many times smaller to read it, see ``reduced``; JPEGs take less memory and time to decode
            so.

    Returns:
        sRGB in [0, 1], shape (height, width, 3), float32; where transparency is kept and there is some,
        premultiplied with opacity, shape (height, width, 4). Grey images of 16 bits keep their precision.

    Raises:
        ImageError: missing, unreadable, truncated, not an image, too large, too small, or with pixels that
            are no numbers. The message is one line that names the image and the cause.
    """
    name = name or (input_name(source) if isinstance(source, Path) else "the image")
    return read_image(source, name, lambda image, left: reduced(image, paper, left, name), factor)


def read_image(
    source: Path | bytes, name: str | None, take: Callable[[Image.Image, int], Taken], factor: int = 1
) -> Taken:
    """What ``take`` makes of an image that is decoded and upright, and of how many times smaller it is to
    become: ``factor`` but for what decoding has done of it. Arguments and errors as for ``load_image``.
    """
    if isinstance(source, Path):
        name = name or input_name(source)
        source = read_input(source)
    name = name or "the image"
    try:
        # Pillow warns of what it can read all the same (odd metadata), and of bombs, which are refused;
        # libtiff prints what is wrong with a file, whether or not it can be read.
        with _decoding, warnings.catch_warnings(), _pixel_limit(), messages_hidden():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with open_image(source) as opened:
                width, height = opened.size
                if min(width, height) < MIN_SIDE:
                    least = f"at least {MIN_SIDE}x{MIN_SIDE} are needed"
                    raise ImageError(f"{width}x{height} pixels; {least}")
                if width * height > max(BOMB_PIXELS, PIXELS_A_BYTE * len(source)):
                    raise ImageError(f"claims {width}x{height} pixels in {len(source)} bytes")
                _check_covered(opened)
                rawmode = _rawmode(opened)
                left = factor // _draft(opened, factor)
                opened.load()
                _mend_transparency(opened, rawmode, source)
                ImageOps.exif_transpose(opened, in_place=True)
                return take(opened, left)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from None
    except MemoryError:
        raise
    except UnidentifiedImageError:
        raise ImageError(
            f"{name}: not an image of a format that is read: {', '.join(sorted(FORMATS))}"
        ) from None
    except (Image.DecompressionBombError, Image.DecompressionBombWarning):
        limit = f"{MAX_PIXELS / 1e6:g} million pixels"
        raise ImageError(f"{name}: too large: more than {limit}") from None
    except Exception as error:  # Pillow's decoders raise nearly every kind of exception on broken data
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ImageError(f"{name}: damaged or unsupported image: {cause}") from error


def open_image(data: bytes) -> Image.Image:
    """An image of ``FORMATS``, its head read only: the one place where Pillow opens a file of unknown origin.

    Raises:
        UnidentifiedImageError: something else.
    """
    return Image.open(io.BytesIO(data), formats=FORMATS)


_decoding = threading.Lock()
"""Pillow's limit and Python's warnings are those of the process: one thread at a time changes them."""


@contextlib.contextmanager
def _pixel_limit() -> Iterator[None]:
    """MAX_PIXELS in place of Pillow's own limit, which its decoders look up themselves."""
    before = Image.MAX_IMAGE_PIXELS
    Image.MAX_IMAGE_PIXELS = MAX_PIXELS
    try:
        yield
    finally:
        Image.MAX_IMAGE_PIXELS = before


def _check_covered(image: Image.Image) -> None:
    """Refuse a TIFF whose strips do not make up its picture: Pillow would show the rest as black.

    Raises:
        ImageError: parts are missing.
    """
    if image.format != "TIFF":  # the frame of a GIF need not fill it
        return
    extents = {tile[1] for tile in getattr(image, "tile", [])}
    # Areas: the sides of a picture that lies on its side are swapped already, those of its strips are not.
    covered = sum((right - left) * (bottom - top) for left, top, right, bottom in extents)
    if covered < image.width * image.height:
        raise ImageError(f"damaged: pixel data for {covered} of {image.width}x{image.height} pixels only")


def _rawmode(image: Image.Image) -> str:
    """How the samples of an image that is not yet loaded lie in its file; empty where Pillow does not say."""
    tiles: list[Any] = getattr(image, "tile", [])
    return tiles[0].args if tiles and isinstance(tiles[0].args, str) else ""


def _mend_transparency(image: Image.Image, rawmode: str, data: bytes) -> None:
    """A PNG's transparent colour (tRNS) where Pillow compares it with samples of another depth."""
    transparency = image.info.get("transparency")
    if rawmode in LEVELS and isinstance(transparency, int):
        image.info["transparency"] = LEVELS[rawmode] * transparency
    if rawmode == "RGB;16B" and transparency is not None:
        # Pillow has dropped the lower bytes, in which a colour may differ from the transparent one.
        deep = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        if deep is None or deep.ndim != 3 or deep.shape[2] != 4:
            raise ImageError("16-bit colours with a transparent one cannot be read")
        del image.info["transparency"]
        image.putalpha(Image.fromarray(np.where(deep[..., 3] == 0, 0, 255).astype(np.uint8)))


def _draft(image: Image.Image, factor: int) -> int:
    """Have a JPEG decoded 2, 4 or 8 times smaller, ``factor`` at the most; how many times it is."""
    width, height = image.size
    if factor == 1 or image.format != "JPEG":
        return 1
    most = min(factor, DRAFTS[0])
    image.draft(image.mode, (width // most, height // most))
    return next(n for n in (*DRAFTS, 1) if image.size == (-(-width // n), -(-height // n)))


DRAFTS = (8, 4, 2)
"""How many times smaller a JPEG can be decoded."""


def reduced(
    image: Image.Image, paper: float | FloatArray | None, factor: int, name: str = "the image"
) -> FloatArray:
    """As ``to_srgb``, ``factor`` times smaller: a pixel is the mean of a square, at the right and lower
    border of what there is of it. Beside the result only strips are held, but of deep grey images.
    """
    profile = profile_of(image, name)
    if factor == 1:
        return to_srgb(image, paper, profile)
    if is_deep(image):
        return boxed(to_srgb(image, paper, profile), factor)
    width, height = image.size
    out = np.empty((-(-height // factor), -(-width // factor), 3 if paper is not None else 4), np.float32)
    step = max(1, STRIP_PIXELS // (width * factor))
    for top in range(0, len(out), step):
        part = image.crop((0, factor * top, width, min(factor * (top + step), height)))
        small = boxed(to_srgb(part, paper, profile), factor)
        out[top : top + step, :, : small.shape[2]] = small
        if small.shape[2] < out.shape[2]:
            out[top : top + step, :, 3] = 1
    return out[..., :3] if paper is None and (out[..., 3] == 1).all() else out


@dataclass(frozen=True)
class Facts:
    """What a file's head says of an image."""

    width: int
    """[px], upright."""
    height: int
    channels: int
    """Of the floats that it is read as, at the most."""
    decoded: int
    """Bytes of a pixel that decoding takes, at the most, beside those."""
    drafts: bool
    """Whether it can be decoded smaller."""
    kept: int = 0
    """Bytes of a pixel of the whole image that decoding takes at any size."""
    deep: bool = False
    """See ``is_deep``."""


def image_facts(source: bytes) -> Facts | None:
    """What can be said of an image without decoding it; None where that is for ``load_image`` to refuse."""
    try:
        with _decoding, warnings.catch_warnings(), _pixel_limit(), messages_hidden():
            warnings.simplefilter("ignore")
            with open_image(source) as image:
                width, height = image.size
                turned = image.getexif().get(ExifTags.Base.Orientation, 1)
                bands = 4 if is_deep(image) else SAMPLE_BYTES.get(image.mode, 4)
                decoded = bands * (2 if turned != 1 else 1) + (0 if image.format in PLAIN_FORMATS else 8)
                if is_deep(image):  # all of it is floats first
                    decoded += 16
                if turned in range(5, 9):
                    width, height = height, width
                transparent = "transparency" in image.info or image.mode[-1:] in {"A", "a"}
                kept = PROGRESSIVE if image.info.get("progressive") else 0
                drafts = image.format == "JPEG"
                channels = 4 if transparent else 3
                return Facts(width, height, channels, decoded, drafts, kept, is_deep(image))
    except Exception:  # whatever Pillow's decoders raise on broken data
        return None


SAMPLE_BYTES = {"1": 1, "L": 1, "P": 1}
"""Of a pixel, as Pillow holds it; 4 in all other modes."""

PLAIN_FORMATS = {"JPEG", "PNG", "BMP", "GIF", "TIFF", "PPM", "TGA", "MPO"}
"""Formats that are decoded row by row, or nearly so; of others the decoder holds all of it for itself."""

PROGRESSIVE = 6
"""Bytes of a pixel that the coefficients of a progressive JPEG take."""


def is_deep(image: Image.Image) -> bool:
    """Whether an image is one channel of 16 or 32 bits, whose white may be known from all of it only."""
    return image.mode == "F" or image.mode.startswith("I")


def boxed(pixels: FloatArray, factor: int) -> FloatArray:
    """Means of squares of ``factor`` x ``factor`` px; what is missing at a border is as what is there."""
    height, width = pixels.shape[:2]
    size = (-(-width // factor), -(-height // factor))
    below, right = size[1] * factor - height, size[0] * factor - width
    whole: npt.NDArray[Any] = pixels
    if below or right:
        whole = cv2.copyMakeBorder(whole, 0, below, 0, right, cv2.BORDER_REPLICATE)
    return resize_area(whole, size)


def _strips(image: Image.Image) -> Iterator[tuple[slice, Image.Image]]:
    """Rows, and the part of the image that they are."""
    width, height = image.size
    step = max(1, STRIP_PIXELS // width)
    for top in range(0, height, step):
        bottom = min(top + step, height)
        yield slice(top, bottom), image.crop((0, top, width, bottom))


def to_srgb(
    image: Image.Image, paper: float | FloatArray | None = 1.0, profile: Profile | None = None
) -> FloatArray:
    """A loaded Pillow image of any mode, or a part of one, as sRGB in [0, 1], by its colour ``profile``
    (``profile_of``); see ``load_image``.

    Raises:
        ImageError: pixels that are no numbers.
    """
    if is_deep(image):
        grey, opacity = _grey(image)
        if profile:
            grey = interp(grey, np.linspace(0, 1, 256), profile.grey()).astype(np.float32)
        return composited([(slice(None), np.repeat(grey, 3, axis=2), opacity)], image.size, paper)
    transparent = "transparency" in image.info or bool({"A", "a"} & set(image.getbands()[-1:]))
    if transparent:
        return composited(_straight_strips(image, profile), image.size, paper)
    out = np.empty((image.height, image.width, 3), np.float32)
    for rows, part in _strips(image):
        rgb = profile.rgb(part) if profile else part.convert("RGB")
        np.divide(np.asarray(rgb), np.float32(255), out=out[rows])
    return out


Strip = tuple[slice, FloatArray, FloatArray | None]
"""Rows, their colours (height, width, 3), and their opacity (height, width, 1) where there is any."""


def _straight_strips(image: Image.Image, profile: Profile | None) -> Iterator[Strip]:
    for rows, part in _strips(image):
        rgba = np.asarray(profile.rgba(part) if profile else part.convert("RGBA"), np.float32) / np.float32(
            255
        )
        yield rows, rgba[..., :3], rgba[..., 3:]


def composited(
    strips: Iterable[Strip], size: tuple[int, int], paper: float | FloatArray | None
) -> FloatArray:
    """On ``paper``; without, premultiplied and with opacity, if not all is opaque."""
    width, height = size
    out = np.empty((height, width, 4 if paper is None else 3), np.float32)
    for rows, color, opacity in strips:
        if opacity is None:
            out[rows, :, :3] = color
            out[rows, :, 3:] = 1
            continue
        out[rows, :, :3] = color * opacity
        if paper is None:
            out[rows, :, 3:] = opacity
        else:
            out[rows] += np.float32(paper) * (1 - opacity)
    return out[..., :3] if paper is None and (out[..., 3] == 1).all() else out


def _grey(image: Image.Image) -> tuple[FloatArray, FloatArray | None]:
    """One channel of 16 or 32 bits, integers or floats, and its opacity, each (height, width, 1)."""
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
    """The sample that is white.

    Raises:
        ImageError: samples that are no numbers.
    """
    whole = image.mode != "F"  # a portable float map is a PPM to Pillow as well
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
        raise ImageError(f"{share} are no numbers (NaN or infinite)")
    # Neither format says what white is: the least of the usual ones that holds all samples.
    tops = [255.0, 65535.0, 2**31 - 1.0] if image.mode == "I" else [1.0, 255.0, 65535.0]
    return next((top for top in tops if largest <= top), largest)
