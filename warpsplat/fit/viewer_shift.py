"""Training on what the file shows."""

from __future__ import annotations

import numpy as np

from warpsplat.fit.export import export, show
from warpsplat.fit.step import Step
from warpsplat.svg.viewer import on_white, premultiplied
from warpsplat.svg.write import resized


def look_at_file(step: Step) -> None:
    """Take what the file shows for the render in the steps to come.

    A viewer rounds coordinates, colours and, at each translucent layer, pixels. The difference changes
    little from step to step, so it is measured now and then and taken off the target: the loss is that of
    the file, its gradient that of the render (a straight-through estimator, Bengio et al. 2013).
    """
    step.render()
    viewport, image = step.target.viewport, step.target.image
    scene = step.state.scene()
    text = resized(
        export(scene, step.settings, step.state.per_pixel),
        viewport.width,
        viewport.height,
        viewport.scale,
    )
    picture = show(text, scene)
    shown = (on_white(picture) if image.shape[2] == 3 else premultiplied(picture)) / 255
    step.aim.at(np.asarray(image - (shown - step.renderer.read_image()), np.float32))
