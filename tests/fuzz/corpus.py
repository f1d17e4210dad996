"""Valid inputs, from which mutation starts."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from PIL import Image

from tests.fuzz.vocabulary import HEAD, HEADS, HEIGHT, SHAPES, WIDTH, YAMLS
from tests.scenes import ragged_scene, random_scene, with_gradients
from warpsplat.scene import Basis, Kind
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
    if mode == "I;16":
        return Image.fromarray((x * 2000 + noise).astype(np.uint16))
    if mode == "I":
        return Image.fromarray((x * 2000 + noise).astype(np.int32))
    if mode == "F":
        return Image.fromarray((x / WIDTH).astype(np.float32))
    return image.convert(mode) if mode in ("LA", "RGBA") else image.convert("RGB").convert(mode)


FORMATS: dict[str, tuple[tuple[str, ...], tuple[dict[str, object], ...]]] = {
    "png": (("1", "L", "LA", "P", "RGB", "RGBA", "I;16", "I"), ({}, {"transparency": 0}, {"dpi": (72, 72)})),
    "jpg": (("L", "RGB", "CMYK", "YCbCr"), ({}, {"progressive": True}, {"quality": 30})),
    "tif": (("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "LAB", "YCbCr", "I", "I;16", "F"),
            ({}, {"compression": "tiff_lzw"}, {"compression": "tiff_deflate"}, {"compression": "packbits"})),
    "gif": (("L", "P", "RGB", "RGBA"), ({}, {"interlace": 1}, {"save_all": True, "append_images": []})),
    "bmp": (("1", "L", "P", "RGB", "RGBA"), ({},)),
    "webp": (("RGB", "RGBA"), ({}, {"lossless": True})),
    "ppm": (("1", "L", "RGB", "I;16", "F"), ({},)),
    "tga": (("1", "L", "LA", "P", "RGB", "RGBA"), ({}, {"compression": "tga_rle"})),
    "ico": (("RGBA",), ({}, {"bitmap_format": "bmp"})),
    "jp2": (("L", "RGB", "RGBA"), ({},)),
    "pcx": (("1", "L", "P", "RGB"), ({},)),
    "sgi": (("L", "RGB", "RGBA"), ({},)),
    "dds": (("L", "RGB", "RGBA"), ({},)),
    "qoi": (("RGB", "RGBA"), ({},)),
}  # fmt: skip
"""Modes and options of saving, by ending."""


def images() -> list[Seed]:
    """Return every mode of every format, saved in several ways; EXIF rotations, an animation."""
    seeds = []
    for ending, (modes, ways) in FORMATS.items():
        for mode in modes:
            for number, options in enumerate(ways):
                given = dict(options)
                if "append_images" in given:
                    given["append_images"] = [picture(mode).rotate(180)]
                if ending == "png" and "transparency" in given and mode in ("LA", "RGBA", "I", "P"):
                    continue
                if given.get("transparency") == 0 and mode == "RGB":
                    given["transparency"] = (0, 0, 16)
                try:
                    data = saved(picture(mode), Image.registered_extensions()["." + ending], **given)
                except (OSError, KeyError, ValueError, RuntimeError):  # not built in, or not of this mode
                    continue
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
        seeds += [Seed(f"{kind}s-fine.svg", own_svg(kind, 100)), Seed(f"{kind}s-old.svg", older_svg(kind))]
    seeds += [Seed("gradients.svg", gradient_svg()), Seed("layered.svg", layered_svg())] * 3
    seeds += [
        Seed(f"head-{i}.svg", f"{head}{''.join(SHAPES[: 3 * i + 2])}</svg>".encode())
        for i, head in enumerate(HEADS)
    ]
    return seeds


def own_svg(kind: str, per_pixel: float = 8) -> bytes:
    """Return an SVG written here, with curves of both bases; ``kind``: "fill" or "stroke"."""
    painted = Kind[kind.upper()]
    outlines = [(painted, basis, beziers) for beziers in (3, 9, 4) for basis in Basis]
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


def older_svg(kind: str) -> bytes:
    """Return an SVG as the first version wrote it: coordinates with decimals, closed paths."""
    rng = np.random.default_rng(1)
    rows = []
    for _ in range(6):
        x, y = rng.integers(2, 28), rng.integers(2, 20)
        color = f"#{int(rng.integers(0, 1 << 24)):06x}"
        outline = f"M{x} {y}c3.1-2.4 8.2 1.5 6 5.2"
        if kind == "fill":
            rows.append(f'<path d="{outline}-2.6 4.1-9.1 1.2-6-5.2z" fill="{color}" fill-opacity=".8"/>')
        else:
            rows.append(f'<path d="{outline}" stroke="{color}" stroke-width="2.3"/>')
    around = '<g fill="none" stroke-linecap="round" stroke-linejoin="round">' if kind == "stroke" else "<g>"
    return "\n".join(
        (HEAD, "<metadata>warpsplat 0.1.0 key=0123456789abcdef01234567</metadata>",
         f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#946f57"/>', around, *rows, "</g>", "</svg>\n")
    ).encode()  # fmt: skip


def yamls() -> list[Seed]:
    """Return batch files."""
    return [Seed(f"batch-{i}.yaml", text.encode()) for i, text in enumerate(YAMLS)]
