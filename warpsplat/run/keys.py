"""What a file says of the job that made it."""

from __future__ import annotations

import base64
import hashlib

from warpsplat._version import __version__
from warpsplat.fit.settings import Settings


def job_key(settings: Settings, source: bytes, mask: bytes | None = None) -> str:
    """Names a result: the same program version, settings and bytes of image and mask give the same key."""
    masked = "" if mask is None else f"{hashlib.sha256(mask).hexdigest()} "
    digest = hashlib.sha256(f"{__version__} {settings.fingerprint()} {masked}".encode() + source).digest()
    return base64.b64encode(digest[:KEY_BYTES], altchars=b"._").decode()


KEY_BYTES = 6
"""Of a key: it is compared with the one that a file would have, so that chance hits one in 2^48."""


STOPPED = "stopped"
"""In place of a key: of a result that was cut short."""
