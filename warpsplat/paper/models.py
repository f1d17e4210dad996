"""Models of coverage by Gaussians: which stages make a shape's coverage of the pixels."""

from __future__ import annotations

from dataclasses import dataclass

from warpsplat.paper.coverage import GaussianCoverage, SplatCoverage
from warpsplat.paper.grid import Grid
from warpsplat.paper.soft import SoftGrid
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.coverage import Coverage
from warpsplat.rendering.models import Geometry


@dataclass(frozen=True, kw_only=True)
class GridModel:
    """Options of both models, grids of Gaussians along and across each shape."""

    through_scales: bool = True
    """Whether gradients flow through the Gaussians' scales and angles."""
    fold: float = 0.0
    """Weight of the fold loss (fills; the folded fraction of the canvas), which the adjoint adds."""
    samples_per_shape: int = 64


@dataclass(frozen=True)
class SplatModel(GridModel):
    """The paper's Gaussians, so placed that they cover what the path covers."""

    def stages(self, inputs: StageInputs) -> tuple[Geometry, Coverage]:
        """See ``Model``.

        Raises:
            ValueError: a fill has an odd number of cubics, and so no two chains (paper section 3.2).
        """
        grid = Grid(inputs, through_scales=self.through_scales, fold=self.fold)
        return grid, SplatCoverage(inputs, grid)


@dataclass(frozen=True)
class GaussianModel(GridModel):
    """The paper's own soft model: an opacity for each Gaussian, one soft row for a stroke."""

    softness: float = 0.6
    """Standard deviation that every Gaussian has at least [canvas units]; a pixel's area adds to it."""
    density: float = 0.5
    """Gaussians along and across a shape over their usual number."""

    def stages(self, inputs: StageInputs) -> tuple[Geometry, Coverage]:
        """See ``Model``.

        Raises:
            ValueError: a fill has an odd number of cubics, and so no two chains (paper section 3.2).
        """
        grid = SoftGrid(
            inputs,
            softness=self.softness,
            density=self.density,
            through_scales=self.through_scales,
            fold=self.fold,
        )
        inputs.bins.paint["opacities"] = grid.buffers.paint_opacities
        return grid, GaussianCoverage(inputs, grid)
