"""How much memory a run takes, and how much smaller an image is worked on to stay below a limit.

Figures are upper bounds that were measured (docs/benchmarks.md); what a run holds at its highest is the most
of what its parts hold beside the image: reading it, fitting or tracing, and measuring the file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from PIL import Image

from warpsplat.errors import ResourceError
from warpsplat.files.image import Facts, image_facts
from warpsplat.files.sources import ImageSource
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings
from warpsplat.native import machine_memory
from warpsplat.rendering.memory import SHARE, in_words
from warpsplat.scene import Kind
from warpsplat.svg.strips import WHOLE_PIXELS

PROGRAM = 280 << 20
"""Of Python, the libraries and compiled kernels."""

STRIPS = 96 << 20
"""Of what is done strip by strip."""

DRAWN = 96 << 20
"""Of the strips of a file that are drawn side by side."""

TRAINED = 160
"""Of a pixel of the finest size: target, render, gradient, weights, maps of the error, a look at the file."""

SLOT = 1500
SLOT_STROKE = 1100
SLOT_PAINT = 4200
"""Of a slot (``rendering.renderer``): of any, and what strokes and gradients add."""

SLOTS_A_TILE, SLOTS_BETWEEN, SLOTS_A_SHAPE = 4.0, 9.0, 2.0
"""Slots of a fit: of each tile, of the root of tiles times shapes, of each shape."""

SHAPE = 24 << 10
"""Of a shape: its samples, surgery, its text."""

TRACED = {"drawing": 420, "line": 420, "pixel": 260}
"""Of a pixel, by subject."""

MASK_READ, MASK = 12, 4
"""Of a pixel of a mask: while it is read, and then."""

SHOWN, HALVES, HALVES_ODD, UNCUT = 4, 2, 10, 12
"""Of a pixel, to measure a file: its picture, both images at half the size, the same where a side is odd, and
what a file adds that is not drawn in strips."""

EYES = 500
"""Of a pixel, to measure SSIMULACRA2."""

REFINED = 40
"""Of a pixel of the image that an SVG is refined against, besides: pictures of what was given and of what was
read, a file that is not drawn in strips, and the image on a colour."""

CLEARED = 150
"""Of a pixel of an image with opacity that an SVG is refined against, of whose size is what finds pixels that
should be empty (``fit.clear``)."""

LEAST_SIDE = 32
"""Of an image that is worked on smaller [px]."""


@dataclass(frozen=True)
class Need:
    """What a run at one size needs [bytes]."""

    reading: int
    working: int
    """Fitting, or tracing."""
    scoring: int

    @property
    def most(self) -> int:
        """At its highest."""
        return PROGRAM + max(self.reading, self.working, self.scoring)


def need(facts: Facts, settings: Settings, factor: int = 1, mask: Facts | None = None) -> Need:
    """What a run takes whose image is ``factor`` times smaller in each direction than it is, with a ``mask``
    of how much errors count.

    An estimate from above: of photographs within a quarter, of drawings by the most that their kind took.
    """
    pixels = facts.width * facts.height
    worked = pixels / factor**2
    image = 4 * facts.channels * worked
    drafted = min(factor, 8) ** 2 if facts.drafts else 1
    reading = image + facts.decoded * pixels / drafted + facts.kept * pixels + STRIPS
    working = image + (
        TRACED[settings.subject] * worked if settings.subject in TRACED else _fitting(facts, settings, factor)
    )
    scoring = image + _scoring(facts, settings, worked)
    if mask:  # which is read beside the image, and held
        masked = mask.width * mask.height / mask_factor(facts, mask, factor) ** 2
        whole = (mask.decoded + mask.kept) * mask.width * mask.height
        reading = max(reading, image + whole + (MASK_READ + MASK) * masked + STRIPS)
        working, scoring = working + MASK * masked, scoring + MASK * masked
    return Need(*(round(x) for x in (reading, working, scoring)))


def mask_factor(facts: Facts, mask: Facts, factor: int) -> int:
    """How many times smaller the mask of an image is read that is worked on ``factor`` times smaller: none of
    the detail that is left there is lost.
    """
    found = factor
    while found > 1 and mask.width // found < facts.width // factor:
        found //= 2
    return found


def _fitting(facts: Facts, settings: Settings, factor: int) -> float:
    """Of the finest phase, which is the largest; the surplus has gone by then."""
    phase = phases(settings, -(-facts.width // factor), -(-facts.height // factor))[-1]
    pixels, curves = phase.width * phase.height, settings.curves
    tiles = pixels / 256
    slots = SLOTS_A_TILE * tiles + SLOTS_BETWEEN * math.sqrt(tiles * curves) + SLOTS_A_SHAPE * curves
    slot = SLOT
    slot += SLOT_STROKE if settings.kind == Kind.STROKE or settings.mixed else 0
    slot += SLOT_PAINT if settings.paint != "flat" else 0
    levels = len(settings.levels) or 1
    return levels * 1.5 * slots * slot + TRAINED * pixels + SHAPE * curves


def _scoring(facts: Facts, settings: Settings, pixels: float) -> float:
    """Of a picture of so many ``pixels``, without the image itself."""
    if pixels <= WHOLE_PIXELS:
        per_pixel: float = SHOWN + 16
    else:
        odd = facts.width % 2 or facts.height % 2
        per_pixel = SHOWN + (HALVES_ODD if odd else HALVES) + (UNCUT if settings.minify else 0)
    strips = STRIPS if pixels <= WHOLE_PIXELS else STRIPS + DRAWN
    return strips + per_pixel * pixels


def has_room_for_eyes(settings: Settings, pixels: int) -> bool:
    """Whether SSIMULACRA2 of so many ``pixels`` can be measured within the limit."""
    limit = memory_limit(settings)
    return limit is None or PROGRAM + (EYES + 16) * pixels <= limit


def whole_score(facts: Facts, settings: Settings, factor: int) -> int:
    """Of measuring a file at the image's own size after a run on a smaller one [bytes]."""
    pixels = facts.width * facts.height
    held = 4 * facts.channels * pixels / factor**2 + (facts.decoded + facts.kept) * pixels
    return round(PROGRAM + held + _scoring(facts, settings, pixels))


def facts_of(source: ImageSource) -> Facts | None:
    """Of bytes of a file, a Pillow image or an array; None where they cannot be told."""
    if isinstance(source, bytes):
        return image_facts(source)
    if isinstance(source, np.ndarray) and source.ndim in {2, 3}:
        channels = source.shape[2] if source.ndim == 3 else 1
        return Facts(source.shape[1], source.shape[0], 4 if channels in {2, 4} else 3, 12, drafts=False)
    if isinstance(source, Image.Image):
        return Facts(source.width, source.height, 4, 4, drafts=False)
    return None


def memory_limit(settings: Settings) -> int | None:
    """What a run may take [bytes]: the settings' limit, else this process's part of ``SHARE`` of what the
    machine has.
    """
    if settings.max_memory:
        return settings.max_memory
    found = machine_memory()
    return None if found is None else round(SHARE * found / _Process.sharers)


class _Process:
    """What this process knows of the machine."""

    sharers = 1
    """Processes that do images here at the same time."""


def share_machine(processes: int) -> None:
    """Tell this process that it is one of so many that do images on this machine at the same time."""
    _Process.sharers = processes


def factor_for(facts: Facts, settings: Settings, name: str, least: int = 1, mask: Facts | None = None) -> int:
    """How many times smaller an image is to be worked on: a power of two, from ``least`` on. Arguments are
    those of ``need``.

    Raises:
        ResourceError: the limit is too small for any size; the message begins with ``name``.
    """
    limit = memory_limit(settings)
    factor = least
    while limit is not None and (wanted := need(facts, settings, factor, mask).most) > limit:
        factor *= 2
        if min(facts.width, facts.height) < LEAST_SIDE * factor:
            given = "max-memory is" if settings.max_memory else "memory for it is"
            raise ResourceError(f"{name}: at least {in_words(wanted)} are needed, {given} {in_words(limit)}")
    return factor


def need_refined(facts: Facts, settings: Settings) -> int:
    """What refining an SVG of as many shapes as usual takes [bytes]."""
    pixels = facts.width * facts.height
    cleared = PROGRAM + CLEARED * pixels if facts.channels == 4 else 0
    return max(need(facts, settings).most + REFINED * pixels, cleared)


def check_refined(source: ImageSource, settings: Settings, name: str) -> None:
    """Whether there is memory to refine an SVG against an image. That is done at the image's own size:
    whether a result is better is for all of its pixels to say.

    Raises:
        ResourceError: there is not; the message begins with ``name``.
    """
    facts, limit = facts_of(source), memory_limit(settings)
    if facts is None or limit is None:
        return
    wanted = need_refined(facts, settings)
    if wanted > limit:
        given = "max-memory is" if settings.max_memory else "memory for it is"
        size = f"{facts.width}x{facts.height} pixels take about {in_words(wanted)}"
        raise ResourceError(f"{name}: {size}, {given} {in_words(limit)}; refine against a smaller image")
