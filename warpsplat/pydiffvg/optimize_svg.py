"""An SVG document whose transforms, points, colours and gradients are optimised in place."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path as FilePath
from typing import IO, Any
from xml.etree import ElementTree

import numpy as np
import torch

from warpsplat.errors import ImageError, counted
from warpsplat.pydiffvg.device import nearest
from warpsplat.pydiffvg.element import Context, OptimizableElement
from warpsplat.pydiffvg.optimizable import COLORS, optimized
from warpsplat.pydiffvg.parse_svg import root_and_size
from warpsplat.pydiffvg.render_pytorch import RenderFunction
from warpsplat.pydiffvg.shape import Shape, ShapeGroup
from warpsplat.svg.document import Document
from warpsplat.svg.geometry import view_box_map
from warpsplat.svg.inspect import NAMESPACE, read_svg_text, view_box
from warpsplat.svg.values import SvgViewport

Tensor = torch.Tensor
Store = dict[str, Any]


class SvgOptimizationSettings:
    """Choice of what is optimised, and learning rates: for all elements, or for the one of an id."""

    default_params: Store = {  # noqa: RUF012 - DiffVG's interface
        "optimize_color": True,
        "color_lr": 2e-3,
        "optimize_alpha": False,
        "alpha_lr": 2e-3,
        "optimizer": "Adam",
        "transforms": {
            "optimize_transforms": True,
            "transform_mode": "rigid",
            "translation_mult": 1e-3,
            "transform_lr": 2e-3,
        },
        "circles": {"optimize_center": True, "optimize_radius": True, "shape_lr": 2e-1},
        "paths": {"optimize_points": True, "shape_lr": 2e-1},
        "gradients": {
            "optimize_stops": True,
            "stop_lr": 2e-3,
            "optimize_color": True,
            "color_lr": 2e-3,
            "optimize_alpha": False,
            "alpha_lr": 2e-3,
            "optimize_location": True,
            "location_lr": 2e-1,
        },
    }

    def __init__(self, f: IO[str] | None = None) -> None:
        """Take the defaults, or read ``f``, a file that ``save`` wrote."""
        self.store: dict[str, Store] = (
            {"default": copy.deepcopy(self.default_params)} if f is None else json.load(f)
        )

    def default_name(self, dname: str) -> None:
        """Give the settings of all elements another name."""
        self.dname = dname
        self.store.setdefault(dname, self.store["default"])

    def retrieve(self, node_id: str | None) -> tuple[Store, bool]:
        """Return the settings of an element, and whether they are its own."""
        own = self.store.get(node_id or "")
        return (self.store["default"], False) if own is None else (own, True)

    def reset_to_defaults(self, node_id: str) -> Store:
        """Drop an element's own settings and return those of all elements."""
        self.store.pop(node_id, None)
        return self.store["default"]

    def undefault(self, node_id: str) -> Store:
        """Return an element's own settings, at first a copy of those of all elements."""
        return self.store.setdefault(node_id, copy.deepcopy(self.store["default"]))

    def override_optimizer(self, optimizer: str | None) -> None:
        """Set the optimiser of everything: ``Adam``, ``SGD`` or ``ASGD``."""
        if optimizer is not None:
            self.global_override(["optimizer"], optimizer)

    def global_override(self, path: list[str], value: object) -> None:
        """Set the value that the keys ``path`` lead to in all settings."""
        for store in self.store.values():
            at = store
            for key in path[:-1]:
                at = at[key]
            at[path[-1]] = value

    def save(self, file: IO[str]) -> None:
        """Write the settings as JSON."""
        self.store["default"] = self.store[getattr(self, "dname", "default")]
        json.dump(self.store, file, indent="\t")


class OptimizableSvg:
    """An SVG document to optimise: ``render``, a loss, ``backward``, ``step``; and ``write_xml``."""

    def __init__(
        self,
        filename: str | FilePath,
        settings: SvgOptimizationSettings | None = None,
        optimize_background: bool = False,
        verbose: bool = False,
        device: torch.device | str = "cpu",
    ) -> None:
        """Read an SVG, and print what was read if ``verbose``.

        ``settings``: what to optimise; ``optimize_background``: whether to optimise ``background`` too, which
        the caller composites on; ``device``: of the tensors; if it is missing, the nearest one.

        Raises:
            ImageError: not an SVG, or with something that shapes cannot show.
        """
        self.settings, self.device = settings or SvgOptimizationSettings(), nearest(device)
        path = FilePath(filename)
        text = read_svg_text(path)
        try:
            root, size = root_and_size(text)
            self.document = Document(text)
            self.canvas = tuple(math.ceil(side) for side in size)
            box, view = view_box(root), view_box_map(root, *size)
            self._view = torch.eye(3) if view is None else torch.tensor(view).float()
            self.settings.global_override(["transforms", "translation_mult"], max(self.canvas))
            context = Context(
                self.document, SvgViewport(*(box[2:] if box else size)), self.device, self.settings.retrieve
            )
            with np.errstate(all="ignore"):  # overflows are found where the values are used
                self.root = OptimizableElement(context, self.document.root)
        except ImageError as error:
            raise ImageError(f"{path}: {error}") from error
        elements = list(self.root.walk())
        if verbose:
            shapes = sum(bool(element.paths) for element in elements)
            print(f"{path}: {counted(len(elements), 'element')}, {counted(shapes, 'shape')} among them")
        self.scene: tuple[int, int, list[Shape], list[ShapeGroup]] | None = None
        """Last result of ``build_scene``."""
        self.background = torch.ones(3, device=self.device)
        """sRGB, shape (3,)."""
        self._optimizers = [optimizer for element in elements for optimizer in element.optimizers]
        if optimize_background:
            default = self.settings.retrieve("default")[0]
            self._optimizers.append(optimized(default, [self.background], default["color_lr"], COLORS))

    def build_scene(self) -> tuple[int, int, list[Shape], list[ShapeGroup]]:
        """Return the canvas' width and height [px], and the current shapes and groups."""
        shapes: list[Shape] = []
        groups: list[ShapeGroup] = []
        self.root.build(self._view.to(self.device), torch.ones(1, device=self.device), shapes, groups)
        self.scene = self.canvas[0], self.canvas[1], shapes, groups
        return self.scene

    def render(self, scale: float | None = None, seed: int = 0) -> Tensor:
        """Render the document, magnified by ``scale``; see ``RenderFunction.apply``."""
        scene = self.build_scene()
        width, height = (side if scale is None else max(1, int(side * scale)) for side in scene[:2])
        return RenderFunction.apply(width, height, 2, 2, seed, None, *RenderFunction.serialize_scene(*scene))

    def zero_grad(self) -> None:
        """Reset the gradients."""
        for each in self._optimizers:
            each.optimizer.zero_grad()

    def step(self) -> None:
        """Take a step of all optimisers."""
        for each in self._optimizers:
            each.step()

    def write_xml(self) -> str:
        """Return the text of the document with its current values."""
        ElementTree.register_namespace("", NAMESPACE)
        root = copy.deepcopy(self.document.root)
        definitions = ElementTree.Element(f"{{{NAMESPACE}}}defs")
        with torch.no_grad():
            self.root.write(root, definitions)
        if len(definitions):
            root.insert(0, definitions)
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="unicode", xml_declaration=True)
