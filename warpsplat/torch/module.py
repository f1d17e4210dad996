"""A scene as a module with parameters."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import torch

from warpsplat.fit.optimizer import units_of
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.settings import Settings
from warpsplat.scene import ATTRIBUTES, Scene
from warpsplat.scene.scene import check_scene
from warpsplat.svg.write import write_svg
from warpsplat.torch.function import render
from warpsplat.torch.tensors import TABLE, WITHOUT_GRADIENT, SceneTensors, attributes_of


class Module(torch.nn.Module):
    """A scene with a parameter for each attribute that some shape of it has, in the shape of its field."""

    points: torch.nn.Parameter
    colors: torch.nn.Parameter
    opacities: torch.nn.Parameter
    widths: torch.nn.Parameter
    frames: torch.nn.Parameter
    stop_offsets: torch.nn.Parameter
    stop_colors: torch.nn.Parameter
    stop_opacities: torch.nn.Parameter
    fades: torch.nn.Parameter

    def __init__(self, scene: Scene, *, renderer: Any = "exact", threads: int | None = None) -> None:
        """Copy the attributes of ``scene``; ``renderer``, ``threads``: see ``render``."""
        super().__init__()
        check_scene(scene)
        self._layout, self._renderer, self._threads = scene, renderer, threads
        soft = isinstance(renderer, str) and renderer_of(renderer).soft
        fixed = WITHOUT_GRADIENT if soft else (*WITHOUT_GRADIENT, "fades")
        for name in (attribute.name for attribute in attributes_of(scene)):
            if name not in fixed:
                self.register_parameter(name, torch.nn.Parameter(torch.tensor(getattr(scene, name))))
        self._twins: torch.Tensor | None
        """Row of the point that each point is tied to, its own or its twin's."""
        rows = np.arange(len(scene.points))
        for i in np.flatnonzero(scene.twin):  # ascending: the shape before may be a twin itself
            rows[scene.first[i] : scene.first[i + 1]] = rows[scene.first[i - 1] : scene.first[i]]
        self.register_buffer("_twins", torch.tensor(rows) if scene.twin.any() else None, persistent=False)

    def tensors(self) -> SceneTensors:
        """Return the scene of the parameters, through which gradients flow to them."""
        values: dict[str, torch.Tensor] = dict(self.named_parameters())
        if self._twins is not None:
            values["points"] = values["points"][self._twins]
        return SceneTensors(self._layout, values)

    def forward(self, width: int | None = None, height: int | None = None) -> torch.Tensor:
        """Render the scene, shape (height, width, 4); see ``render``."""
        return render(self.tensors(), width, height, renderer=self._renderer, threads=self._threads)

    def parameter_groups(
        self, settings: Settings | None = None, *, rate: float = 1.0
    ) -> list[dict[str, Any]]:
        """Return an optimiser's parameter groups: each attribute with its learning rate in a run.

        ``settings``: of the run, default: ``Settings()``; ``rate``: factor of all learning rates.
        """
        settings = settings or Settings()
        units = units_of(settings, self._layout.canvas)
        return [
            {
                "params": [parameter],
                "name": name,
                "lr": rate * (settings.rates[name] * units[TABLE[name].rate_unit]),
            }
            for name, parameter in self.named_parameters()
        ]

    @torch.no_grad()
    def project(self) -> None:
        """Clamp every attribute to its bounds, as a run does after each step."""
        for name, parameter in self.named_parameters():
            parameter.clamp_(*self._bounds[name])

    @functools.cached_property
    def _bounds(self) -> dict[str, tuple[float, float]]:
        """The least and the largest value of each attribute."""
        units = units_of(Settings(), self._layout.canvas)
        return {
            name: (low * units[low_unit], high * units[high_unit])
            for name, ((low, low_unit), (high, high_unit)) in ((a.name, (a.low, a.high)) for a in ATTRIBUTES)
        }

    def scene(self) -> Scene:
        """Return the scene of the current parameters."""
        return self.tensors().scene()

    def to_svg(self) -> str:
        """Return the text of an SVG file of the scene."""
        return write_svg(self.scene())
