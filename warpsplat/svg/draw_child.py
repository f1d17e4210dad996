"""Draws one SVG with resvg in a process of its own: what ends or stalls there leaves the program standing.

Run as a script by ``warpsplat.svg.viewer``; imports nothing of warpsplat, so that it starts within 30 ms.
Standard input: one line of JSON (``path``: module search path, ``seconds`` and ``memory``: limits,
``options``: of resvg_py), then the SVG's text in UTF-8. Standard output: a PNG. A text that resvg refuses
ends it with ``REFUSED`` and the cause on standard error.
"""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import threading
from typing import Any

REFUSED = 3
"""Exit status where resvg says what is wrong; any other but 0 is a crash."""

STACK = 128 << 20
"""Stack [bytes]: resvg recurses with the document's depth, and main threads have 1 MiB on some systems."""


def limit_resources(seconds: int, memory: int) -> None:
    """Bound processor time [s] and address space [bytes], as far as the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    wanted = ((resource.RLIMIT_CPU, seconds), (resource.RLIMIT_AS, memory), (resource.RLIMIT_CORE, 0))
    for kind, value in wanted:
        with contextlib.suppress(ValueError, OSError):  # macOS bounds no address space
            hard = resource.getrlimit(kind)[1]
            lowest = value if hard == resource.RLIM_INFINITY else min(value, hard)
            resource.setrlimit(kind, (lowest, hard))


def draw(text: str, options: dict[str, Any], result: list[bytes | str]) -> None:
    """Append the PNG, or the cause why there is none, to ``result``; left empty by a panic."""
    import resvg_py

    try:
        result.append(bytes(resvg_py.svg_to_bytes(svg_string=text, **options)))
    except ValueError as error:
        result.append(str(error))


def main() -> int:
    """One request."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of Ctrl-C the program itself decides what ends
    request = json.loads(sys.stdin.buffer.readline())
    sys.path[:] = request["path"]
    limit_resources(request["seconds"], request["memory"])
    text = sys.stdin.buffer.read().decode()
    result: list[bytes | str] = []
    threading.stack_size(STACK)
    worker = threading.Thread(target=draw, args=(text, request["options"], result))
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
