"""How an image was made of a drawing that is sharper than it, and how much of the image that explains."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from warpsplat.drawing.illumination import evened, relative
from warpsplat.drawing.optics import SCALE, Seen
from warpsplat.fit.export import finished, shown_image
from warpsplat.fit.optics import RADIUS, RINGS, Illumination
from warpsplat.fit.problem import Fit, Problem
from warpsplat.portable.elementary import log10
from warpsplat.scene import FloatArray


@dataclass(frozen=True)
class Explained:
    """How an image was made of a drawing."""

    psnr: float
    """PSNR of the drawing, seen through what made the image of it, against the image [dB]."""
    light: str
    """In which colours were mixed: ``sRGB`` or ``linear``."""
    kernel: tuple[tuple[float, ...], ...]
    """Weights of samples at 1/4, 3/4, ... 9/4 px from the middle of a pixel, down and across: a quarter of a
    symmetric kernel, whose weights add up to 1."""

    illumination: Illumination | None = None
    """Coefficients of the light on paper for each channel, as in ``Optics``; None: it is even."""

    def words(self) -> str:
        """Return a sentence for people."""
        middle, hows = 4 * self.kernel[0][0], list[str]()
        if self.light == "linear":
            hows.append("mixed in linear light")
        elif middle != 1 or not self.illumination:
            hows.append("sharpened" if middle > 1 else "blurred")
        if self.illumination:
            hows.append("unevenly lit")
        return (
            f"the image looks {' and '.join(hows)}, and is drawn as it was before; treated the same way, the "
            f"file matches it to {self.psnr:.1f} dB (optics 'none' draws the image as it is)"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self) | {"psnr": round(self.psnr, 3)}


def explained(made: Fit, problem: Problem) -> Explained:
    """Return how the image of a problem was made of a drawing."""
    target, illumination = problem.target, made.optics.illumination if made.optics else None
    lit = evened(target, illumination) if illumination else target
    seen = Seen.of(lit, known=made.optics)
    images = [
        shown_image(finished(scene, problem.settings, made.per_pixel / SCALE), scene, target.shape[2])
        for scene in seen.scenes(made.scene)
    ]
    found = seen.find(*images)
    weights = dict(zip(RINGS, found.kernel, strict=True))
    kernel = tuple(
        tuple(round(weights[max(y, x), min(y, x)], 5) for x in range(RADIUS)) for y in range(RADIUS)
    )
    light = "linear" if seen.edges.is_linear else "sRGB"
    if illumination:
        found = replace(found, shown=found.shown * relative(illumination, target))
    return Explained(psnr_of(found.shown, target), light, kernel, illumination)


def psnr_of(shown: FloatArray, target: FloatArray) -> float:
    """Return the PSNR of an image [dB]; of one with opacity, as on black."""
    return -10 * float(log10(max(float(np.square(shown - target)[..., :3].mean()), 1e-10)))
