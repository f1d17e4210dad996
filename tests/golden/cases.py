"""Golden cases: an image, and the arguments it is vectorized with."""

from __future__ import annotations

import hashlib
from typing import Any

import warpsplat
from tests.golden.pictures import PICTURES

SHORT: dict[str, Any] = {"curves": 16, "iterations": 60}

CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "photo closed": ("photo", {**SHORT}),
    "photo closed, another seed": ("photo", {**SHORT, "seed": 7}),
    "photo closed, draft": ("photo", {**SHORT, "quality": "draft"}),
    "photo closed, high": ("photo", {**SHORT, "quality": "high"}),
    "photo open": ("photo", {**SHORT, "open": True}),
    "photo mixed": ("sketch", {**SHORT, "subject": "photo", "mixed": True}),
    "photo layered": ("photo", {**SHORT, "layered": True}),
    "photo levels": ("photo", {"levels": "4,8,16", "iterations": 60}),
    "photo opaque": ("photo", {**SHORT, "opaque": True}),
    "photo colors": ("photo", {**SHORT, "colors": 5}),
    "photo palette": ("photo", {**SHORT, "palette": "#302018,#806040,#c0a080,#f0e8e0"}),
    "photo linear": ("photo", {**SHORT, "paint": "linear"}),
    "photo radial": ("photo", {**SHORT, "paint": "radial"}),
    "photo auto paint": ("photo", {**SHORT, "paint": "auto"}),
    "photo importance": ("photo", {**SHORT, "importance": "sketch"}),
    "photo splat": ("photo", {**SHORT, "renderer": "splat"}),
    "photo gaussian": ("photo", {**SHORT, "renderer": "gaussian"}),
    "photo target-psnr": ("photo", {"target_psnr": 22.0, "iterations": 60}),
    "photo max-bytes": ("photo", {"max_bytes": 900, "iterations": 60}),
    "photo minified": ("photo", {**SHORT, "minify": True, "precision": 2, "ids": True}),
    "transparent closed": ("transparent", {**SHORT}),
    "drawing": ("logo", {"subject": "drawing"}),
    "drawing, draft": ("logo", {"subject": "drawing", "quality": "draft"}),
    "drawing, colors": ("logo", {"subject": "drawing", "colors": 3}),
    "drawing, max-bytes": ("logo", {"subject": "drawing", "max_bytes": 320}),
    "drawing, shaded": ("shaded", {"subject": "drawing"}),
    "drawing, transparent": ("transparent", {"subject": "drawing"}),
    "line": ("sketch", {"subject": "line"}),
    "line on a page": ("sketch", {"subject": "line", "page": "a5"}),
    "line, mixed": ("sketch", {"subject": "line", "mixed": True}),
    "pixel": ("sprite", {"subject": "pixel"}),
    "photo of a drawing": ("logo", {**SHORT, "subject": "photo", "paint": "auto"}),
    "auto, logo": ("logo", {}),
    "auto, sketch": ("sketch", {}),
    "auto, sprite": ("sprite", {}),
}


def text_of(name: str, threads: int | None = None) -> str:
    """The SVG of a case."""
    picture, given = CASES[name]
    given = {"device": "cpu", "threads": threads, **given}
    if "importance" in given:
        mask = PICTURES[given["importance"]]()
        height, width = PICTURES[picture]().shape[:2]
        given["importance"] = mask[:height, :width]
    return warpsplat.vectorize(PICTURES[picture](), **given).svg


def digest_of(svg: str) -> str:
    """The first 16 hexadecimal digits of the SHA-256 of an SVG's bytes."""
    return hashlib.sha256(svg.encode()).hexdigest()[:16]
