"""Work on a reduced image, to stay below a limit of memory; the file has the size of the image itself."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

from warpsplat.files.image import ImageFacts, load_rows
from warpsplat.files.sources import ImageSource
from warpsplat.fit.loop import Fit
from warpsplat.fit.options import limits_of
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.metrics import Rows, Score, score_svg
from warpsplat.rendering.memory import in_words
from warpsplat.run.memory import limit_words, memory_limit, need, whole_score
from warpsplat.scene import FloatArray
from warpsplat.scene.geometry import enlarged
from warpsplat.svg.write import resized


@dataclass(frozen=True)
class Reduction:
    """The reduction of an image, and how results are brought to its own size."""

    factor: int
    """How many times smaller the reduced image is; its pixels are means of squares."""
    width: int
    """Width of the file [px]."""
    height: int
    """Height of the file [px]."""
    whole: Callable[[], Rows] | None
    """Reads the image itself, if there is memory to measure the file against it."""
    why: str
    """Memory that the image would take, and the limit, for people."""

    def enlarged(self, made: Fit) -> Fit:
        """Return a fit to the reduced image as one to the image itself."""
        scene = enlarged(made.scene, self.factor, self.width, self.height)
        return replace(made, scene=scene, per_pixel=made.per_pixel / self.factor)

    def settings(self, settings: Settings) -> Settings:
        """Return the settings of the file: what is counted in pixels of the canvas grows with it."""
        most = limits_of(Settings, "softness")[1]
        return replace(settings, softness=min(settings.softness * self.factor, most))

    def score(self, svg: str, target: FloatArray, stop: Callable[[], bool] | None) -> Score:
        """Score the file against the image itself, else against the reduced one (``target``)."""
        if self.whole:
            return score_svg(svg, self.whole(), own=True, eyes=False, stop=stop)
        # Only pixels whose squares lie within the image.
        wide, tall = self.width // self.factor, self.height // self.factor
        small = resized(svg, wide, tall, 1 / self.factor)
        return score_svg(small, target[:tall, :wide], own=True, eyes=False, stop=stop).of_file(svg)

    def words(self) -> str:
        """Return a message about the reduction."""
        small = f"{-(-self.width // self.factor)}x{-(-self.height // self.factor)}"
        return f"{self.why}: processed at {small}, measured at {'full' if self.whole else 'that'} size"


def reduction_for(
    source: ImageSource,
    facts: ImageFacts | None,
    mask: ImageFacts | None,
    target: FloatArray,
    settings: Settings,
    factor: int,
) -> Reduction | None:
    """Return the reduction of ``source`` to ``target``; None if that has the image's own size."""
    limit = memory_limit(settings)
    if facts is None or factor == 1 or limit is None:
        return None
    whole = None
    if isinstance(source, bytes) and not facts.deep and whole_score(facts, settings, factor) <= limit:
        paper = solid_color(settings.background)
        whole = functools.partial(load_rows, source, paper, target.shape[2])
    takes = in_words(need(facts, settings, mask=mask))
    why = f"{facts.width}x{facts.height} pixels take about {takes}, {limit_words(settings, limit)}"
    return Reduction(factor, facts.width, facts.height, whole, why)
