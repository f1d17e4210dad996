"""Write animations as GIF, WebP or MP4."""

from __future__ import annotations

import importlib.util
import io
import itertools
import math
import struct
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from warpsplat.errors import UsageError
from warpsplat.files.image import WEBP_SIDE
from warpsplat.files.marks import GIF_COMMENT, MP4_MARK, WEBP_MARK
from warpsplat.motion.timing import HOLD

VIDEO_PACKAGE = "av"
"""FFmpeg with an encoder of H.264, which browsers, QuickTime and Windows play. OpenCV has
none: it writes MPEG-4 part 2, which plays in no browser.
"""


@dataclass(frozen=True)
class Format:
    """Properties of a kind of film."""

    rate: float
    """Frames per second."""
    side: int
    """Default of the longer side [px]."""


FORMATS = {".gif": Format(12.5, 480), ".webp": Format(15, 800), ".mp4": Format(25, 800)}
"""Kinds of films by their ending: a GIF counts hundredths of a second, and grows with its area."""

ENDINGS = (".svg", *FORMATS)
"""File name endings of animations."""

LEAST_SIDE = 320
"""Longer side of films of smaller images [px]: shapes have no pixels."""

Frame = tuple[Image.Image, float]
"""An image, RGB or RGBA, and its duration [s]."""


def check_format(path: Path) -> None:
    """Check that an animation of this name can be made.

    Raises:
        UsageError: there is none of that ending, or a package is missing; the message says how it is
            installed.
    """
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        known = ", ".join(ENDINGS[:-1]) + " or " + ENDINGS[-1]
        raise UsageError(f"{path}: is no kind of animation; its name ends with {known}")
    if ending == ".mp4" and importlib.util.find_spec(VIDEO_PACKAGE) is None:
        raise UsageError(
            f"{path}: MP4s need a package that is not installed: "
            f"pip install {VIDEO_PACKAGE}, or warpsplat with its extra: '.[video]'"
        )


def zoom_of(path: Path, size: tuple[float, float], width: int | None) -> float:
    """Return the pixels of a film per pixel of an image of ``size``.

    The longer side is at most ``WEBP_SIDE``, also the limit of H.264, if the shorter one keeps a pixel.
    """
    if width is not None:
        zoom = width / size[0]
    else:
        most = FORMATS[path.suffix.lower()].side
        zoom = min(most, max(*size, LEAST_SIDE)) / max(size)
    return min(max(zoom, 1 / min(size)), WEBP_SIDE / max(size))


MOST_PIXELS = 80_000_000
"""Maximum number of pixels of a film: GIF and WebP encoders hold all frames, with four bytes a pixel."""


def ticks_of(path: Path, size: tuple[int, int], seconds: float) -> int:
    """Return the maximum number of moving frames of a film of ``size``."""
    most = MOST_PIXELS // (size[0] * size[1])
    return max(2, min(most, round(FORMATS[path.suffix.lower()].rate * seconds)))


def encoded(path: Path, frames: Iterable[Frame]) -> bytes:
    """Return a film in the format of ``path``; the last frame stays ``HOLD`` seconds longer.

    GIF and WebP play again and again. GIF and MP4 have no opacity: transparency is white there.
    """
    make = {".gif": _gif, ".webp": _webp, ".mp4": _mp4}[path.suffix.lower()]
    return make(_held(frames))


def _held(frames: Iterable[Frame]) -> Iterator[Frame]:
    """Extend the duration of the last frame."""
    before: Frame | None = None
    for frame in frames:
        if before:
            yield before
        before = frame
    if before:
        yield before[0], before[1] + HOLD


def _opaque(picture: Image.Image) -> Image.Image:
    """Return an image on white."""
    if picture.mode == "RGB":
        return picture
    white = Image.new("RGBA", picture.size, "white")
    return Image.alpha_composite(white, picture).convert("RGB")


COLORS = 255
"""Colours of a GIF's frame; one of 256 is left for unchanged pixels."""


ENOUGH_PIXELS = 10_000
"""Pixels to choose a frame's colours from; all of them take nine times as long, for half a decibel."""


def _few_colors(picture: Image.Image) -> Image.Image:
    """Reduce an image to ``COLORS``."""
    step = max(1, math.isqrt(picture.width * picture.height // ENOUGH_PIXELS))
    some = picture.resize([max(1, side // step) for side in picture.size], Image.Resampling.NEAREST)
    table = some.quantize(COLORS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    return table if step == 1 else picture.quantize(palette=table, dither=Image.Dither.NONE)


def _gif(frames: Iterable[Frame]) -> bytes:
    """Write a GIF with a colour table a frame: a common one shows steps in skies and skin.

    Without dithering, whose grain would flicker and take twice the bytes.
    """
    pictures, times = [], []
    for picture, seconds in frames:
        pictures.append(_few_colors(_opaque(picture)))
        times.append(round(100 * seconds) * 10)
    packed = io.BytesIO()
    pictures[0].save(
        packed,
        "GIF",
        save_all=True,
        append_images=pictures[1:],
        duration=times,
        loop=0,
        comment=GIF_COMMENT,
        optimize=False,
    )
    return packed.getvalue()


WEBP_QUALITY = 80

WEBP_METHOD = 2
"""WebP effort, 0 to 6: twice as fast as the default 4, for 4 % more bytes; 1 and 0 take 30 % more."""


def _webp(frames: Iterable[Frame]) -> bytes:
    pictures = list(frames)
    packed = io.BytesIO()
    pictures[0][0].save(
        packed,
        "WEBP",
        save_all=True,
        append_images=[picture for picture, _ in pictures[1:]],
        duration=[round(1000 * seconds) for _, seconds in pictures],
        loop=0,
        quality=WEBP_QUALITY,
        method=WEBP_METHOD,
    )
    data = packed.getvalue() + WEBP_MARK
    return data[:4] + struct.pack("<I", len(data) - 8) + data[8:]


H264 = {"crf": "17", "preset": "veryfast", "threads": "1"}
"""Of x264, whose authors say that an eye hardly tells 18 from the source. Films are as large as with 18 and
the usual preset, half a decibel further from the source, and take a third of the time; several threads would
mostly wait, as pictures come one by one."""


def _mp4(frames: Iterable[Frame]) -> bytes:
    # In a file: its table of contents comes to the front, for players that do not wait for all.
    with tempfile.TemporaryDirectory(prefix="warpsplat-") as folder:
        path = Path(folder, "film.mp4")
        _encode_h264(path, frames)
        return path.read_bytes() + MP4_MARK


def _encode_h264(path: Path, frames: Iterable[Frame]) -> None:
    """Write an MP4 for all players: even sides, a constant rate, and half-size chroma."""
    import av

    rate = round(FORMATS[".mp4"].rate)
    frames = iter(frames)
    first = next(frames)
    width, height = (max(2, side // 2 * 2) for side in first[0].size)
    with av.open(str(path), "w", options={"movflags": "faststart"}) as film:
        stream = film.add_stream("libx264", rate=rate, options=H264)
        stream.width, stream.height = width, height
        stream.pix_fmt = "yuv420p"
        for picture, seconds in itertools.chain([first], frames):
            shown = av.VideoFrame.from_image(_opaque(picture).crop((0, 0, width, height)))
            for _ in range(max(1, round(rate * seconds))):
                shown.pts = None
                film.mux(stream.encode(shown))
        film.mux(stream.encode(None))
