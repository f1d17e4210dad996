"""Figures of a run's file, and of its render."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpsplat.errors import Stopped
from warpsplat.fit.export import export
from warpsplat.fit.problem import Fit, Run
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.settings import Settings
from warpsplat.metrics import Score, psnr, score_svg, similarities
from warpsplat.run.memory import PROGRAM, SSIMULACRA2, Reduction, memory_limit
from warpsplat.run.result import LevelScore
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.scene import level_ends

if TYPE_CHECKING:
    from warpsplat.rendering.backend import Backend

QUICK_PIXELS = 1_000_000
"""Size up to which an interrupted run is still scored, and a score that has begun is finished [pixels]: it
takes about a second."""

LATE = 1.1
"""Share of a time budget from which on it is missed: less may be due to the machine's other work."""


def has_time_for_ssimulacra2(settings: Settings, target: FloatArray) -> bool:
    """Return whether a run measures SSIMULACRA2: within a time budget other things are worth more."""
    pixels, limit = target[..., 0].size, memory_limit(settings)
    has_memory = limit is None or PROGRAM + (SSIMULACRA2 + 16) * pixels <= limit
    return pixels <= QUICK_PIXELS and settings.time_budget is None and has_memory


@dataclass(frozen=True)
class Reference:
    """The image of a run, which its files and renders are compared with."""

    target: FloatArray
    settings: Settings
    run: Run
    reduction: Reduction | None

    def _score(self, text: str, *, perceptual: bool = False, stop: Callable[[], bool] | None = None) -> Score:
        if self.reduction:
            return self.reduction.score(text, self.target, stop)
        return score_svg(text, self.target, own=True, perceptual=perceptual, stop=stop)

    def score(self, text: str, *, interrupted: bool) -> Score | None:
        """Return the score of a file; None for a large image whose run was stopped."""
        quick, stopped = self.target[..., 0].size <= QUICK_PIXELS, interrupted or self.run.stopped()
        if stopped and not quick:
            return None
        perceptual = has_time_for_ssimulacra2(self.settings, self.target) and not stopped
        may_stop = self.reduction or not quick  # a score that is quick is finished
        try:
            return self._score(text, perceptual=perceptual, stop=self.run.stopped if may_stop else None)
        except Stopped:
            return None

    def level_scores(self, scene: Scene, per_pixel: float) -> tuple[LevelScore, ...]:
        """Return the scores of the files that the first layers of a layered scene make."""
        ends = (*level_ends(scene), len(scene)) if self.settings.levels else ()
        texts = [export(scene.take(np.arange(end)), self.settings, per_pixel) for end in ends]
        scores = [self._score(text).as_dict()["psnr"] for text in texts]
        return tuple(map(LevelScore, ends, scores))

    def render_score(self, made: Fit) -> tuple[float, float | None]:
        """Return PSNR [dB] and SSIM of the render; of soft Gaussians, if small, of the finished scene."""
        settings, run = self.settings, self.run
        small = not self.reduction and self.target[..., 0].size <= settings.fine_pixels
        if renderer_of(settings.renderer).soft and small and not run.failures:
            return render_figures(made.scene, self.target, settings, run.backend)
        return made.render_psnr, None


def render_figures(
    scene: Scene, target: FloatArray, settings: Settings, backend: Backend
) -> tuple[float, float | None]:
    """Return PSNR [dB] and SSIM of the settings' render of ``scene`` against ``target``, both in 8 bits."""
    from warpsplat.rendering.renderer import render

    model = renderer_of(settings.renderer).model(settings, step=0, slack=1.0)
    shown = np.round(255 * np.clip(render(scene, model=model, backend=backend), 0, 1))
    wanted = np.round(255 * target)
    return psnr(shown, wanted), similarities(shown, wanted)[0]


def missed_goals(
    settings: Settings, score: Score | None, seconds: float, compiling: float
) -> tuple[str, ...]:
    """Return the goals of ``settings`` that a run missed; without a score none is known.

    ``compiling``: the part of its ``seconds`` that it waited for kernels to be compiled.
    """
    missed: list[str] = []
    if score is None:
        return ()
    if settings.target_psnr and score.psnr < settings.target_psnr:
        missed.append(f"target-psnr {settings.target_psnr:g} dB: reached {score.psnr:.2f} dB")
    if settings.max_bytes and score.bytes > settings.max_bytes:
        missed.append(f"max-bytes {settings.max_bytes}: reached {score.bytes}")
    if settings.time_budget and seconds > LATE * settings.time_budget:
        once = f", of which compiling took {compiling:.1f} s, which later runs do not need"
        in_time = seconds - compiling <= LATE * settings.time_budget
        took = f"took {seconds:.1f} s{once if in_time else ''}"
        missed.append(f"time-budget {settings.time_budget:g} s: {took}")
    return tuple(missed)
