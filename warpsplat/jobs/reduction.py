"""A run on a smaller image than the one asked for, and a file of the size of that one all the same."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

from warpsplat.files.image import ImageFacts, boxed, load_rows
from warpsplat.files.sources import ImageSource
from warpsplat.fit.loop import Fit
from warpsplat.fit.settings import RANGES, Settings, solid_color
from warpsplat.jobs.memory import (
    factor_for,
    facts_of,
    mask_factor,
    memory_limit,
    need,
    whole_score,
)
from warpsplat.metrics import Rows, Score, score_svg
from warpsplat.rendering.room import in_words
from warpsplat.scene import FloatArray
from warpsplat.scene.geometry import enlarged
from warpsplat.svg.write import resized


@dataclass(frozen=True)
class Reduction:
    """What was worked on, and what is to be made of it."""

    factor: int
    """How many times smaller the image is that was worked on; a pixel of it stands for a square."""
    width: int
    """Of the file [px]."""
    height: int
    whole: Callable[[], Rows] | None
    """The image itself, where there is memory to measure the file against it."""
    why: str
    """What the image would take, and the limit, for people."""

    def enlarged(self, made: Fit) -> Fit:
        """A fit of the smaller image as one of the image itself."""
        scene = enlarged(made.scene, self.factor, self.width, self.height)
        return replace(made, scene=scene, per_pixel=made.per_pixel / self.factor)

    def settings(self, settings: Settings) -> Settings:
        """Those of the file: what is counted in pixels of the canvas grows as that does."""
        return replace(settings, softness=min(settings.softness * self.factor, RANGES["softness"][1]))

    def score(self, svg: str, target: FloatArray, stop: Callable[[], bool] | None) -> Score:
        """Of the file against the image itself, else against the smaller one (``target``)."""
        if self.whole:
            return score_svg(svg, self.whole(), own=True, eyes=False, stop=stop)
        # Of the pixels whose squares lie in the picture wholly.
        wide, tall = self.width // self.factor, self.height // self.factor
        small = resized(svg, wide, tall, 1 / self.factor)
        return score_svg(small, target[:tall, :wide], own=True, eyes=False, stop=stop).of_file(svg)

    def words(self) -> str:
        """What was done, for people."""
        small = f"{-(-self.width // self.factor)}x{-(-self.height // self.factor)}"
        return f"{self.why}: worked on at {small}, measured at {'full' if self.whole else 'that'} size"


@dataclass(frozen=True)
class Memory:
    """What is known of an image before it is read, and how small it has to be worked on."""

    facts: ImageFacts | None
    """None where nothing can be told: it is worked on as it is."""
    source: ImageSource
    mask: ImageFacts | None = None
    """Of the mask, if there is one."""

    @staticmethod
    def of(source: ImageSource, settings: Settings, importance: ImageSource | None = None) -> Memory:
        """``source`` and the mask: bytes of a file, a Pillow image or an array."""
        facts = facts_of(source)
        if facts:
            channels = {"none": 4, "auto": facts.channels}.get(settings.background, 3)
            facts = replace(facts, channels=channels)
        return Memory(facts, source, None if importance is None else facts_of(importance))

    def factor(self, name: str, settings: Settings, least: int = 1) -> int:
        """How many times smaller the image is to be worked on with ``settings``; from ``least`` on.

        Raises:
            ResourceError: there is too little memory at any size; the message names the image.
        """
        return factor_for(self.facts, settings, name, least, self.mask) if self.facts else 1

    def mask_factor(self, factor: int) -> int:
        """How many times smaller to read the mask of an image that is worked on ``factor`` times smaller."""
        return mask_factor(self.facts, self.mask, factor) if self.facts and self.mask else 1

    def smaller(
        self, target: FloatArray, name: str, settings: Settings, factor: int
    ) -> tuple[FloatArray, int]:
        """``target``, which was read ``factor`` times smaller, as ``settings`` ask for; and its factor."""
        wanted = self.factor(name, settings, factor)
        return (target if wanted == factor else boxed(target, wanted // factor)), wanted

    def reduction(self, factor: int, target: FloatArray, settings: Settings) -> Reduction | None:
        """What is to be made of a run on ``target``; None: nothing, as it has the image's own size."""
        facts, source, limit = self.facts, self.source, memory_limit(settings)
        if facts is None or factor == 1 or limit is None:
            return None
        paper, channels = solid_color(settings.background), target.shape[2]
        whole = None
        if isinstance(source, bytes) and not facts.deep and whole_score(facts, settings, factor) <= limit:
            whole = functools.partial(load_rows, source, paper, channels)
        given = "max-memory is" if settings.max_memory else "memory for it is"
        takes = in_words(need(facts, settings, mask=self.mask).most)
        why = f"{facts.width}x{facts.height} pixels take about {takes}, {given} {in_words(limit)}"
        return Reduction(factor, facts.width, facts.height, whole, why)
