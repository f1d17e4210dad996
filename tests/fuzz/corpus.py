"""Valid inputs, from which mutation starts."""

from __future__ import annotations

import contextlib
import io
import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from PIL import Image

from tests.fuzz.vocabulary import HEAD, HEADS, HEIGHT, SHAPES, WIDTH, YAMLS
from tests.scenes import CURVES, ragged_scene, random_scene, with_gradients
from warpsplat.scene import Kind
from warpsplat.svg.write import write_svg


@dataclass(frozen=True)
class Seed:
    """An input; the ending of its name is that of its kind."""

    name: str
    data: bytes


def saved(image: Image.Image, form: str, **options: Any) -> bytes:
    """Return an image's file."""
    buffer = io.BytesIO()
    image.save(buffer, form, **options)
    return buffer.getvalue()


def picture(mode: str = "RGB") -> Image.Image:
    """Return a ramp with noise, of any Pillow mode."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    noise = np.random.default_rng(0).integers(0, 32, (HEIGHT, WIDTH))
    rgba = np.stack([7 * x, 9 * y, 3 * x + noise, 255 - 4 * y], axis=2).astype(np.uint8)
    image = Image.fromarray(rgba)
    numbers = {"I;16": (x * 2000, np.uint16), "I": (x * 2000, np.int32), "F": (x / WIDTH, np.float32)}
    if mode in numbers:
        values, kind = numbers[mode]
        return Image.fromarray(values.astype(kind))
    return image.convert(mode) if mode in ("LA", "RGBA") else image.convert("RGB").convert(mode)


MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "LAB", "YCbCr", "I", "I;16", "F")
FORMATS: dict[str, tuple[dict[str, Any], ...]] = {
    "png": ({"transparency": 0}, {"dpi": (72, 72)}),
    "jpg": ({"progressive": True}, {"quality": 30}),
    "tif": ({"compression": "tiff_lzw"}, {"compression": "tiff_deflate"}, {"compression": "packbits"}),
    "gif": ({"interlace": 1}, {"save_all": True}),
    "webp": ({"lossless": True},),
    "tga": ({"compression": "tga_rle"},),
    "ico": ({"bitmap_format": "bmp"},),
    **dict.fromkeys(("bmp", "ppm", "jp2", "pcx", "sgi", "dds", "qoi"), ()),
}
"""Options of saving besides the defaults, by ending."""


def images() -> list[Seed]:
    """Return every mode of every format, saved with each of the options; EXIF rotations, an animation."""
    seeds = []
    for ending, variants in FORMATS.items():
        for mode, (number, options) in itertools.product(MODES, enumerate(({}, *variants))):
            with contextlib.suppress(Exception):  # not built in, or not of this mode
                data = saved(picture(mode), Image.registered_extensions()["." + ending], **options)
                seeds.append(Seed(f"{mode.replace(';', '')}-{number}.{ending}", data))
    for orientation in (3, 6, 8):
        exif = Image.Exif()
        exif[0x0112] = orientation
        seeds.append(Seed(f"rotated-{orientation}.jpg", saved(picture(), "JPEG", exif=exif)))
    animated = saved(picture(), "PNG", save_all=True, append_images=[picture().rotate(180)])
    return [*seeds, Seed("animated.png", animated)]


def svgs() -> list[Seed]:
    """Return each of ``SHAPES`` alone, mixtures of them, files written here, other heads."""
    seeds = [Seed(f"shape-{i}.svg", f"{HEAD}{shape}</svg>".encode()) for i, shape in enumerate(SHAPES)]
    for step in (2, 3, 5):
        seeds.append(Seed(f"every-{step}.svg", f"{HEAD}{''.join(SHAPES[::step])}</svg>".encode()))
    for kind in ("fill", "stroke"):
        seeds += [Seed(f"{kind}s.svg", own_svg(kind))] * 3
        seeds.append(Seed(f"{kind}s-fine.svg", own_svg(kind, 100)))
    seeds += [Seed("gradients.svg", gradient_svg()), Seed("layered.svg", layered_svg())] * 3
    seeds += [
        Seed(f"head-{i}.svg", f"{head}{''.join(SHAPES[: 3 * i + 2])}</svg>".encode())
        for i, head in enumerate(HEADS)
    ]
    return seeds


def own_svg(kind: str, per_pixel: float = 8) -> bytes:
    """Return an SVG written here, with curves of both bases; ``kind``: "fill" or "stroke"."""
    painted = Kind[kind.upper()]
    outlines = [(painted, basis, beziers) for beziers in (3, 9, 4) for basis in CURVES]
    scene = ragged_scene(outlines, WIDTH, HEIGHT, seed=1)
    return write_svg(scene, per_pixel=per_pixel, metadata="0123ABab").encode()


def gradient_svg() -> bytes:
    """Return one with gradients of every kind, and identifiers."""
    scene = random_scene(Kind.FILL, 8, width=WIDTH, height=HEIGHT, seed=2)
    return write_svg(with_gradients(scene), per_pixel=8, title="A <title>", ids=True).encode()


def layered_svg() -> bytes:
    """Return one of three levels in few colours."""
    scene = random_scene(Kind.FILL, 6, width=WIDTH, height=HEIGHT, seed=4)
    layers = np.array([0, 0, 1, 1, 2, 2], np.int32)
    return write_svg(replace(scene, layer=layers, colors=np.round(scene.colors)), per_pixel=4).encode()


def yamls() -> list[Seed]:
    """Return batch files."""
    return [Seed(f"batch-{i}.yaml", text.encode()) for i, text in enumerate(YAMLS)]
