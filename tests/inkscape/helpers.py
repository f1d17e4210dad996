"""Documents with an image, and runs of the script as Inkscape starts it."""

from __future__ import annotations

import base64
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from warpsplat.inkscape.command import SCRIPT, content
from warpsplat.svg.viewer import draw_png, render_svg

PICTURE = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="192" height="128" viewBox="0 0 96 64"><defs>'
    '<linearGradient id="g0"><stop stop-color="#f00"/><stop offset="1" stop-color="#ff0"/></linearGradient>'
    '</defs><rect width="96" height="64" fill="url(#g0)"/><path d="M0 0h40v24H0" fill="#00f"/>'
    '<path d="M96 64V30L60 64"/></svg>'
)
"""What a stand-in for warpsplat makes of anything: no two of its corners are alike."""

DATA = "data:image/png;base64," + base64.b64encode(draw_png(PICTURE, zoom=1.0)).decode()
NAMESPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
SIZED = 'width="96" height="96" viewBox="0 0 96 96"'


def document(inner: str, size: str = SIZED) -> str:
    """A document; ``HREF`` in it is a link to the picture, embedded."""
    return f"<svg {NAMESPACES} {size}>{inner}</svg>".replace("HREF", f'xlink:href="{DATA}"')


def script(folder: Path, *command: str) -> Path:
    """The installed script, which starts ``command``; without one, this warpsplat."""
    path = folder / SCRIPT
    text = content(path).decode()
    path.write_text(text.replace("'-m', 'warpsplat'", str(list(command))[1:-1]) if command else text, "utf-8")
    return path


def run(
    script: Path, path: Path, *arguments: str, original: Path | None = None
) -> subprocess.CompletedProcess[bytes]:
    """Run the script on a copy of the ``original`` document, as Inkscape does."""
    environment = {**os.environ, "DOCUMENT_PATH": str(original or path), "PYTHONPATH": str(script.parent)}
    words = [sys.executable, script.name, *arguments, str(path)]
    return subprocess.run(
        words, cwd=script.parent, env=environment, capture_output=True, timeout=120, check=False
    )


def pixels(text: str) -> npt.NDArray[np.float64]:
    return np.asarray(render_svg(text, zoom=2.0).convert("RGBA"), np.float64)


def without_images(text: str) -> str:
    return re.sub(r"<image[^>]*>", "", text)
