"""Keywords of ``vectorize`` and others; made by ``python docs/option_tables.py``, not by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

from warpsplat.fit.custom_loss import CustomLoss, LossFunction
from warpsplat.fit.settings import (
    DxfCurves,
    LossName,
    Painting,
    Quality,
    Removal,
    Stack,
    Subject,
)


class RefineOptions(TypedDict, total=False):
    """Options that ``refine`` shares with ``vectorize``. One that is None counts as not given."""

    loss: LossName | LossFunction | CustomLoss | None
    time_budget: float | str | None
    background: str | None
    title: str | None
    dxf: DxfCurves | None
    ids: bool | None
    simple: bool | None
    separate: bool | None
    stack: Stack | None
    minify: bool | None
    precision: int | None


class Options(RefineOptions, total=False):
    """The options of the command line, with ``_`` for ``-``: these, and those of ``RefineOptions``.

    The documentation's table explains them.
    """

    preset: str | None
    subject: Subject | None
    closed: bool | None
    open: bool | None
    shape: str | None
    mixed: bool | None
    quality: Quality | None
    iterations: int | None
    renderer: str | None
    paint: Painting | None
    layered: bool | None
    levels: Sequence[int] | str | None
    colors: int | None
    palette: Sequence[str] | str | None
    opaque: bool | None
    target_psnr: float | None
    max_bytes: int | str | None
    max_memory: int | str | None
    detail: float | None
    optics: Mapping[str, object] | str | None
    seed: int | None
    remove_background: Removal | None
    size: str | None
    page: str | None
    units: str | None
    dpi: float | None
    width: str | None
    bridges: str | None
    symbols: bool | None
    strokes: bool | None
