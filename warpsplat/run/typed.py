"""Keywords of ``vectorize`` and others; made by ``python docs/option_tables.py``, not by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict

from warpsplat.fit.settings import Painting, Quality, Subject


class RefineOptions(TypedDict, total=False):
    """Options that ``refine`` shares with ``vectorize``. One that is None counts as not given."""

    time_budget: float | str | None
    """As many steps as end within 60s, 2m ..."""
    background: str | None
    """auto: transparent where the image is; none; or a colour (#rrggbb)."""
    title: str | None
    """Title of the picture, in the file."""
    ids: bool | None
    """Name paths by their colours, and group neighbours of one, for editors."""
    minify: bool | None
    """Smallest text: no line breaks, no mark that warpsplat wrote it."""
    precision: int | None
    """Most decimals of a pixel in coordinates."""


class Options(RefineOptions, total=False):
    """The options of the command line, with ``_`` for ``-``: these, and those of ``RefineOptions``."""

    subject: Subject | None
    """What the image shows: to a photo shapes are fitted, the others are traced."""
    closed: bool | None
    """Filled shapes."""
    open: bool | None
    """Strokes."""
    mixed: bool | None
    """Fills, and strokes where they remove more error; of line art, fills where it is filled."""
    quality: Quality | None
    """Effort: how many steps."""
    iterations: int | None
    """Steps; overrides the effort's number."""
    renderer: str | None
    """How the fit sees shapes: as viewers do, as Gaussians much like that, or as the paper's soft ones."""
    paint: Painting | None
    """A colour for each shape, a gradient for each, or whichever is worth its bytes."""
    layered: bool | None
    """Groups from coarse to fine, each with those before it a picture of its own."""
    levels: Sequence[int] | str | None
    """Numbers of shapes up to the end of each group of --layered, as 64,256,1024."""
    colors: int | None
    """No more than N colours; the fills are opaque then."""
    palette: Sequence[str] | str | None
    """The only colours, #ff8800,#fff ... or a file with them."""
    opaque: bool | None
    """No translucent shapes."""
    target_psnr: float | None
    """The smallest file with a PSNR of at least DB."""
    max_bytes: int | str | None
    """The best file of no more than 100KB, 1MB ..."""
    max_memory: int | str | None
    """Memory to stay below, as 4GB: a larger image is worked on at a smaller size."""
    seed: int | None
    """Random seed."""
    size: str | None
    """For plotters: size that the picture fills, as 200x150mm."""
    page: str | None
    """For plotters: sheet that it fills but for margins: a3, a4, a5, letter."""
    units: str | None
    """Units in which the file says its size: mm, cm, in, pt, px."""
