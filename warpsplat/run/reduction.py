"""Work on a reduced image, to stay below a limit of memory; the file has the size of the image itself."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

from warpsplat.files.image import ImageFacts, boxed, load_rows
from warpsplat.files.sources import ImageSource
from warpsplat.fit.loop import Fit
from warpsplat.fit.options import limits_of
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.metrics import Rows, Score, score_svg
from warpsplat.rendering.memory import in_words
from warpsplat.run.memory import (
    factor_for,
    facts_of,
    limit_words,
    mask_factor,
    memory_limit,
    need,
    whole_score,
)
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
            return score_svg(svg, self.whole(), own=True, perceptual=False, stop=stop)
        # Only pixels whose squares lie within the image.
        wide, tall = self.width // self.factor, self.height // self.factor
        small = resized(svg, wide, tall, 1 / self.factor)
        return score_svg(small, target[:tall, :wide], own=True, perceptual=False, stop=stop).of_file(svg)

    def words(self) -> str:
        """Return a message about the reduction."""
        small = f"{-(-self.width // self.factor)}x{-(-self.height // self.factor)}"
        return f"{self.why}: processed at {small}, measured at {'full' if self.whole else 'that'} size"


@dataclass(frozen=True)
class Memory:
    """Facts of an image before it is read, and how much it has to be reduced."""

    facts: ImageFacts | None
    """None if they are unknown: then the image is not reduced."""
    source: ImageSource
    mask: ImageFacts | None = None
    """Facts of the mask, if there is one."""

    @staticmethod
    def of(source: ImageSource, settings: Settings, importance: ImageSource | None = None) -> Memory:
        """Inspect ``source`` and the mask: bytes of a file, a Pillow image or an array."""
        facts = facts_of(source)
        if facts:
            channels = {"none": 4, "auto": facts.channels}.get(settings.background, 3)
            facts = replace(facts, channels=channels)
        return Memory(facts, source, None if importance is None else facts_of(importance))

    def factor(self, name: str, settings: Settings, least: int = 1) -> int:
        """Return how many times the image has to be reduced with ``settings``; at least ``least``.

        Raises:
            ResourceError: there is too little memory at any size; the message begins with ``name``.
        """
        return factor_for(self.facts, settings, name, least, self.mask) if self.facts else 1

    def mask_factor(self, factor: int) -> int:
        """Return how many times smaller to read the mask of an image that is reduced ``factor`` times."""
        return mask_factor(self.facts, self.mask, factor) if self.facts and self.mask else 1

    def smaller(
        self, target: FloatArray, name: str, settings: Settings, factor: int
    ) -> tuple[FloatArray, int]:
        """Reduce ``target``, read ``factor`` times smaller, further if need be; return its factor too."""
        wanted = self.factor(name, settings, factor)
        return (target if wanted == factor else boxed(target, wanted // factor)), wanted

    def reduction(self, factor: int, target: FloatArray, settings: Settings) -> Reduction | None:
        """Return the reduction to ``target``; None if that has the image's own size."""
        facts, source, limit = self.facts, self.source, memory_limit(settings)
        if facts is None or factor == 1 or limit is None:
            return None
        paper, channels = solid_color(settings.background), target.shape[2]
        whole = None
        if isinstance(source, bytes) and not facts.deep and whole_score(facts, settings, factor) <= limit:
            whole = functools.partial(load_rows, source, paper, channels)
        takes = in_words(need(facts, settings, mask=self.mask).most)
        why = f"{facts.width}x{facts.height} pixels take about {takes}, {limit_words(settings, limit)}"
        return Reduction(factor, facts.width, facts.height, whole, why)
