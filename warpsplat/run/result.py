"""What a run made."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import Renderer, Subject
from warpsplat.metrics import Score
from warpsplat.run.formats import write_named
from warpsplat.scene import Scene


@dataclass(frozen=True)
class LevelScore:
    """What a layered file shows without the layers above a level."""

    shapes: int
    psnr: float | None
    """As a viewer shows it [dB]; None where it is the image itself."""


@dataclass(frozen=True)
class Result:
    """What a run made."""

    svg: str
    scene: Scene
    """What the file shows; of soft Gaussians, the shapes as they were trained: a file holds less of them."""
    score: Score | None
    """Of the SVG as resvg shows it; None where the run was stopped before it was measured."""
    render_psnr: float
    """Of the last training render against the image, at its size [dB]. Of soft Gaussians, where the image is
    no larger than that size: of the finished scene in 8 bits, as the file's is.
    """
    estimated_psnr: float
    """Of the file at that size, as the training saw it: the last look at it may be 25 steps old [dB]."""
    iterations: int
    """Steps done; fewer than asked for when stopped."""
    seconds: float
    stopped: bool
    """Whether it was interrupted."""
    renderer: Renderer = "exact"
    """Of the training."""
    render_ssim: float | None = None
    """Of soft Gaussians' own render."""
    missed: tuple[str, ...] = ()
    """Goals that were not reached, each as a sentence."""
    levels: tuple[LevelScore, ...] = ()
    """Of a layered file, of each level's picture."""
    subject: Subject = "photo"
    """What the image was taken for ..."""
    why: str = ""
    """... and why; empty where it was given."""
    history: tuple[Progress, ...] = field(default=(), repr=False)
    """What was reported of the training, in order."""
    before: float | None = None
    """Of a refined SVG, its own PSNR [dB]."""
    renewed: int = 0
    """Times that a shape was set anew in training since a number of its was not finite."""
    reduced: str = ""
    """What was done to stay below the limit of memory, for people; empty: nothing."""
    kept: str = ""
    """Of a refined SVG, what was kept as it is, for people; empty: nothing."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the SVG, or as the name ends: ``.svgz`` gzipped, ``.png`` as a viewer shows it, ``.pdf`` (the
        extra ``pdf``) its paths. An existing file is replaced in one step: it is there as it was, or whole.

        Raises:
            UsageError: the package that makes PDFs is not installed.
            OutputError: it cannot be written.
        """
        write_named(Path(path), self.svg)

    def as_dict(self) -> dict[str, Any]:
        """For JSON. Figures that were not measured are None."""
        shapes = len(self.scene) - len(self.scene.pictures)
        figures: dict[str, Any] = {f.name: None for f in fields(Score)} | {"bytes": len(self.svg.encode())}
        return {
            **(self.score.as_dict() if self.score else figures),
            "subject": self.subject,
            "why": self.why,
            "renderer": self.renderer,
            "render_psnr": round(self.render_psnr, 3),
            "render_ssim": None if self.render_ssim is None else round(self.render_ssim, 4),
            "estimated_psnr": round(self.estimated_psnr, 3),
            "shapes": shapes,
            "curves": shapes,  # what it was called at first
            "iterations": self.iterations,
            "seconds": round(self.seconds, 2),
            "stopped": self.stopped,
            "renewed": self.renewed,
            "reduced": self.reduced,
            "missed": list(self.missed),
            "levels": [asdict(level) for level in self.levels],
        }
