"""Other programs for comparison: how to call them, and with which settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from warpsplat.errors import UsageError
from warpsplat.native import messages_hidden

TracerOptions = Mapping[str, Any]
"""Arguments of a tracer, by its own names."""


@dataclass(frozen=True)
class Tracer:
    """Another program that makes an SVG of an image."""

    name: str
    version: str
    settings: Mapping[str, TracerOptions]
    """Options by the name that tables and files use for them."""
    trace: Callable[[bytes, TracerOptions], str]
    """PNG, options -> SVG. May raise anything."""


POLYGON: TracerOptions = {"mode": "polygon", "path_precision": 0}
"""Straight lines between whole pixels: the same PSNR as splines, in a third of the bytes."""

VTRACER_SETTINGS: dict[str, TracerOptions] = {
    "default": {},
    "mosaic": {"hierarchical": "cutout"},
    "photo": {"color_precision": 8, "corner_threshold": 180, "filter_speckle": 10, "layer_difference": 48},
    "coarse": {**POLYGON, "color_precision": 8, "layer_difference": 64, "filter_speckle": 16},
    "polygon": POLYGON,
    "fine": {**POLYGON, "color_precision": 8, "layer_difference": 8, "filter_speckle": 2},
    "pixel": {"mode": "pixel", "path_precision": 0},
}
"""The defaults, shapes beside each other instead of on each other, VTracer's own preset for photographs, and
the best for their size of forty combinations that were tried on photographs, drawings and logos
(docs/comparison.md)."""

INSTALL = "pip install 'vtracer>=1.0.0a4'"


def vtracer() -> Tracer:
    """Return VTracer (visioncortex), by its Python package; raise ``UsageError`` unless that is installed."""
    try:
        import vtracer as package
    except ImportError as error:
        raise UsageError(f"compare needs vtracer, which is not installed: {INSTALL}") from error
    version = metadata.version("vtracer")
    if not hasattr(package, "Config"):
        raise UsageError(f"compare needs vtracer 1.0, but {version} is installed: {INSTALL}")

    def trace(png: bytes, options: TracerOptions) -> str:
        with messages_hidden():  # a Rust panic prints a trace
            return str(package.convert_bytes(png, package.Config(**options), "png"))

    return Tracer("VTracer", version, VTRACER_SETTINGS, trace)


TRACERS: dict[str, Callable[[], Tracer]] = {"vtracer": vtracer}
"""By the name on the command line."""
