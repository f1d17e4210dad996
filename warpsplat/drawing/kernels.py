"""The kernels of a drawing's fit, which are compiled in a first run while the image is traced."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpsplat.kernels.drawing import crossings, newton, samples
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.kernel_cache import compile_expected, expect
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import Canvas, Kind, Scene

ON_HOST = (crossings.flatten, samples.along, newton.derivatives)
"""A kernel of each module that works on NumPy's arrays."""


def compile_meanwhile(kind: Kind, backend: Backend) -> None:
    """Have the kernels compiled that fit shapes of a kind, without waiting for them."""
    for kernel in ON_HOST:
        expect(kernel, wp.get_device("cpu"))
    points = np.zeros((1, 3 + (kind == Kind.STROKE), 2), np.float32)
    scene = Scene.uniform(
        kind,
        Canvas(1, 1, np.ones(3, np.float32)),
        points,
        colors=np.zeros((1, 3)),
        opacities=np.ones(1),
        widths=np.ones(1),
    )
    Renderer(Parameters(scene, backend), Viewport(1, 1)).expect_backward()
    compile_expected()
