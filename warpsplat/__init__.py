"""warpsplat: raster image in, SVG of Bézier shapes out, by gradient descent.

The calls that matter::

    result = warpsplat.vectorize("photo.jpg", 256)            # an image to an SVG: result.save("photo.svg")
    result = warpsplat.refine("drawing.svg", "photo.jpg")     # an SVG made more like an image
    scene = warpsplat.load_svg("drawing.svg")                 # its shapes as arrays; save_svg writes them
    image = warpsplat.render(scene, 800)                      # a scene or an SVG as pixels, 800 px wide
    print(warpsplat.score("photo.svg", "photo.jpg").psnr)     # how well an SVG shows an image

``help(warpsplat.vectorize)`` and so on say more; gradients for PyTorch are in ``warpsplat.torch``.

What this module offers is the public interface, together with ``warpsplat.errors``, ``warpsplat.scene``,
``warpsplat.torch`` and ``warpsplat.pydiffvg``; it keeps to semantic versioning. All else may change.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from warpsplat._version import __version__ as __version__
from warpsplat.extensions import declared

if TYPE_CHECKING:
    from warpsplat.batch.presets import load_preset as load_preset
    from warpsplat.errors import DeviceError as DeviceError
    from warpsplat.errors import ImageError as ImageError
    from warpsplat.errors import OutputError as OutputError
    from warpsplat.errors import ResourceError as ResourceError
    from warpsplat.errors import UsageError as UsageError
    from warpsplat.errors import WarpsplatError as WarpsplatError
    from warpsplat.fit.custom_loss import CustomLoss as CustomLoss
    from warpsplat.fit.progress import Progress as Progress
    from warpsplat.fit.progress import Snapshot as Snapshot
    from warpsplat.fit.settings import Settings as Settings
    from warpsplat.fit.settings import make_settings as make_settings
    from warpsplat.metrics import Score as Score
    from warpsplat.motion.notebook import Live as Live
    from warpsplat.motion.recorder import Recorder as Recorder
    from warpsplat.pages.report import report as report
    from warpsplat.run.prepare import load_image as load_image
    from warpsplat.run.prepare import starting_scene as starting_scene
    from warpsplat.run.refine import refine as refine
    from warpsplat.run.render import render as render
    from warpsplat.run.render import to_pillow as to_pillow
    from warpsplat.run.result import Result as Result
    from warpsplat.run.several import vectorize_several as vectorize_several
    from warpsplat.run.suggest import Expected as Expected
    from warpsplat.run.suggest import Suggestion as Suggestion
    from warpsplat.run.suggest import suggest as suggest
    from warpsplat.run.svg import load_svg as load_svg
    from warpsplat.run.svg import save_svg as save_svg
    from warpsplat.run.svg import score as score
    from warpsplat.run.vectorize import vectorize as vectorize
    from warpsplat.scene import Canvas as Canvas
    from warpsplat.scene import Scene as Scene

_HOMES = {
    "vectorize": "warpsplat.run.vectorize",
    "vectorize_several": "warpsplat.run.several",
    "suggest": "warpsplat.run.suggest",
    "refine": "warpsplat.run.refine",
    "render": "warpsplat.run.render",
    **dict.fromkeys(("load_image", "starting_scene"), "warpsplat.run.prepare"),
    **dict.fromkeys(("load_svg", "save_svg", "score"), "warpsplat.run.svg"),
    **dict.fromkeys(
        ("WarpsplatError", "DeviceError", "ImageError", "OutputError", "ResourceError", "UsageError"),
        "warpsplat.errors",
    ),
    **dict.fromkeys(("Settings", "make_settings"), "warpsplat.fit.settings"),
    **dict.fromkeys(("Canvas", "Scene"), "warpsplat.scene"),
    **dict.fromkeys(("Progress", "Snapshot"), "warpsplat.fit.progress"),
    "CustomLoss": "warpsplat.fit.custom_loss",
    "to_pillow": "warpsplat.run.render",
    "Result": "warpsplat.run.result",
    "Score": "warpsplat.metrics",
    **dict.fromkeys(("Expected", "Suggestion"), "warpsplat.run.suggest"),
    **declared("api"),
}
"""Where each name comes from, those of extensions included. They are imported when they are asked for: the
command line starts light."""

__all__ = ["__version__", *sorted(_HOMES)]  # noqa: PLE0604 - all are strings


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
