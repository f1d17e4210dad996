"""Image in, SVG file and its score out."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warp as wp

from warpsplat import __version__
from warpsplat.config import Settings
from warpsplat.files import write_atomically
from warpsplat.image import load_image
from warpsplat.kernels import constants
from warpsplat.metrics import Score, score_svg
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg import write_svg
from warpsplat.train import Progress, Trainer


@dataclass(frozen=True)
class Result:
    """What a run made."""

    svg: str
    scene: Scene
    score: Score
    """Of the SVG as resvg shows it."""
    internal_psnr: float
    """Of the last training render, at its size [dB]."""
    iterations: int
    """Steps done; fewer than asked for when stopped."""
    seconds: float
    stopped: bool

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            **self.score.as_dict(),
            "internal_psnr": round(self.internal_psnr, 3),
            "curves": len(self.scene),
            "iterations": self.iterations,
            "seconds": round(self.seconds, 2),
            "stopped": self.stopped,
        }


def job_key(settings: Settings, source: bytes) -> str:
    """Names a result: the same program version, settings and image bytes give the same key."""
    digest = hashlib.sha256(f"{__version__} {settings.fingerprint()} ".encode() + source)
    return digest.hexdigest()[:24]


def vectorize(
    target: FloatArray,
    settings: Settings,
    device: wp.Device,
    *,
    threads: int | None = None,
    metadata: str = "",
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Result:
    """Fit curves to ``target`` (sRGB in [0, 1], (height, width, 3)) and score the file they make.

    Args:
        target: the image.
        settings: all that decides the result.
        device: where to compute.
        threads: CPU threads; default all. Does not change the result.
        metadata: text for the file's metadata.
        report: called every few steps.
        stop: asked after every step; once true, the curves as they are make the file.
    """
    started = time.monotonic()
    trainer = Trainer(target, settings, device, threads=threads)
    try:
        scene = trainer.run(report, stop)
    finally:
        trainer.close()
    plateau = constants.PLATEAU if settings.renderer == "splat" else 1.0
    svg = write_svg(scene, precision=settings.precision, metadata=metadata, opacity_scale=plateau)
    return Result(
        svg=svg,
        scene=scene,
        score=score_svg(svg, target),
        internal_psnr=trainer.psnr(),
        iterations=trainer.step,
        seconds=time.monotonic() - started,
        stopped=trainer.step < settings.iterations,
    )


def vectorize_file(
    source: Path,
    output: Path,
    settings: Settings,
    device: wp.Device,
    *,
    threads: int | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Result:
    """Read ``source``, vectorize it and write ``output`` atomically.

    Raises:
        ImageError: ``source`` cannot be read.
        OutputError: ``output`` cannot be written.
    """
    target = load_image(source)
    key = job_key(settings, source.read_bytes())
    metadata = f"key={key}"
    result = vectorize(target, settings, device, threads=threads, metadata=metadata, report=report, stop=stop)
    svg = result.svg
    if result.stopped:
        # A file that was cut short must not pass for a finished one.
        svg = svg.replace(metadata, "stopped", 1)
    write_atomically(output, svg.encode())
    return result
