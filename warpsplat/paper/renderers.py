"""The paper's two renderers, as a fit uses them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.errors import UsageError
from warpsplat.fit.renderers import FitRenderer
from warpsplat.fit.settings import Settings
from warpsplat.paper import constants as paper
from warpsplat.paper.as_paths import as_paths
from warpsplat.paper.chains import as_chains, chain_weights
from warpsplat.paper.models import GaussianModel, SplatModel
from warpsplat.paper.split import faded, split
from warpsplat.portable import elementary
from warpsplat.rendering.models import Model
from warpsplat.scene import Basis, FloatArray, IndexArray, Scene


def fold_weight(settings: Settings, step: int) -> float:
    """Return the weight of the fold loss, which grows geometrically over the run."""
    growth = settings.fold_end / settings.fold_start
    return float(settings.fold_start * elementary.power(growth, step / settings.iterations))


class Splat(FitRenderer):
    """Gaussians that cover what a path covers."""

    exact = False
    opacity_scale = paper.PLATEAU
    default_model: Model = SplatModel()

    def preset(self, preset: Settings) -> Settings:
        """See ``FitRenderer``."""
        share = 0.5  # of the exact renderer's iterations: a step takes several times as long
        return replace(preset, iterations=round(share * preset.iterations), basis=Basis.CUBIC)

    def check(self, settings: Settings) -> None:
        """See ``FitRenderer``."""
        if settings.mixed:
            raise UsageError(f"mixed and the renderer {settings.renderer} cannot be combined")
        if settings.basis != Basis.CUBIC:
            raise UsageError(f"renderer {settings.renderer} needs the basis cubic")

    def model(self, settings: Settings, step: int, slack: float) -> Model:
        """See ``FitRenderer``."""
        return SplatModel(through_scales=settings.through_scales, fold=fold_weight(settings, step))

    def drawable(self, scene: Scene) -> Scene:
        """See ``FitRenderer``."""
        return as_chains(scene)

    def weights(self, scene: Scene) -> list[FloatArray]:
        """See ``FitRenderer``."""
        return chain_weights(scene)


class Gaussian(Splat):
    """Soft Gaussians; the render's own squared error is what counts."""

    soft = True
    opacity_scale = 1.0
    default_model = GaussianModel()
    cannot_draw_files = (
        "no SVG holds what the gaussian renderer draws: its paths have lost the opacity and softness of each "
        "Gaussian; vectorize --renderer gaussian reports the figures of its own render"
    )

    def preset(self, preset: Settings) -> Settings:
        """See ``FitRenderer``."""
        return replace(super().preset(preset), order="area", texture=0.0, viewer=False)

    def check(self, settings: Settings) -> None:
        """See ``FitRenderer``."""
        if settings.opaque or settings.is_limited:
            raise UsageError("opaque fills and the renderer gaussian cannot be combined")
        super().check(settings)
        if settings.painting != "flat":
            raise UsageError("renderer gaussian needs the paint flat")

    def model(self, settings: Settings, step: int, slack: float) -> Model:
        """See ``FitRenderer``."""
        fold = fold_weight(settings, step)
        return GaussianModel(
            settings.softness, settings.gaussian_density, through_scales=settings.through_scales, fold=fold
        )

    def to_paths(self, scene: Scene, settings: Settings) -> Scene:
        """See ``FitRenderer``."""
        return as_paths(scene, settings.softness)

    def split(self, scene: Scene, keep: IndexArray, most: int) -> tuple[IndexArray, Scene]:
        """Split strokes whose middle fades (paper section 3.4)."""
        broken = np.intersect1d(faded(scene), keep)[:most]
        return np.setdiff1d(keep, broken), split(scene, broken)


SPLAT = Splat()
GAUSSIAN = Gaussian()
