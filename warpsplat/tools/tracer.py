"""Programs to compare with: how to call each, and with which settings."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from warpsplat.errors import UsageError
from warpsplat.native import messages_hidden

Options = Mapping[str, str | int | float]
"""Arguments of a tracer, by its own names."""


@dataclass(frozen=True)
class Tracer:
    """Another program that makes an SVG of an image."""

    name: str
    version: str
    settings: Mapping[str, Options]
    """Options by the name that tables and files give them."""
    trace: Callable[[bytes, Options], str]
    """PNG, options -> SVG. May raise anything."""


POLYGON: Options = {"mode": "polygon", "path_precision": 0}
"""Straight lines between whole pixels: for VTracer the same PSNR in a seventh of the bytes."""

VTRACER_SETTINGS: dict[str, Options] = {
    "default": {},
    "rounded": {"path_precision": 1},
    "smooth": {"path_precision": 1, "length_threshold": 10},
    "coarse": {**POLYGON, "color_precision": 8, "layer_difference": 64, "filter_speckle": 16},
    "medium": {**POLYGON, "color_precision": 8, "layer_difference": 32, "filter_speckle": 16},
    "polygon": POLYGON,
    "fine": {**POLYGON, "color_precision": 8, "layer_difference": 8, "filter_speckle": 2},
    "pixel": {"mode": "none", "path_precision": 0},
}
"""Of VTracer: the defaults, and what is best for its size or its figures out of forty that were tried on
photographs, drawings and logos (docs/comparison.md)."""


def require(module: str) -> Any:
    """Import an optional dependency, of the extra ``compare``.

    Raises:
        UsageError: it is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        hint = f"pip install {name}, or warpsplat with its extra: '.[compare]'"
        raise UsageError(f"compare needs {name}, which is not installed: {hint}") from error


def vtracer() -> Tracer:
    """Return VTracer (visioncortex), by its Python package.

    Raises:
        UsageError: the package is not installed.
    """
    package = require("vtracer")

    def trace(png: bytes, options: Options) -> str:
        with messages_hidden():  # where it panics, Rust prints a trace of its own
            return str(package.convert_raw_image_to_svg(png, img_format="png", **options))

    return Tracer("VTracer", metadata.version("vtracer"), VTRACER_SETTINGS, trace)


TRACERS: dict[str, Callable[[], Tracer]] = {"vtracer": vtracer}
"""By the name on the command line."""
