"""Start a preview on a terminal, and end it with the finished picture."""

from __future__ import annotations

import contextlib
import logging
import os
from pathlib import Path
from typing import Any, TextIO

from warpsplat.cli.echo import echo
from warpsplat.errors import ImageError
from warpsplat.motion.terminal.blocks import HALF
from warpsplat.motion.terminal.detect import measured, terminal
from warpsplat.motion.terminal.preview import Preview
from warpsplat.run.result import Result

LARGEST = 1600
"""Longer side of the finished picture [px]: more than any terminal shows."""


def start_preview(stream: TextIO, protocol: Any) -> Preview | None:
    """Return a preview on ``stream``, drawn by ``protocol`` or else the best one the terminal knows.

    Returns None, after a notice that says why, if the stream shows no pictures.
    """
    found = terminal(stream, protocol)
    if found is None:
        echo(
            "warpsplat: --preview: stderr is no terminal that shows pictures; --preview=blocks prints them",
            err=True,
        )
        return None
    if found.protocol == "blocks" and not _has_blocks(stream):
        echo(
            f"warpsplat: --preview: the terminal's encoding, {stream.encoding}, has no half blocks", err=True
        )
        return None
    if os.name == "nt":
        os.system("")  # has consoles of Windows read escape sequences
    made = Preview(stream, lambda: measured(found, stream))
    log = logging.getLogger("warpsplat")
    for earlier in [handler for handler in log.handlers if isinstance(handler, _NoticeHandler)]:
        log.removeHandler(earlier)
    log.addHandler(_NoticeHandler(made))
    return made


def _has_blocks(stream: TextIO) -> bool:
    try:
        HALF.encode(stream.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


class _NoticeHandler(logging.Handler):
    """Moves a preview on when a notice was printed below its picture."""

    def __init__(self, preview: Preview) -> None:
        super().__init__()
        self._preview = preview

    def emit(self, record: logging.LogRecord) -> None:
        if not getattr(record, "passing", False):
            self._preview.move_on()


def show_finished(preview: Preview, result: Result, source: bytes | Path | None) -> None:
    """Show a result, beside its ``source`` if there is one; what cannot be read is left out."""
    import numpy as np

    from warpsplat.files.sources import image_of
    from warpsplat.svg.viewer import premultiplied, render_svg

    canvas = result.scene.canvas
    side = max(canvas.width, canvas.height)
    with contextlib.suppress(ImageError):
        image = (premultiplied(render_svg(result.svg, zoom=min(1.0, LARGEST / side))) / 255).astype(
            np.float32
        )
        beside = None
        if source is not None:
            with contextlib.suppress(ImageError):
                beside = image_of(source, factor=max(1, side // LARGEST))
        preview.finish(image, beside)
