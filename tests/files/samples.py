"""Image files, good and bad."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
from PIL import Image

from warpsplat.files.sources import image_of

load_image = functools.partial(image_of, paper=1.0)
"""Read an image on white."""

RNG = np.random.default_rng(0)
RGB = RNG.integers(0, 256, (20, 33, 3), dtype=np.uint8)


def save(folder: Path, image: Image.Image, name: str, **options: object) -> Path:
    path = folder / name
    image.save(path, **options)
    return path


def bad_files(folder: Path) -> dict[str, Path]:
    whole = save(folder, Image.fromarray(RGB), "whole.png").read_bytes()
    jpeg = save(folder, Image.fromarray(np.tile(RGB, (4, 4, 1))), "whole.jpg").read_bytes()
    contents = {
        "empty.png": b"",
        "text.png": b"hello, I am text\n" * 10,
        "truncated.png": whole[: len(whole) // 2],
        "truncated.jpg": jpeg[: len(jpeg) // 2],
        "corrupt.png": whole[:60] + b"\x00" * 40 + whole[100:],
    }
    files = {}
    for name, data in contents.items():
        files[name] = folder / name
        files[name].write_bytes(data)
    files["one.png"] = save(folder, Image.new("RGB", (1, 1)), "one.png")
    files["missing.png"] = folder / "missing.png"
    files["folder.png"] = folder / "folder.png"
    files["folder.png"].mkdir()
    return files
