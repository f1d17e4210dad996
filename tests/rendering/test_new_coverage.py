"""Adding a model of coverage: here axis-parallel boxes, which no file of the package knows.

A shape covers the box of its control points. The area of a pixel inside a box is a product of two clamped
differences, so that image and gradients have short formulas to be held against.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import warp as wp

from tests.fit.pictures import picture
from tests.helpers import renderer_for
from tests.kernels import trials
from tests.scenes import random_scene
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import make_settings
from warpsplat.kernels import constants
from warpsplat.rendering.backend import Backend, buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.coverage import Coverage, CoverageBuffers
from warpsplat.rendering.models import Geometry
from warpsplat.rendering.program import Program
from warpsplat.scene import Kind, Scene


@dataclass
class BoxBuffers:
    corner_first: wp.array = buffer(wp.int32, "shapes")
    corner_last: wp.array = buffer(wp.int32, "shapes")
    corner: wp.array = buffer(wp.vec2, "corners")
    extent: wp.array = buffer(wp.vec2, "corners")


class BoxGeometry:
    """The corners by which a shape's tiles are found."""

    def __init__(self, inputs: StageInputs) -> None:
        self._inputs = inputs
        count = inputs.parameters.shape_count
        self.buffers = inputs.backend.allocate(BoxBuffers, {"shapes": count, "corners": 2 * count})

    def samples(self) -> dict[str, wp.array]:
        b = self.buffers
        return {
            "sample_first": b.corner_first,
            "sample_last": b.corner_last,
            "position": b.corner,
            "extent": b.extent,
        }

    def forward(self, program: Program) -> None:
        parameters = self._inputs.parameters
        program.launch(
            trials.corners,
            parameters.shape_count,
            parameters.arrays,
            self._inputs.viewport,
            self.buffers,
            split=True,
        )


class BoxCoverage:
    """Coverage as compositing reads it."""

    mapping = constants.AREA

    def __init__(self, inputs: StageInputs, geometry: BoxGeometry) -> None:
        self._inputs = inputs
        self.buffers = inputs.backend.allocate(CoverageBuffers, {"slots": inputs.slots})
        self._sources = (inputs.bins.buffers, geometry.buffers, inputs.viewport)

    def states(self, program: Program) -> None:
        program.launch(trials.boxes_forward, self._inputs.slots, *self._sources, self.buffers, split=True)

    def values(self, program: Program) -> None:
        """All are there."""

    def backward(self, program: Program) -> None:
        parameters = self._inputs.parameters
        program.launch(
            trials.boxes_backward,
            parameters.shape_count,
            *self._sources,
            parameters.arrays,
            sum_grad=self.buffers.coverage_pixels,
            split=True,
        )


@dataclass(frozen=True)
class BoxModel:
    samples_per_shape: int = 2

    def stages(self, inputs: StageInputs) -> tuple[Geometry, Coverage]:
        geometry = BoxGeometry(inputs)
        return geometry, BoxCoverage(inputs, geometry)


def expected(scene: Scene, scale: float) -> np.ndarray:
    """The image by the formula, in float64."""
    width, height = round(scene.canvas.width * scale), round(scene.canvas.height * scale)
    assert scene.canvas.background is not None
    image = np.tile(scene.canvas.background.astype(np.float64), (height, width, 1))
    for i in range(len(scene)):
        low, high = (scale * f(scene.points_of(i).astype(np.float64), axis=0) for f in (np.min, np.max))
        across, down = (
            np.clip(
                np.minimum(high[axis], np.arange(count) + 1) - np.maximum(low[axis], np.arange(count)), 0, 1
            )
            for axis, count in ((0, width), (1, height))
        )
        alpha = (scene.opacities[i] * down[:, None] * across)[..., None]
        image += alpha * (scene.colors[i] - image)
    return image


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_boxes_are_rendered(device: str, scale: float) -> None:
    scene = random_scene(Kind.FILL, count=5)
    made = renderer_for(scene, device, scale, model=BoxModel()).read_image()
    np.testing.assert_allclose(made, expected(scene, scale), atol=1e-5)


def test_a_run_trains_them(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Surgery, growth and looks at the loss know no model."""
    monkeypatch.setattr("warpsplat.fit.step.model_for", lambda *_: BoxModel())
    seen = []
    settings = make_settings(curves=12, iterations=100, viewer=False)
    done = fit(Problem(picture(), settings), Run(Backend.on(device), lambda now: seen.append(now.psnr)))
    assert len(done.scene) == 12
    assert seen[-1] > seen[0] + 3
    np.testing.assert_allclose(
        renderer_for(done.scene, device, model=BoxModel()).read_image(),
        expected(done.scene, 1.0),
        atol=1e-4,
    )
