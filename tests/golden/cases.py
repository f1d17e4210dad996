"""Golden cases: an image, and the arguments it is vectorized with."""

from __future__ import annotations

import hashlib
from typing import Any

import warpsplat
from tests.golden.pictures import PICTURES
from warpsplat.extensions import renderer_names

TURNED = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 64 48" width="64" height="48">
<defs><linearGradient id="g" gradientTransform="rotate(20)"><stop stop-color="#fa8"/>
<stop offset="1" stop-color="#a64"/></linearGradient></defs><rect width="64" height="48" fill="#1e3c78"/>
<ellipse cx="30" cy="25" rx="24" ry="15" transform="rotate(17 32 24)" fill="url(#g)"/>
<path d="M8 40A9 6 30 1 1 20 44L14 30Z" fill="#345" fill-opacity=".7"/>
<path d="M5 8Q30 2 58 9" fill="none" stroke="#fff" stroke-width="2" stroke-dasharray="5 2"/>
</svg>"""
"""An SVG to refine: arcs, rotations, a gradient and dashes."""

SHORT: dict[str, Any] = {"curves": 16, "iterations": 40}

ALL_CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "photo closed": ("photo", {**SHORT}),
    "photo closed, another seed": ("photo", {**SHORT, "seed": 7}),
    "photo closed, draft": ("photo", {**SHORT, "quality": "draft"}),
    "photo open": ("photo", {**SHORT, "open": True}),
    "photo mixed": ("sketch", {**SHORT, "subject": "photo", "mixed": True}),
    "photo layered": ("photo", {**SHORT, "layered": True}),
    "photo levels": ("photo", {"levels": "4,8,16", "iterations": 40}),
    "photo opaque": ("photo", {**SHORT, "opaque": True}),
    "photo colors": ("photo", {**SHORT, "colors": 5}),
    "photo palette": ("photo", {**SHORT, "palette": "#302018,#806040,#c0a080,#f0e8e0"}),
    "photo linear": ("photo", {**SHORT, "paint": "linear"}),
    "photo radial": ("photo", {**SHORT, "paint": "radial"}),
    "photo importance": ("photo", {**SHORT, "importance": "sketch"}),
    "photo splat": ("photo", {**SHORT, "renderer": "splat"}),
    "photo gaussian": ("photo", {**SHORT, "renderer": "gaussian"}),
    "photo target-psnr": ("photo", {"target_psnr": 22.0, "iterations": 40}),
    "photo max-bytes": ("photo", {"max_bytes": 900, "iterations": 40}),
    "photo minified": ("photo", {**SHORT, "minify": True, "precision": 2, "ids": True}),
    "transparent closed": ("transparent", {**SHORT}),
    "drawing": ("logo", {"subject": "drawing"}),
    "drawing, colors": ("logo", {"subject": "drawing", "colors": 3}),
    "drawing, max-bytes": ("logo", {"subject": "drawing", "max_bytes": 320}),
    "drawing, shaded": ("shaded", {"subject": "drawing"}),
    "drawing, transparent": ("transparent", {"subject": "drawing"}),
    "line": ("sketch", {"subject": "line"}),
    "line on a page": ("sketch", {"subject": "line", "page": "a5"}),
    "line, mixed": ("logo", {"subject": "line", "mixed": True}),
    "pixel": ("sprite", {"subject": "pixel"}),
    "photo auto paint": ("shaded", {**SHORT, "subject": "photo", "paint": "auto"}),
    "refined": ("shaded", {"svg": TURNED, "iterations": 40}),
    "auto, logo": ("logo", {}),
    "auto, sketch": ("sketch", {}),
    "auto, sprite": ("sprite", {}),
}
CASES = {
    name: (picture, given)
    for name, (picture, given) in ALL_CASES.items()
    if given.get("renderer", "exact") in renderer_names()
}
"""Those whose renderer is there."""


def text_of(name: str, threads: int | None = None, device: str = "cpu") -> str:
    """Return the SVG of a case."""
    picture, given = CASES[name]
    given = {"device": device, "threads": threads, **given}
    if "importance" in given:
        mask = PICTURES[given["importance"]]()
        height, width = PICTURES[picture]().shape[:2]
        given["importance"] = mask[:height, :width]
    if "svg" in given:
        return warpsplat.refine(given.pop("svg"), PICTURES[picture](), **given).svg
    return warpsplat.vectorize(PICTURES[picture](), **given).svg


def digest_of(svg: str) -> str:
    """Return the first 16 hexadecimal digits of the SHA-256 of an SVG's bytes."""
    return hashlib.sha256(svg.encode()).hexdigest()[:16]
