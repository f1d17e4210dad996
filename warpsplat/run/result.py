"""The result of a run."""

from __future__ import annotations

import base64
import hashlib
import math
import os
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from warpsplat._version import __version__
from warpsplat.errors import counted
from warpsplat.field_docs import described
from warpsplat.files.output import check_output
from warpsplat.files.remote import path_of
from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import DxfCurves, Settings, Subject
from warpsplat.metrics import Score
from warpsplat.run.explained import Explained
from warpsplat.run.formats import write_named
from warpsplat.scene import Scene

STOPPED = "stopped"
"""Key of a result that was cut short."""


@described
@dataclass(frozen=True)
class LevelScore:
    """PSNR of a layered file without the layers above a level."""

    shapes: int
    """Shapes of this level and those below."""
    psnr: float | None
    """As a viewer shows it [dB]; None if it equals the image."""


@described
@dataclass(frozen=True, repr=False)
class Result:
    """The result of a run. Results are equal if their files are, and how they came about, times aside."""

    svg: str
    """The text of the file."""
    scene: Scene
    """The shapes of the file; with soft Gaussians the trained ones, which a file cannot show as they are."""
    score: Score | None
    """Score of the SVG as resvg shows it; None if the run was stopped before that."""
    render_psnr: float = field(compare=False)
    """PSNR of the last training render against the image, at its size [dB]; NaN: a draft of a drawing is
    not rendered. With soft Gaussians, if the image is no larger than that size: of the finished scene in 8
    bits, like the file's.
    """
    estimated_psnr: float = field(compare=False)
    """PSNR of the file at that size, as estimated by the training [dB]; NaN likewise."""
    iterations: int
    """Steps done; fewer than asked for when stopped."""
    seconds: float = field(compare=False)
    """Time that it took."""
    stopped: bool
    """Whether the run was interrupted."""
    device: str = field(default="cpu", compare=False)
    """The device that was used: ``cpu`` or ``cuda:N``."""
    renderer: str = "exact"
    """Coverage model of the training."""
    render_ssim: float | None = None
    """SSIM of the render of soft Gaussians."""
    missed: tuple[str, ...] = ()
    """Goals that were missed, each as a sentence."""
    levels: tuple[LevelScore, ...] = ()
    """Scores of each level of a layered file."""
    subject: Subject = "photo"
    """The subject that the image was taken for."""
    why: str = ""
    """The reason for the subject; empty if it was given."""
    notes: tuple[str, ...] = ()
    """Notes for people on what may be unexpected, such as options that have no effect on the subject."""
    history: tuple[Progress, ...] = field(default=(), compare=False)
    """The progress reports of the training, in order."""
    before: float | None = None
    """PSNR of an SVG before it was refined [dB]."""
    renewed: int = 0
    """How often a shape was reset in training because of a number that was not finite."""
    reduced: str = ""
    """How the image was reduced to stay below the limit of memory, for people; empty: not at all."""
    optics: Explained | None = None
    """How the image was made of the drawing, if that was undone."""
    kept: str = ""
    """Elements that a refined SVG keeps as they are, for people; empty: none."""

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = True, dxf: DxfCurves = "arcs") -> None:
        """Write the result atomically; an existing file is replaced, whoever wrote it.

        ``overwrite=False`` refuses to replace a file that warpsplat did not write, as the command line does.
        The ending decides the format: ``.svg``, ``.svgz`` gzipped, ``.png`` as a viewer shows it, or its
        paths as ``.pdf`` (the extra ``pdf``), ``.eps``, or ``.dxf`` (the extra ``dxf``), whose curves are as
        ``dxf`` says.

        Raises:
            UsageError: the package that makes such files is not installed, or ``path`` is such a file.
            OutputError: it cannot be written.
        """
        file = path_of(path)
        if not overwrite:
            check_output(file, overwrite=False)
        write_named(file, self.svg, dxf=dxf)

    def __repr__(self) -> str:
        return f"Result({self._summary()})"

    def _summary(self) -> str:
        """Return the figures in one line."""
        quality = "not measured" if self.score is None else f"{self.score.psnr:.2f} dB"
        parts = [
            counted(len(self.scene), "shape"),
            quality,
            f"{len(self.svg.encode()):,d} bytes",
            self.subject,
        ]
        return ", ".join([*parts, f"{self.seconds:.1f} s", *(["stopped"] if self.stopped else [])])

    def _repr_svg_(self) -> str:
        """Return what notebooks show."""
        return self.svg

    def _repr_html_(self) -> str:
        """Return what notebooks show: the picture, which as an image runs no scripts, and its figures."""
        source = base64.b64encode(self.svg.encode()).decode()
        picture = f'<img src="data:image/svg+xml;base64,{source}" alt="" style="max-width: 100%">'
        return f"<figure>{picture}<figcaption>{self._summary()}</figcaption></figure>"

    def as_dict(self) -> dict[str, Any]:
        """Return the figures for JSON; those that were not measured are None."""
        shapes = len(self.scene) - len(self.scene.pictures)
        figures: dict[str, Any] = {f.name: None for f in fields(Score)} | {
            "exact": None,
            "bytes": len(self.svg.encode()),
        }
        return {
            **(self.score.as_dict() if self.score else figures),
            "subject": self.subject,
            "why": self.why,
            "device": self.device,
            "notes": list(self.notes),
            "renderer": self.renderer,
            "render_psnr": finite(self.render_psnr),
            "render_ssim": None if self.render_ssim is None else round(self.render_ssim, 4),
            "estimated_psnr": finite(self.estimated_psnr),
            "shapes": shapes,
            "curves": shapes,  # an older name, kept for scripts
            "iterations": self.iterations,
            "seconds": round(self.seconds, 2),
            "stopped": self.stopped,
            "renewed": self.renewed,
            "reduced": self.reduced,
            "missed": list(self.missed),
            "optics": self.optics.as_dict() if self.optics else None,
            "levels": [asdict(level) for level in self.levels],
        }


def finite(decibels: float) -> float | None:
    """Return a PSNR for JSON, which has no other numbers than finite ones."""
    return round(decibels, 3) if math.isfinite(decibels) else None


def job_key(settings: Settings, source: bytes, mask: bytes | None = None) -> str:
    """Return the key of a result: a hash of program version, settings, and bytes of image and mask."""
    masked = "" if mask is None else f"{hashlib.sha256(mask).hexdigest()} "
    digest = hashlib.sha256(f"{__version__} {settings.fingerprint()} {masked}".encode() + source).digest()
    key_bytes = 6  # bytes of a key: two jobs have the same one by a chance of one in 2^48
    return base64.b64encode(digest[:key_bytes], altchars=b"._").decode()
