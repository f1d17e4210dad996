"""Warp's headers for kernels on a CPU, precompiled once a process.

Warp precompiles them again in each thread that compiles, which takes as long as three usual modules.
"""

from __future__ import annotations

import atexit
import functools
import shutil
import tempfile
import threading
import time
from pathlib import Path


class SharedHeaders:
    """A folder of precompiled headers for all threads that compile.

    The first of them precompiles the headers, while the others wait. A thread whose module needs other ones,
    as its options differ, adds them: the compiler renames finished files into place.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._maker: int | None = None
        """The thread that precompiles the headers, if one does."""
        from warpsplat.rendering.cuda import runtime  # imports Warp, which drafts of drawings do without

        if hasattr(runtime(), "get_clang_pch_dir"):  # else Warp makes them for each thread
            runtime().get_clang_pch_dir = self.wait

    @functools.cached_property
    def _folder(self) -> Path:
        made = tempfile.mkdtemp(prefix="warpsplat-headers-")
        atexit.register(shutil.rmtree, made, ignore_errors=True)
        return Path(made)

    def wait(self) -> str:
        """Return the folder once it has headers, or this thread is to make them."""
        poll_interval = 0.01  # seconds after which a thread that waits for the headers looks for them again
        while True:
            with self._lock:
                made = any(self._folder.glob("*.pch"))
                if self._maker is None and not made:
                    self._maker = threading.get_ident()
                if made or self._maker == threading.get_ident():
                    return str(self._folder)
            time.sleep(poll_interval)

    def done(self) -> None:
        """Note that this thread has compiled its module, or failed: another one may make the headers."""
        with self._lock:
            if self._maker == threading.get_ident():
                self._maker = None
