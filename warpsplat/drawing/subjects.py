"""The subject of an image decides how it is vectorized: a photograph by fitting, all else by tracing."""

from __future__ import annotations

from dataclasses import replace

from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.fit.settings import Settings
from warpsplat.scene import FloatArray


def choose_subject(target: FloatArray, settings: Settings) -> tuple[Settings, str]:
    """Return ``settings`` with a subject, and the reason for it, which is empty if the subject was given.

    Options that only fits know, as strokes, levels or a target PSNR, make any image a photograph. Line art
    may be mixed.
    """
    if settings.subject != "auto":
        return settings, ""
    # A limit of bytes is for drawings too: they get fewer regions.
    fitted = settings.unsuited("drawing")
    guess = guess_subject(target) if fitted in ([], ["mixed"]) else None
    if guess is None or (fitted and guess.subject != "line"):
        return replace(settings, subject="photo"), f"{fitted[0]} is for fitted shapes"
    if settings.max_bytes and guess.subject not in {"photo", "drawing"}:
        return replace(settings, subject="photo"), "max-bytes is for fitted shapes and drawings"
    return replace(settings, subject=guess.subject), guess.why
