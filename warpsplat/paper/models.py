"""Models of coverage by Gaussians: which stages make a shape's coverage of the pixels."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from warpsplat.paper.coverage import GaussianCoverage
from warpsplat.paper.grid import Grid, Softness
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.coverage import Coverage
from warpsplat.rendering.models import Geometry


@dataclass(frozen=True, kw_only=True)
class SplatModel:
    """The paper's Gaussians, on grids along and across shapes, so placed that they cover what paths cover."""

    through_scales: bool = True
    """Whether gradients flow through the Gaussians' scales and angles."""
    fold: float = 0.0
    """Weight of the fold loss (fills; the folded fraction of the canvas), which the adjoint adds."""
    samples_per_shape: int = 64

    def stages(self, inputs: StageInputs) -> tuple[Geometry, Coverage]:
        """See ``Model``.

        Raises:
            ValueError: as ``Grid``.
        """
        grid = Grid(inputs, through_scales=self.through_scales, fold=self.fold, softness=self._softness())
        return grid, GaussianCoverage(inputs, grid)

    def _softness(self) -> Softness | None:
        return None


@dataclass(frozen=True)
class GaussianModel(SplatModel):
    """The paper's own soft model: an opacity for each Gaussian, one soft row for a stroke."""

    softness: float = 0.6
    """See ``Softness.sigma``."""
    density: float = 0.5
    """See ``Softness.density``."""

    def stages(self, inputs: StageInputs) -> tuple[Geometry, Coverage]:
        """See ``Model``; the shapes' opacities are in their coverages, and 1 where they are composited."""
        made = super().stages(inputs)
        ones = inputs.backend.array(wp.float32, inputs.parameters.shape_count)
        ones.fill_(1.0)
        inputs.bins.paint["opacities"] = ones
        return made

    def _softness(self) -> Softness:
        return Softness(self.softness, self.density)
