"""Models of coverage: the stages that compute a shape's coverage of the pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import warp as wp

from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.bins import Bins
from warpsplat.rendering.coverage import Coverage, ExactCoverage, SplatCoverage
from warpsplat.rendering.grid import Grid
from warpsplat.rendering.outline import Outline
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.soft import GaussianCoverage, SoftGrid


class Geometry(Protocol):
    """Interface of the stage that samples the shapes, for binning."""

    def samples(self) -> dict[str, wp.array]:
        """``sample_first``, ``sample_last``, ``position`` and ``extent`` of ``kernels.bins.rectangles``."""

    def forward(self, program: Program) -> None:
        """Record attributes -> samples."""


@dataclass(frozen=True)
class Job:
    """Inputs and capacities of a model's stages."""

    backend: Backend
    parameters: Parameters
    viewport: Viewport
    bins: Bins
    samples: int
    """Capacity for samples."""
    slots: int
    """Capacity for slots."""
    needed: wp.array
    """Counter of the need for samples, shape (1,)."""


class Model(Protocol):
    """Interface of a model of coverage."""

    @property
    def samples_per_shape(self) -> int:
        """First guess of the need."""

    def stages(self, job: Job) -> tuple[Geometry, Coverage]:
        """Allocate the two stages."""


@dataclass(frozen=True)
class ExactModel:
    """The area that a viewer computes for the paths."""

    samples_per_shape: int = 48
    slack: float = 1.0
    """How much further from the curves the polylines may be than ``constants.FLATNESS``."""

    def stages(self, job: Job) -> tuple[Geometry, Coverage]:
        """See ``Model``."""
        outline = Outline(
            job.backend, job.parameters, job.viewport, job.samples, job.needed, slack=self.slack
        )
        coverage = ExactCoverage(job.backend, job.parameters, job.viewport, outline, job.bins, job.slots)
        return outline, coverage


@dataclass(frozen=True)
class SplatModel:
    """The paper's Gaussians, so placed that they cover what the path covers."""

    through_scales: bool = True
    """Whether gradients flow through the Gaussians' scales and angles."""
    fold: float = 0.0
    """Weight of the fold loss (fills; the folded fraction of the canvas), which the adjoint adds."""
    samples_per_shape: int = 64

    def stages(self, job: Job) -> tuple[Geometry, Coverage]:
        """See ``Model``.

        Raises:
            ValueError: a fill has an odd number of cubics, and so no two chains (paper section 3.2).
        """
        grid = Grid(
            job.backend,
            job.parameters,
            job.viewport,
            job.samples,
            job.needed,
            through_scales=self.through_scales,
            fold=self.fold,
        )
        return grid, SplatCoverage(job.backend, grid, job.bins, job.slots)


@dataclass(frozen=True)
class GaussianModel:
    """The paper's own soft model: an opacity for each Gaussian, one soft row for a stroke."""

    softness: float = 0.6
    """Standard deviation that every Gaussian has at least [canvas units]; a pixel's area adds to it."""
    density: float = 0.5
    """Gaussians along and across a shape over their usual number."""
    through_scales: bool = True
    """Whether gradients flow through the Gaussians' scales and angles."""
    fold: float = 0.0
    """Weight of the fold loss (fills; the folded fraction of the canvas), which the adjoint adds."""
    samples_per_shape: int = 64

    def stages(self, job: Job) -> tuple[Geometry, Coverage]:
        """See ``Model``.

        Raises:
            ValueError: a fill has an odd number of cubics, and so no two chains (paper section 3.2).
        """
        grid = SoftGrid(
            job.backend,
            job.parameters,
            job.viewport,
            job.samples,
            job.needed,
            softness=self.softness,
            density=self.density,
            through_scales=self.through_scales,
            fold=self.fold,
        )
        job.bins.paint["opacities"] = grid.buffers.paint_opacities
        return grid, GaussianCoverage(job.backend, grid, job.bins, job.slots)


EXACT = ExactModel()
