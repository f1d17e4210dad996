"""Script that draws one SVG in a process of its own, so that crashes and hangs there do not end the program.

Run by ``warpsplat.svg.viewer``; imports nothing of warpsplat, so that it starts within 30 ms.
Standard input: one line of JSON (``path``: module search path, ``seconds`` and ``memory``: limits,
``form``: ``png`` or ``pdf``, ``options``: of its function here), then the SVG's text in UTF-8. Standard
output: the picture. A text that the library rejects ends the process with ``REFUSED`` and the cause on
standard error.
"""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import threading
from typing import Any

REFUSED = 3
"""Exit status if the library rejects the text; any other but 0 is a crash."""

STACK = 128 << 20
"""Stack [bytes]: resvg recurses with the document's depth, and main threads have 1 MiB on some systems."""


def limit_resources(seconds: int, memory: int) -> None:
    """Limit processor time [s] and address space [bytes], as far as the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    wanted = ((resource.RLIMIT_CPU, seconds), (resource.RLIMIT_AS, memory), (resource.RLIMIT_CORE, 0))
    for kind, value in wanted:
        with contextlib.suppress(ValueError, OSError):  # macOS does not limit address space
            hard = resource.getrlimit(kind)[1]
            lowest = value if hard == resource.RLIM_INFINITY else min(value, hard)
            resource.setrlimit(kind, (lowest, hard))


def png(text: str, options: dict[str, Any]) -> bytes:
    """Render with resvg; ``options``: those of ``resvg_py``."""
    import resvg_py

    return bytes(resvg_py.svg_to_bytes(svg_string=text, **options))


def pdf(text: str, options: dict[str, Any]) -> bytes:
    """Convert to a PDF of the same size with Typst, which reads SVGs with resvg's parser.

    ``options``: ``width`` [pt], or none for the SVG's own; ``skip_system_fonts``.
    """
    import typst

    width = options["width"]
    size = "auto" if width is None else f"{width!r}pt"
    sheet = f'{SHEET}#image("/picture.svg", width: {size})'
    files = {"main.typ": sheet.encode(), "picture.svg": text.encode()}
    fonts = options["skip_system_fonts"]
    make: Any = typst.compile  # its types do not allow files in memory
    try:
        return bytes(make(files, ignore_system_fonts=fonts, pdf_tags=False))  # tags are for texts
    except typst.TypstError as error:
        raise ValueError(error.message) from error


SHEET = """#set document(date: none)
#set page(width: auto, height: auto, margin: 0pt, fill: none)
"""
"""Typst's settings for a document of nothing but a picture. A date would make files differ."""

FORMS = {"png": png, "pdf": pdf}


def draw(text: str, request: dict[str, Any], result: list[bytes | str]) -> None:
    """Append the picture, or the cause of a rejection, to ``result``; a panic leaves it empty."""
    try:
        result.append(FORMS[request["form"]](text, request["options"]))
    except ValueError as error:
        result.append(str(error))


def main() -> int:
    """Answer one request; return the exit status."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent to act on
    request = json.loads(sys.stdin.buffer.readline())
    sys.path[:] = request["path"]
    limit_resources(request["seconds"], request["memory"])
    text = sys.stdin.buffer.read().decode()
    result: list[bytes | str] = []
    threading.stack_size(STACK)
    worker = threading.Thread(target=draw, args=(text, request, result))
    worker.start()
    worker.join()
    if not result:
        return 1
    if isinstance(result[0], str):
        sys.stderr.write(result[0])
        return REFUSED
    sys.stdout.buffer.write(result[0])
    return 0


if __name__ == "__main__":
    sys.exit(main())
