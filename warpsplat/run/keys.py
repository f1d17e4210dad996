"""Keys in files that identify the job that made them."""

from __future__ import annotations

import base64
import hashlib

from warpsplat._version import __version__
from warpsplat.fit.settings import Settings


def job_key(settings: Settings, source: bytes, mask: bytes | None = None) -> str:
    """Return the key of a result: a hash of program version, settings, and bytes of image and mask."""
    masked = "" if mask is None else f"{hashlib.sha256(mask).hexdigest()} "
    digest = hashlib.sha256(f"{__version__} {settings.fingerprint()} {masked}".encode() + source).digest()
    return base64.b64encode(digest[:KEY_BYTES], altchars=b"._").decode()


KEY_BYTES = 6
"""Bytes of a key: two jobs have the same one by a chance of one in 2^48."""


STOPPED = "stopped"
"""Key of a result that was cut short."""
