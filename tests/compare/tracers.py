"""A tracer that needs no package."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
from PIL import Image

from warpsplat.compare.tracer import Tracer, TracerOptions

SIZES: dict[str, TracerOptions] = {"one": {"bands": 1}, "four": {"bands": 4}}


def bands(png: bytes, options: TracerOptions) -> str:
    """So many bands across the image, each of its mean colour."""
    image = Image.open(io.BytesIO(png))
    width, height = image.size
    count = int(options["bands"])
    paths = []
    for i, rows in enumerate(np.array_split(np.asarray(image, np.float64), count)):
        colour = "".join(f"{round(value):02x}" for value in rows.mean((0, 1)))
        top, bottom = (height * k / count for k in (i, i + 1))
        paths.append(f'<path d="M0 {top}H{width}V{bottom}H0z" fill="#{colour}"/>')
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">{"".join(paths)}</svg>'


def stub(
    trace: Callable[[bytes, TracerOptions], str] = bands, settings: dict[str, TracerOptions] = SIZES
) -> Tracer:
    return Tracer("Bands", "1.2", settings, trace)
