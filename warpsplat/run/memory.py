"""Estimate the memory of a run, and reduce its image to stay below a limit; the file has the image's size.

The constants are measured upper bounds (docs/benchmarks.md). The peak of a run is that of its parts, each
beside the image: reading it, fitting or tracing, and measuring the file.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from PIL import Image

from warpsplat.drawing.trace.grids import dilated, uneven_pixels
from warpsplat.drawing.trace.seeds import EDGE
from warpsplat.errors import ImageError, ResourceError
from warpsplat.files.image import ImageFacts, image_facts, load_rows
from warpsplat.files.resolution import resolution_of
from warpsplat.files.sources import ImageSource, image_of
from warpsplat.fit.options import limits_of
from warpsplat.fit.problem import Fit
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.metrics import Rows, Score, score_svg
from warpsplat.native import STRIP_PIXELS, machine_memory
from warpsplat.rendering.memory import SHARE, in_words
from warpsplat.scene import FloatArray, Kind
from warpsplat.scene.geometry import enlarged
from warpsplat.svg.viewer import WHOLE_PIXELS
from warpsplat.svg.write import resized

if TYPE_CHECKING:
    import warp as wp

PROGRAM = 280 << 20
"""Bytes of Python, the libraries and compiled kernels."""

STRIPS = 96 << 20
"""Bytes of work that is done strip by strip."""

FILE_STRIPS = 96 << 20
"""Bytes of the strips of a file that are drawn side by side."""

SLOTS_A_TILE, SLOTS_BETWEEN, SLOTS_A_SHAPE = 4.0, 9.0, 2.0
"""Slots of a fit per tile, per root of tiles times shapes, and per shape."""

SHAPE = 24 << 10
"""Bytes per shape: its samples, densification, its text."""

TRACED = {"drawing": 120, "line": 420, "silhouette": 420, "pixel": 260}
"""Bytes per pixel of tracing, by subject."""

DRAWN_EDGE = 1000
"""Bytes per pixel near an edge that tracing a drawing takes besides, and as many that fitting it does."""

DRAWN = 128 << 20
"""Bytes of fitting any drawing."""

LANES = 1 << 10
"""Bytes per slot that a GPU adds, twice with gradients: those of colours, by lane."""

ON_GPU = 32 << 20
"""Bytes that a run takes on a GPU however small its image is: for sorting, and a surplus of shapes."""

MASK_READ, MASK = 12, 4
"""Bytes per pixel of a mask: while it is read, and afterwards."""

FILE_PICTURE, HALVES, HALVES_ODD, UNCUT = 4, 6, 14, 12
"""Bytes per pixel of measuring a file: its picture, both images at half size, the same if a side is odd, and
what a file adds that is not drawn in strips."""

SSIMULACRA2 = 200
"""Bytes per pixel of measuring SSIMULACRA2."""

CLEARED = 150
"""Bytes per pixel of finding pixels that should be empty (``fit.clear``), where an SVG is refined against an
image with opacity."""

LEAST_REDUCED_SIDE = 32
"""Least side of a reduced image [px]."""

processes = 1
"""Number of processes that share this machine's memory; workers of batches set it."""


def near_edges(image: FloatArray) -> int:
    """Return the number of pixels of an image, sRGB in [0, 1], near steps of colour that are edges."""
    rows = max(STRIP_PIXELS // image.shape[1], 1)
    strips = (image[first : first + rows] for first in range(0, len(image), rows))
    return sum(int(dilated(uneven_pixels(strip, EDGE / 255), 5).sum()) for strip in strips)


def _fitting(facts: ImageFacts, settings: Settings, factor: int, lanes: int = 0) -> float:
    """Return the bytes of the finest phase, which is the largest; the surplus of shapes is gone by then.

    ``lanes``: bytes per slot that the device's division of tiles adds.
    """
    phase = phases(settings, -(-facts.width // factor), -(-facts.height // factor))[-1]
    pixels, curves = phase.width * phase.height, settings.curves
    tiles = pixels / 256
    slots = SLOTS_A_TILE * tiles + SLOTS_BETWEEN * math.sqrt(tiles * curves) + SLOTS_A_SHAPE * curves
    slot = 1500 + lanes  # bytes per slot (rendering.renderer), and what strokes and gradients add
    slot += 1100 if settings.kind == Kind.STROKE or settings.mixed else 0
    slot += 4200 + lanes if settings.painting != "flat" else 0
    levels = len(settings.levels) or 1
    # Bytes per pixel of the finest size: target, render, gradient, weights, error maps, the file's render.
    trained = 160
    return levels * 1.5 * slots * slot + trained * pixels + SHAPE * curves


def _scoring(facts: ImageFacts, settings: Settings, pixels: float) -> float:
    """Return the bytes of measuring a picture of so many ``pixels``, without the image itself."""
    if pixels <= WHOLE_PIXELS:
        per_pixel: float = FILE_PICTURE + 16
    else:
        odd = facts.width % 2 or facts.height % 2
        per_pixel = FILE_PICTURE + (HALVES_ODD if odd else HALVES) + (UNCUT if settings.minify else 0)
    strips = STRIPS if pixels <= WHOLE_PIXELS else STRIPS + FILE_STRIPS
    return strips + per_pixel * pixels


def whole_score(facts: ImageFacts, settings: Settings, factor: int) -> int:
    """Return the bytes of measuring a file at the image's own size after a run on a reduced one."""
    pixels = facts.width * facts.height
    held = 4 * facts.channels * pixels / factor**2 + (facts.decoded + facts.kept) * pixels
    return round(PROGRAM + held + _scoring(facts, settings, pixels))


def facts_of(source: ImageSource, name: str, background: str = "auto") -> ImageFacts:
    """Return the facts of an image file's bytes, a Pillow image or an array; errors are as of ``image_of``.

    ``background``: as in the settings, which decides whether the image has opacity.
    """
    facts = None
    if isinstance(source, bytes):
        facts = image_facts(source)
    elif isinstance(source, np.ndarray) and source.ndim in {2, 3}:
        channels = 4 if source.ndim == 3 and source.shape[2] in {2, 4} else 3
        facts = ImageFacts(source.shape[1], source.shape[0], channels, 12, drafts=False)
    elif isinstance(source, Image.Image):
        stated = resolution_of(source)
        facts = ImageFacts(source.width, source.height, 4, 4, drafts=False, resolution=stated)
    if facts is None:
        image_of(source, name)  # which says what is wrong with it
        raise ImageError(f"{name}: not an image")
    return facts if background == "auto" else replace(facts, channels=4 if background == "none" else 3)


def memory_limit(settings: Settings) -> int | None:
    """Return the bytes that a run may take: by the settings, or by the machine and its processes."""
    if settings.max_memory:
        return settings.max_memory
    found = machine_memory()
    return None if found is None else round(SHARE * found / processes)


@dataclass(frozen=True)
class DeviceMemory:
    """Memory of a GPU that a run may take."""

    name: str
    limit: int

    @staticmethod
    def of(device: wp.Device) -> DeviceMemory | None:
        """Return what is free now; None for a CPU, whose memory is the machine's."""
        if device.is_cpu:
            return None
        import warp as wp

        wp.synchronize_device(device)  # or what earlier runs freed would not count
        return DeviceMemory(str(device), round(SHARE * device.free_memory / processes))


class Lack(NamedTuple):
    """Memory that is short."""

    wanted: int
    """Bytes that a run takes."""
    limit: str
    """The limit below that, for people."""
    remedy: str = ""


def limit_words(settings: Settings, limit: int) -> str:
    """Return the limit of memory, for messages."""
    return f"{'max-memory is' if settings.max_memory else 'memory for it is'} {in_words(limit)}"


@dataclass(frozen=True)
class Demand:
    """Everything besides the settings that decides how much memory a run takes."""

    facts: ImageFacts
    mask: ImageFacts | None = None
    edges: float = 0
    """Pixels near edges of the image itself, as far as is known, if it is a drawing."""
    gpu: DeviceMemory | None = None

    def need(self, settings: Settings, factor: int = 1) -> int:
        """Estimate the peak of a run [bytes] from above: for photographs within a quarter.

        ``factor``: how many times smaller the image is read, in each direction.
        """
        facts, mask = self.facts, self.mask
        pixels = facts.width * facts.height
        worked = pixels / factor**2
        drafted = min(factor, 8) ** 2 if facts.drafts else 1
        reading = facts.decoded * pixels / drafted + facts.kept * pixels + STRIPS
        traced = TRACED.get(settings.subject)
        working = traced * worked if traced else _fitting(facts, settings, factor)
        if settings.subject == "drawing":
            stages = 1 + settings.tidy
            working += stages * DRAWN_EDGE * min(self.edges / factor, worked) + settings.tidy * DRAWN
        cut_out = 64  # bytes per pixel of removing the background of a photograph
        if settings.removal and not traced:
            working = max(working, cut_out * worked)
        scoring = _scoring(facts, settings, worked)
        if mask:  # which is read beside the image, and held
            masked = mask.width * mask.height / self.mask_factor(factor) ** 2
            whole = (mask.decoded + mask.kept) * mask.width * mask.height
            reading = max(reading, whole + (MASK_READ + MASK) * masked + STRIPS)
            working, scoring = working + MASK * masked, scoring + MASK * masked
        return round(PROGRAM + 4 * facts.channels * worked + max(reading, working, scoring))

    def need_on_gpu(self, settings: Settings, factor: int = 1) -> int:
        """Estimate the peak of a run on a GPU [bytes] from above."""
        facts, traced_on_gpu = self.facts, 160  # bytes per pixel of the renders of a drawing, on a GPU
        traced = traced_on_gpu * facts.width * facts.height / factor**2
        working = traced if settings.subject in TRACED else _fitting(facts, settings, factor, LANES)
        return round(ON_GPU + working)

    def mask_factor(self, factor: int) -> int:
        """Return how many times smaller the mask of an image that is reduced ``factor`` times is read.

        It keeps the detail that the reduced image has.
        """
        found = factor
        while self.mask and found > 1 and self.mask.width // found < self.facts.width // factor:
            found //= 2
        return found

    def lack(self, settings: Settings, factor: int = 1) -> Lack | None:
        """Return the memory that is short for a run; None if there is enough."""
        limit, wanted = memory_limit(settings), self.need(settings, factor)
        if limit is not None and wanted > limit:
            return Lack(wanted, limit_words(settings, limit))
        if self.gpu and (wanted := self.need_on_gpu(settings, factor)) > self.gpu.limit:
            free = f"free memory of {self.gpu.name} for it is {in_words(self.gpu.limit)}"
            return Lack(wanted, free, "; fewer --curves take less, --device cpu none of it")
        return None

    def factor(self, settings: Settings, name: str, least: int = 1) -> int:
        """Return how many times an image has to be reduced: a power of two, at least ``least``.

        Raises ``ResourceError``, which begins with ``name``, if the limit is too small for any size.
        """
        factor = least
        while lack := self.lack(settings, factor):
            factor *= 2
            if min(self.facts.width, self.facts.height) < LEAST_REDUCED_SIDE * factor:
                raise ResourceError(
                    f"{name}: at least {in_words(lack.wanted)} are needed, {lack.limit}{lack.remedy}"
                )
        return factor

    def reduction(
        self, source: ImageSource, target: FloatArray, settings: Settings, factor: int
    ) -> Reduction | None:
        """Return the reduction of ``source`` to ``target``; None if that has the image's own size."""
        lack = self.lack(settings) if factor > 1 else None
        if lack is None:
            return None
        facts, whole, limit = self.facts, None, memory_limit(settings)
        has_room = limit is None or whole_score(facts, settings, factor) <= limit
        if isinstance(source, bytes) and not facts.deep and has_room:
            paper = solid_color(settings.background)
            whole = functools.partial(load_rows, source, paper, target.shape[2])
        why = f"{facts.width}x{facts.height} pixels take about {in_words(lack.wanted)}, {lack.limit}"
        return Reduction(factor, facts.width, facts.height, whole, why)


def need_refined(facts: ImageFacts, settings: Settings) -> int:
    """Return the bytes of refining an SVG of as many shapes as usual."""
    pixels = facts.width * facts.height
    cleared = PROGRAM + CLEARED * pixels if facts.channels == 4 else 0
    # Additional bytes per pixel of refining an SVG: pictures of the SVG and of the scene that was read, a
    # file that is not drawn in strips, and the image on a colour.
    refined = 40
    return max(Demand(facts).need(settings) + refined * pixels, cleared)


def check_refined(
    source: ImageSource, settings: Settings, name: str, gpu: DeviceMemory | None = None
) -> None:
    """Raise ``ResourceError`` if there is no memory to refine an SVG against an image at full size."""
    facts, limit = facts_of(source, name), memory_limit(settings)
    wanted = need_refined(facts, settings)
    words = limit_words(settings, limit) if limit is not None and wanted > limit else ""
    if not words and gpu and (lack := Demand(facts, gpu=gpu).lack(settings)):
        wanted, words = lack.wanted, lack.limit
    if words:
        size = f"{facts.width}x{facts.height} pixels take about {in_words(wanted)}"
        raise ResourceError(f"{name}: {size}, {words}; refine against a smaller image")


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
