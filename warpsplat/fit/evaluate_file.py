"""Training on the file as a viewer draws it, with its rounding."""

from __future__ import annotations

import numpy as np

from warpsplat.fit.export import export, show
from warpsplat.fit.step import Step
from warpsplat.svg.viewer import on_white, premultiplied
from warpsplat.svg.write import resized


def evaluate_file(step: Step) -> None:
    """Subtract the difference between the file and the render from the loss target of the next steps.

    A viewer rounds coordinates, colours and, at each translucent layer, pixels. The difference changes little
    from step to step, so it is measured now and then: the loss is that of the file, its gradient that of the
    render (a straight-through estimator, Bengio et al. 2013).
    """
    step.render()
    viewport, image = step.target.viewport, step.target.image
    scene = step.state.scene()
    text = export(scene, step.settings, step.state.per_pixel)
    drawn = show(resized(text, viewport.width, viewport.height, viewport.scale), scene)
    shown = (on_white(drawn) if image.shape[2] == 3 else premultiplied(drawn)) / 255
    step.loss_target.assign(np.asarray(image - (shown - step.renderer.read_image()), np.float32))
