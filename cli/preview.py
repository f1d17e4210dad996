"""The picture in the terminal: on stderr, so that a file on stdout stays what it is."""

from __future__ import annotations

import contextlib
import logging
import os
from pathlib import Path
from typing import Any, TextIO

from warpsplat.cli.say import say
from warpsplat.errors import ImageError
from warpsplat.motion.terminal.blocks import HALF
from warpsplat.motion.terminal.detect import Terminal, measured, terminal
from warpsplat.motion.terminal.preview import Preview
from warpsplat.run.result import Result

LARGEST = 1600
"""Longer side of a finished picture that is made to be shown [px]: more than any terminal takes."""


def preview_on(stream: TextIO, protocol: Any) -> Preview | None:
    """What draws on ``stream``, by a ``protocol`` or the best it knows; or None, and a line says why."""
    found = terminal(stream, protocol)
    if found is None:
        say(
            "warpsplat: --preview: stderr is no terminal that shows pictures; --preview=blocks prints them",
            err=True,
        )
        return None
    if found.protocol == "blocks" and not _has_blocks(stream):
        say(f"warpsplat: --preview: the terminal's encoding, {stream.encoding}, has no half blocks", err=True)
        return None
    if os.name == "nt":
        os.system("")  # has consoles of Windows read escape sequences
    made = Preview(stream, lambda: _now(found, stream))
    log = logging.getLogger("warpsplat")
    for earlier in [handler for handler in log.handlers if isinstance(handler, _Aside)]:
        log.removeHandler(earlier)
    log.addHandler(_Aside(made))
    return made


def _now(found: Terminal, stream: TextIO) -> Terminal:
    return measured(found, stream)


def _has_blocks(stream: TextIO) -> bool:
    try:
        HALF.encode(stream.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


class _Aside(logging.Handler):
    """Tells a preview that a notice was printed below its picture."""

    def __init__(self, preview: Preview) -> None:
        super().__init__()
        self._preview = preview

    def emit(self, record: logging.LogRecord) -> None:
        if not getattr(record, "passing", False):
            self._preview.move_on()


def finished(preview: Preview, result: Result, source: bytes | Path | None) -> None:
    """Show a result, beside its ``source`` where that can be read: to show is not to fail."""
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
