"""Models of coverage: the stages that compute a shape's coverage of the pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import warp as wp

from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.bins import Bins
from warpsplat.rendering.coverage import Coverage, ExactCoverage
from warpsplat.rendering.outline import Outline
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program


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


EXACT = ExactModel()
