"""Films: rasterise SVGs as frames and encode frames as a GIF, WebP or MP4."""

from __future__ import annotations

import importlib.util
import io
import math
import struct
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from PIL import Image

from warpsplat.errors import UsageError
from warpsplat.files.image import WEBP_SIDE
from warpsplat.files.marks import GIF_COMMENT, MP4_MARK, WEBP_MARK
from warpsplat.motion.timing import HOLD
from warpsplat.run.svg import size_of
from warpsplat.svg.viewer import render_own, render_svg

VIDEO_PACKAGE = "av"
"""FFmpeg with an H.264 encoder; OpenCV only has MPEG-4 part 2, which no browser plays."""


RATES = {".gif": 12.5, ".webp": 15, ".mp4": 25}
"""Frames per second, by extension; GIFs count in hundredths of a second."""

SIDES = {".gif": 480, ".webp": 800, ".mp4": 800}
"""Longest side if no width is given [px]; GIFs are large."""

Size = tuple[int, int]
"""Width and height [px]."""

Frame = tuple[Image.Image, float]
"""An RGB or RGBA picture, and how long it is shown [s]."""


def check_format(path: Path) -> None:
    """Check that an animation with this extension can be made.

    Raises:
        UsageError: the extension is unknown, or a package is missing; the message says how to install it.
    """
    extension = path.suffix.lower()
    if extension not in (".svg", *RATES):
        raise UsageError(f"{path}: not an animation format; the name must end in .svg, .gif, .webp or .mp4")
    if extension == ".mp4" and importlib.util.find_spec(VIDEO_PACKAGE) is None:
        raise UsageError(
            f"{path}: MP4s need a package that is not installed: "
            f"pip install {VIDEO_PACKAGE}, or warpsplat with its extra: '.[video]'"
        )


def zoom_of(path: Path, size: tuple[float, float], width: int | None) -> float:
    """Return pixels of a film of ``width``, by default the format's, per pixel of a picture of ``size``.

    The shorter side keeps at least a pixel as long as the longer one has at most ``WEBP_SIDE``, which is also
    the limit of H.264 encoders.
    """
    min_side = 320  # longest side of a film of a smaller image [px]
    if width is not None:
        zoom = width / size[0]
    else:
        zoom = min(SIDES[path.suffix.lower()], max(*size, min_side)) / max(size)
    return min(max(zoom, 1 / min(size)), WEBP_SIDE / max(size))


def zoom_and_size(text: str, path: Path, width: int | None) -> tuple[float, Size]:
    """Return the zoom of an SVG in a film, and the whole pixels that it covers."""
    size = size_of(text, path.name)
    zoom = zoom_of(path, size, width)
    return zoom, (max(1, int(size[0] * zoom + 1e-6)), max(1, int(size[1] * zoom + 1e-6)))


def frame_count(path: Path, size: Size, seconds: float) -> int:
    """Return the largest number of frames for a movement of ``seconds``."""
    # Total of all frames: the GIF and WebP encoders hold them all, with four bytes per pixel.
    max_pixels = 80_000_000
    most = max_pixels // (size[0] * size[1])
    return max(2, min(most, round(RATES[path.suffix.lower()] * seconds)))


def rasterised(text: str, size: Size, zoom: float | None = None) -> Image.Image:
    """Render an SVG as viewers do: RGBA, cropped to ``size``.

    Without a ``zoom``, it must be one of this size that warpsplat wrote.
    """
    image = render_own(text) if zoom is None else render_svg(text, zoom=zoom)
    return image.convert("RGBA").crop((0, 0, *size))


def encoded(path: Path, frames: Iterable[Frame]) -> bytes:
    """Return the film in the format of ``path``; the last frame is shown ``HOLD`` seconds longer.

    GIF and WebP loop. GIF and MP4 have no opacity: transparency becomes white.
    """
    *others, (last, seconds) = frames
    encode = {".gif": _gif, ".webp": _webp, ".mp4": _mp4}[path.suffix.lower()]
    return encode([*others, (last, seconds + HOLD)])


def _opaque(picture: Image.Image) -> Image.Image:
    """Return the picture on white."""
    if picture.mode == "RGB":
        return picture
    return Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture).convert("RGB")


def _with_palette(picture: Image.Image) -> Image.Image:
    # Pixels that a frame's palette is chosen from; all of them take nine times as long for half a decibel.
    palette_pixels = 10_000
    step = max(1, math.isqrt(picture.width * picture.height // palette_pixels))
    sample = picture.resize([max(1, side // step) for side in picture.size], Image.Resampling.NEAREST)
    gif_colors = 255  # per frame; one of 256 is left for the pixels that did not change
    quantized = sample.quantize(gif_colors, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    return quantized if step == 1 else picture.quantize(palette=quantized, dither=Image.Dither.NONE)


def _gif(frames: list[Frame]) -> bytes:
    """Encode with a palette per frame: a common one shows banding, and dithering flickers."""
    pictures = [_with_palette(_opaque(picture)) for picture, _ in frames]
    times = [round(100 * seconds) * 10 for _, seconds in frames]
    return _encoded_by_pillow(pictures, times, format="GIF", comment=GIF_COMMENT, optimize=False)


def _webp(frames: list[Frame]) -> bytes:
    times = [round(1000 * seconds) for _, seconds in frames]
    # Method 2 is twice as fast as the default 4, for 4 % more bytes; 1 and 0 take 30 % more.
    data = _encoded_by_pillow([picture for picture, _ in frames], times, format="WEBP", quality=80, method=2)
    data += WEBP_MARK
    return data[:4] + struct.pack("<I", len(data) - 8) + data[8:]


def _encoded_by_pillow(pictures: list[Image.Image], times: list[int], **options: Any) -> bytes:
    """Encode a loop; ``times`` in ms."""
    packed = io.BytesIO()
    pictures[0].save(packed, save_all=True, append_images=pictures[1:], duration=times, loop=0, **options)
    return packed.getvalue()


H264 = {"crf": "17", "preset": "veryfast", "threads": "1"}
"""Options of x264: as large as with CRF 18 and the default preset, half a decibel worse, in a third of the
time. Several threads would mostly wait, as frames come one by one."""


def _mp4(frames: list[Frame]) -> bytes:
    """Encode an MP4 that all players accept: even sides, constant rate, chroma at half the resolution."""
    import av

    rate = round(RATES[".mp4"])
    width, height = (max(2, side // 2 * 2) for side in frames[0][0].size)
    # By way of a file, so that "faststart" can move the index to the front, for players that stream.
    with tempfile.TemporaryDirectory(prefix="warpsplat-") as folder:
        path = Path(folder, "film.mp4")
        with av.open(str(path), "w", options={"movflags": "faststart"}) as film:
            stream = film.add_stream("libx264", rate=rate, options=H264)
            stream.width, stream.height = width, height
            stream.pix_fmt = "yuv420p"
            for picture, seconds in frames:
                shown = av.VideoFrame.from_image(_opaque(picture).crop((0, 0, width, height)))
                for _ in range(max(1, round(rate * seconds))):
                    shown.pts = None
                    film.mux(stream.encode(shown))
            film.mux(stream.encode(None))
        return path.read_bytes() + MP4_MARK
