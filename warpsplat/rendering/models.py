"""Models of coverage: the stages that compute a shape's coverage of the pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:  # settings name models, and are read where nothing is rendered
    import warp as wp

    from warpsplat.rendering.bins import StageInputs
    from warpsplat.rendering.coverage import Coverage
    from warpsplat.rendering.program import Program


class Geometry(Protocol):
    """Interface of the stage that samples the shapes, for binning."""

    def samples(self) -> dict[str, wp.array]:
        """``sample_range``, ``position`` and ``extent`` of ``kernels.bins.rectangles``."""

    def forward(self, program: Program) -> None:
        """Record attributes -> samples."""


class Model(Protocol):
    """Interface of a model of coverage."""

    @property
    def samples_per_shape(self) -> int:
        """First guess of the need."""

    def stages(self, inputs: StageInputs) -> tuple[Geometry, Coverage]:
        """Allocate the two stages."""


@dataclass(frozen=True)
class ExactModel:
    """The area that a viewer computes for the paths."""

    samples_per_shape: int = 48
    slack: float = 1.0
    """How much further from the curves the polylines may be than ``constants.FLATNESS``."""

    def stages(self, inputs: StageInputs) -> tuple[Geometry, Coverage]:
        """See ``Model``."""
        from warpsplat.rendering.coverage import ExactCoverage
        from warpsplat.rendering.outline import Outline

        outline = Outline(inputs, slack=self.slack)
        return outline, ExactCoverage(inputs, outline)


EXACT = ExactModel()
