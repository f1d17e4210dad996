"""Rules of CUDA, and where they were broken.

A broken rule is what a GPU lets pass, or answers with undefined behaviour.
"""

from __future__ import annotations

import threading
import traceback
from pathlib import Path

from tests.fake_cuda import options

broken: list[str] = []
"""Broken rules of this process, as text with the place."""

lock = threading.RLock()
"""One thread at a time is in the driver."""


def report(rule: str) -> None:
    """Note that a rule was broken."""
    own = Path(__file__).parent
    frames = [
        f"{frame.filename}:{frame.lineno}"
        for frame in traceback.extract_stack()
        if own not in Path(frame.filename).parents and "/warp/_src/" not in frame.filename
    ]
    text = f"{rule}\n    at {' <- '.join(frames[:-5:-1])}"
    broken.append(text)
    if options.log:
        with open(options.log, "a") as file:
            file.write(text + "\n")
