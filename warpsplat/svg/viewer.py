"""Rendering of SVGs with resvg, an independent viewer.

Texts written by this program are drawn in this process. Foreign ones pass ``inspect_svg`` and are drawn in a
process of their own under limits, because they can make resvg crash, hang or fill the memory.
"""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import resvg_py
from PIL import Image, PngImagePlugin

from warpsplat.errors import ImageError, ResourceError, Stopped, cause_of
from warpsplat.native import STRIP_PIXELS, available_cores
from warpsplat.svg import draw_child
from warpsplat.svg.inspect import MAX_PIXELS, inspect_svg, svg_size
from warpsplat.svg.write import OUR_HEAD, resized

Pixels = npt.NDArray[np.float64]

OPTIONS: dict[str, Any] = {"dpi": 96.0, "skip_system_fonts": True}

TEXT = re.compile(r"<(?:[\w.-]+:)?text[\s/>]")
"""An element that needs the system's fonts; other files look the same on any system."""


def _open(png: bytes) -> Image.Image:
    # Image.open has a limit on pixels for files of unknown origin.
    return PngImagePlugin.PngImageFile(io.BytesIO(png))


def render_own(text: str) -> Image.Image:
    """Render SVG text written by this program with resvg, at its own size, in this process.

    Raises:
        ImageError: resvg does not accept the text.
    """
    try:
        return _open(bytes(resvg_py.svg_to_bytes(svg_string=text, **OPTIONS)))
    except ValueError as error:
        raise ImageError(f"cannot be rendered: {cause_of(error)[:200]}") from error
    except BaseException as error:
        # pyo3's class for a panic of Rust code derives from BaseException and cannot be imported.
        if type(error).__name__ != "PanicException":
            raise
        raise ImageError(f"cannot be rendered: resvg fails: {cause_of(error)[:200]}") from None


def render_svg(text: str, *, size: tuple[int, int] | None = None, zoom: float | None = None) -> Image.Image:
    """Return any SVG text rendered as by ``draw_png``."""
    return _open(draw_png(text, size=size, zoom=zoom))


def draw_png(text: str, *, size: tuple[int, int] | None = None, zoom: float | None = None) -> bytes:
    """Return any SVG text as a PNG, of a width and height [px], or magnified by ``zoom``.

    Raises:
        ImageError: Not an SVG, one that resvg does not accept or fails on, a picture of more than
            ``MAX_PIXELS``, or one that takes more time or memory than its size and length explain.
        ResourceError: No further process can be started.
    """
    own = svg_size(inspect_svg(text).root)
    width, height = size or (None, None)
    options = {**OPTIONS, "width": width, "height": height, "zoom": zoom}
    return _drawn("png", text, options, float(size[0] * size[1]) if size else _pixels(own, zoom or 1.0))


def _pixels(own: tuple[float, float] | None, zoom: float = 1.0) -> float:
    """Return the number of pixels of a picture; 0 if its size is not known before rendering."""
    # Unlike products, powers of floats raise OverflowError.
    return max(own[0], 1.0) * max(own[1], 1.0) * zoom * zoom if own else 0.0


def draw_pdf(text: str, *, zoom: float = 1.0) -> bytes:
    """Return any SVG text as a PDF of the same paths, ``zoom`` times as large; raises as ``draw_png``.

    The same text gives the same bytes.
    """
    own = svg_size(inspect_svg(text).root)
    width = own[0] * zoom * POINTS_PER_PIXEL if own else None
    return _drawn("pdf", text, {"width": width}, _pixels(own))


POINTS_PER_PIXEL = 72 / OPTIONS["dpi"]


def _drawn(form: str, text: str, options: dict[str, Any], pixels: float) -> bytes:
    """Return the output of ``draw_child`` for ``text``, under limits for a picture of so many ``pixels``."""
    if not pixels <= MAX_PIXELS:
        raise ImageError(f"makes more than {MAX_PIXELS // 1_000_000} million pixels")
    # Of the processor time [s] three times what large plain drawings take; of the address space [bytes] three
    # layers, and 100 times the text.
    seconds = round(CPU_SECONDS + 5e-6 * len(text) + 1.2e-7 * pixels)
    memory = round(MEMORY + 100 * len(text) + 12 * pixels)
    options = {**options, "skip_system_fonts": TEXT.search(text) is None}
    limits = {"seconds": seconds, "memory": memory}
    request = {"path": sys.path, **limits, "form": form, "options": options}
    try:
        done = subprocess.run(
            # Isolated, and with this program's module path.
            [sys.executable, "-I", "-S", str(Path(draw_child.__file__))],
            input=json.dumps(request).encode() + b"\n" + text.encode(),
            capture_output=True,
            timeout=WALL_FACTOR * seconds,
            start_new_session=True,  # Ctrl-C is for this process to act on
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ImageError(f"cannot be rendered within {WALL_FACTOR * seconds} s") from None
    except OSError as error:
        raise ResourceError(f"no process to draw the SVG in: {cause_of(error)}") from error
    if done.returncode == 0:
        return done.stdout
    message = done.stderr.decode(errors="replace")
    if done.returncode == draw_child.REFUSED:
        cause = (message.strip().splitlines() or ["no cause given"])[0]
        raise ImageError(f"cannot be rendered: {cause[:200]}")
    if "memory allocation" in message or "MemoryError" in message:
        raise ImageError(f"cannot be rendered with {memory >> 20} MiB of memory")
    if -done.returncode in LIMIT_SIGNALS:
        raise ImageError(f"cannot be rendered within {seconds} s of processor time")
    raise ImageError("cannot be rendered: the renderer crashed")


CPU_SECONDS = 4.0
"""Processor time that every file may take, besides that for its length and its pixels."""
WALL_FACTOR = 3
"""Ratio of the bound of wall-clock time to that of processor time."""
MEMORY = 3 << 29
"""Address space that every file may take [bytes], likewise."""
LIMIT_SIGNALS = (9, 24)
"""SIGKILL and SIGXCPU, which end a process at its limit of processor time."""


def on_white(image: Image.Image) -> Pixels:
    """Return RGB in [0, 255], shape (height, width, 3), transparency composited on white."""
    image = image.convert("RGBA")
    if image.getchannel("A").getextrema() == (255, 255):
        return np.asarray(image.convert("RGB")).astype(np.float64)
    rgba = np.asarray(image).astype(np.float64)
    alpha = rgba[..., 3:] / 255.0
    return np.asarray(rgba[..., :3] * alpha + 255.0 * (1.0 - alpha))


def premultiplied(image: Image.Image) -> Pixels:
    """Return RGB times opacity, and opacity, in [0, 255], shape (height, width, 4)."""
    rgba = np.asarray(image.convert("RGBA")).astype(np.float64)
    rgba[..., :3] *= rgba[..., 3:] / 255.0
    return rgba


Bytes = npt.NDArray[np.uint8]
Stop = Callable[[], bool]

WHOLE_PIXELS = 1 << 22
"""Largest SVG that is drawn in one piece [pixels]. In strips, edges move by thousandths of a pixel, because a
viewer clips curves at the border of its canvas; the PSNR changes by less than 0.0001 dB."""

DRAWERS = 4
"""Most strips that are drawn at once."""


def check_stop(stop: Stop | None) -> None:
    """Raise ``Stopped`` if ``stop`` returns true."""
    if stop and stop():
        raise Stopped


def rows_of(width: int, height: int, overlap: int = 0) -> Iterator[slice]:
    """Yield the rows of strips of ``STRIP_PIXELS`` from top to bottom, each up to ``overlap`` rows longer."""
    step = max(1, STRIP_PIXELS // width)
    for top in range(0, height - overlap, step):
        yield slice(top, min(top + step + overlap, height))


def draw(text: str, width: int, height: int, stop: Stop | None = None, *, own: bool = False) -> Bytes:
    """Render an SVG with resvg at ``width`` x ``height`` px: sRGB and opacity, shape (height, width, 4).

    Large files written here are drawn in strips, others in one piece. ``own``: this program wrote the text
    just now, so that it needs no precautions.

    Raises:
        ImageError: Not an SVG, or one of other proportions.
        Stopped: ``stop`` returned true.
    """
    check_stop(stop)
    head = OUR_HEAD.match(text)
    cuttable = head is not None and (int(head[1]), int(head[2])) == (width, height)

    def drawn(text: str, height: int) -> Bytes:
        image = render_own(text) if own else render_svg(text, size=(width, height))
        if image.size != (width, height):
            size = f"{image.width}x{image.height}"
            raise ImageError(f"renders as {size}, the image has {width}x{height} pixels")
        return np.asarray(image.convert("RGBA"))

    if not cuttable or width * height <= WHOLE_PIXELS:
        return drawn(text, height)

    def strip(rows: slice) -> Bytes:
        check_stop(stop)
        tall = rows.stop - rows.start
        return drawn(resized(text, width, tall, 1.0, rows.start), tall)

    out = np.empty((height, width, 4), np.uint8)
    strips = list(rows_of(width, height))
    with ThreadPoolExecutor(min(DRAWERS, available_cores())) as drawers:
        try:
            for rows, part in zip(strips, drawers.map(strip, strips), strict=True):
                out[rows] = part
        except BaseException:
            drawers.shutdown(wait=False, cancel_futures=True)
            raise
    return out
