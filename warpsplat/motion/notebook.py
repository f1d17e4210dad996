"""Show a run in a notebook while it goes on."""

from __future__ import annotations

import base64
import io
import time
from typing import Any

from warpsplat.errors import counted
from warpsplat.fit.progress import Progress
from warpsplat.run.render import to_pillow

INTERVAL = 0.3
"""Least time between two pictures [s]: a browser takes some milliseconds for one."""


class Live:
    """A callback of ``vectorize`` and ``refine`` that shows a bar and the growing picture in a notebook.

    It needs IPython, which notebooks have (the extra ``notebook``).

    Example::

        warpsplat.vectorize("cat.jpg", callback=warpsplat.Live())
    """

    def __init__(self) -> None:
        """Raise ``ImportError`` where there is no IPython."""
        try:
            from IPython.display import HTML, DisplayHandle
        except ImportError as error:
            raise ImportError("warpsplat.Live needs IPython: pip install warpsplat[notebook]") from error
        self._html: Any = HTML
        self._handle: Any = DisplayHandle()
        self._show: Any = self._handle.display
        self._shown = 0.0
        self._picture = ""
        self._width = 0

    def __call__(self, progress: Progress) -> None:
        """Show the state of a run, unless that was done just now."""
        now = time.monotonic()
        if now - self._shown < INTERVAL and progress.work < 1:
            return
        self._shown = now
        if progress.snapshot is not None:
            self._width = self._width or progress.snapshot.scene().canvas.width
            out = io.BytesIO()
            to_pillow(progress.snapshot.image()).save(out, "PNG")
            source = base64.b64encode(out.getvalue()).decode()
            self._picture = f'<br><img src="data:image/png;base64,{source}" width="{self._width}" alt="">'
        shapes = counted(progress.shapes, "shape")
        words = f"step {progress.step} of {progress.steps}, {progress.psnr:.1f} dB, {shapes}"
        bar = f'<progress value="{progress.work:.3f}" max="1"></progress>'
        self._show(self._html(f"{bar} {words}, {progress.seconds:.0f} s{self._picture}"))
        self._show = self._handle.update
