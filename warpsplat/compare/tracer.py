"""Other programs for comparison: how to call them, and with which settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata

from warpsplat.errors import UsageError
from warpsplat.native import messages_hidden

TracerOptions = Mapping[str, str | int | float]
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
"""Straight lines between whole pixels: the same PSNR as splines, in a seventh of the bytes."""

VTRACER_SETTINGS: dict[str, TracerOptions] = {
    "default": {},
    "rounded": {"path_precision": 1},
    "smooth": {"path_precision": 1, "length_threshold": 10},
    "coarse": {**POLYGON, "color_precision": 8, "layer_difference": 64, "filter_speckle": 16},
    "medium": {**POLYGON, "color_precision": 8, "layer_difference": 32, "filter_speckle": 16},
    "polygon": POLYGON,
    "fine": {**POLYGON, "color_precision": 8, "layer_difference": 8, "filter_speckle": 2},
    "pixel": {"mode": "none", "path_precision": 0},
}
"""The defaults, and the best for their size of forty combinations that were tried on photographs, drawings
and logos (docs/comparison.md)."""


def vtracer() -> Tracer:
    """Return VTracer (visioncortex), by its Python package.

    Raises:
        UsageError: it is not installed; the message says how to install it.
    """
    try:
        import vtracer as package
    except ImportError as error:
        raise UsageError("compare needs vtracer, which is not installed: pip install vtracer") from error

    def trace(png: bytes, options: TracerOptions) -> str:
        with messages_hidden():  # a Rust panic prints a trace
            return str(package.convert_raw_image_to_svg(png, img_format="png", **options))

    return Tracer("VTracer", metadata.version("vtracer"), VTRACER_SETTINGS, trace)


TRACERS: dict[str, Callable[[], Tracer]] = {"vtracer": vtracer}
"""By the name on the command line."""
