"""An SVG document whose transforms, points, colours and gradients are optimised where they stand in it."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import IO, Any
from xml.etree import ElementTree

import numpy as np
import torch

from warpsplat.errors import ImageError
from warpsplat.pydiffvg.color import Color
from warpsplat.pydiffvg.device import nearest
from warpsplat.pydiffvg.motion import Motion
from warpsplat.pydiffvg.render_pytorch import RenderFunction
from warpsplat.pydiffvg.save_svg import path_data, rgb_text
from warpsplat.pydiffvg.shape import Path, Shape, ShapeGroup, path_of
from warpsplat.pydiffvg.tuned import Tuned, TunedGradient, optimizer_of
from warpsplat.svg.document import Document, Element, name_of
from warpsplat.svg.geometry import outline, parse_transform, view_box_map
from warpsplat.svg.gradients import FlatColor, Gradient, resolve_paint
from warpsplat.svg.inspect import NAMESPACE, inspect_svg, read_svg_text, svg_size, view_box
from warpsplat.svg.paths import cubics
from warpsplat.svg.style import DRAWN
from warpsplat.svg.values import SvgViewport, fraction, length

Tensor = torch.Tensor
Store = dict[str, Any]
GROUPS = {"svg", "g", "a"}


class SvgOptimizationSettings:
    """What is optimised, and at which rates; for all elements, or those of an id."""

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
        """``f``: a file that ``save`` wrote."""
        self.store: dict[str, Store] = (
            {"default": copy.deepcopy(self.default_params)} if f is None else json.load(f)
        )

    def default_name(self, dname: str) -> None:
        """Another name of what counts for all elements."""
        self.dname = dname
        self.store.setdefault(dname, self.store["default"])

    def retrieve(self, node_id: str | None) -> tuple[Store, bool]:
        """What counts for an element, and whether that is its own."""
        own = self.store.get(node_id or "")
        return (self.store["default"], False) if own is None else (own, True)

    def reset_to_defaults(self, node_id: str) -> Store:
        """Have an element be as all others."""
        self.store.pop(node_id, None)
        return self.store["default"]

    def undefault(self, node_id: str) -> Store:
        """Settings of an element's own, at first a copy of all others'."""
        return self.store.setdefault(node_id, copy.deepcopy(self.store["default"]))

    def override_optimizer(self, optimizer: str | None) -> None:
        """The optimiser of everything."""
        if optimizer is not None:
            self.global_override(["optimizer"], optimizer)

    def global_override(self, path: list[str], value: object) -> None:
        """Set what the keys ``path`` lead to, for all elements."""
        for store in self.store.values():
            at = store
            for key in path[:-1]:
                at = at[key]
            at[path[-1]] = value

    def save(self, file: IO[str]) -> None:
        """Write as JSON."""
        self.store["default"] = self.store[getattr(self, "dname", "default")]
        json.dump(self.store, file, indent="\t")


class _Node:
    """An element with what of it is optimised."""

    def __init__(self, svg: OptimizableSvg, element: Element) -> None:
        self.element = element
        self.settings = svg.settings.retrieve(element.get("id"))[0]
        self.style = svg.document.style_of(element)
        self.children = [_Node(svg, child) for child in element if name_of(child) in GROUPS | DRAWN]
        self.tuned: list[Tuned] = []
        text = self.style["transform"]
        self.motion = None
        if text not in {"", "none"}:
            self.motion = Motion(torch.tensor(parse_transform(text)).float(), self.settings["transforms"])
            self.motion.to(svg.device)
            self._tune(self.motion.parameter_groups(), self.motion.optimizes, (-math.inf, math.inf))
        self.opacity = self._fraction("opacity", svg)
        self.paths: list[Path] = []
        if name_of(element) in DRAWN:
            self._read_shape(svg)

    def _tune(self, parameters: list[Any], wanted: bool, bounds: tuple[float, float]) -> None:
        if wanted:
            self.tuned.append(Tuned(optimizer_of(self.settings, parameters), bounds))

    def _fraction(self, name: str, svg: OptimizableSvg) -> Tensor:
        value = torch.tensor([fraction(self.style[name])], device=svg.device)
        if name in self.element.attrib and self.settings["optimize_alpha"]:
            value.requires_grad_()
            self._tune([{"params": [value], "lr": self.settings["alpha_lr"]}], True, (1e-4, 1.0))
        return value

    def _read_shape(self, svg: OptimizableSvg) -> None:
        data = outline(name_of(self.element), self.element.attrib, svg.viewport)
        subpaths = cubics(data, keep_dots=False)
        width = length(self.style["stroke-width"], svg.viewport.diagonal, "stroke-width") or 0.0
        half = torch.tensor(width / 2, device=svg.device)
        self.paths = [path_of(subpath) for subpath in subpaths]
        chosen = self.settings["paths"]
        for path in self.paths:
            path.points, path.stroke_width = path.points.to(svg.device), half
            path.points.requires_grad_(chosen["optimize_points"])
        points = [path.points for path in self.paths]
        self._tune([{"params": points, "lr": chosen["shape_lr"]}], chosen["optimize_points"], FREE)
        self.fill_opacity, self.stroke_opacity = (
            self._fraction(f"{name}-opacity", svg) for name in ("fill", "stroke")
        )
        self.fill, self.stroke = (self._paint(name, svg, subpaths) for name in ("fill", "stroke"))

    def _paint(self, name: str, svg: OptimizableSvg, subpaths: list[Any]) -> Tensor | TunedGradient | None:
        text = self.style[name]
        eye = torch.eye(3).numpy()
        paint = resolve_paint(text, self.style, svg.document, svg.viewport, subpaths, eye)
        if isinstance(paint, FlatColor):
            color = torch.tensor(paint.color, device=svg.device)
            wanted = self.settings["optimize_color"]
            color.requires_grad_(wanted)
            self._tune([{"params": [color], "lr": self.settings["color_lr"]}], wanted, (1e-4, 1.0))
            return color
        if isinstance(paint, Gradient):
            identity = text.strip()[4:].strip(")'\" ").lstrip("#")
            gradient = TunedGradient(paint, svg.settings.retrieve(identity)[0], svg.device)
            self.tuned += gradient.tuned
            return gradient
        return None

    def build(self, matrix: Tensor, opacity: Tensor, shapes: list[Shape], groups: list[ShapeGroup]) -> None:
        """Append what the element draws, within an element of this transform and opacity."""
        if self.motion is not None:
            matrix = matrix @ self.motion()
        opacity = opacity * self.opacity
        if self.paths:
            paints: list[Color] = []
            for paint, share in ((self.fill, self.fill_opacity), (self.stroke, self.stroke_opacity)):
                if isinstance(paint, Tensor):
                    paints.append(torch.cat([paint, opacity * share]))
                else:
                    paints.append(paint.color(opacity * share, matrix) if paint else None)
            numbers = torch.arange(len(shapes), len(shapes) + len(self.paths))
            even_odd = self.style["fill-rule"] == "evenodd"
            name = self.element.get("id", "")
            groups.append(ShapeGroup(numbers, paints[0], even_odd, paints[1], matrix, name))
            shapes += self.paths
        for child in self.children:
            child.build(matrix, opacity, shapes, groups)

    def all(self) -> Iterator[_Node]:
        """The element and all within it."""
        yield self
        for child in self.children:
            yield from child.all()

    def write(self, definitions: Element) -> None:
        """Bring the element's attributes up to date."""
        element = self.element
        if self.motion is not None:
            _say(element, "transform", self.motion.text())
        if element.get("opacity") is not None:
            _say(element, "opacity", f"{float(self.opacity):.6g}")
        if not self.paths:
            return
        if self.settings["paths"]["optimize_points"]:
            element.tag = f"{{{NAMESPACE}}}path"
            element.set("d", " ".join(map(path_data, self.paths)))
        for name, paint in (("fill", self.fill), ("stroke", self.stroke)):
            if isinstance(paint, Tensor):
                _say(element, name, rgb_text(paint))
            elif paint is not None:
                identity = f"{name}-{len(definitions)}"
                definitions.append(paint.element(identity))
                _say(element, name, f"url(#{identity})")


FREE = (-math.inf, math.inf)


def _say(element: Element, name: str, value: str) -> None:
    """Set a property where it counts most."""
    parts = [part for part in element.get("style", "").split(";") if part.partition(":")[0].strip() != name]
    element.set(name, value)
    if name != "transform":
        element.set("style", ";".join([*filter(None, parts), f"{name}:{value}"]))


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
        """Read a document.

        Args:
            filename: of the SVG.
            settings: what is optimised.
            optimize_background: whether ``background``, for the caller to composite on, is as well.
            verbose: whether to print what is read.
            device: of its tensors, or the nearest that there is.

        Raises:
            ImageError: not an SVG, or with something that shapes cannot show.
        """
        self.settings, self.device = settings or SvgOptimizationSettings(), nearest(device)
        path = FilePath(filename)
        text = read_svg_text(path)
        try:
            root = inspect_svg(text).root
            size = svg_size(root)
            if size is None:
                raise ImageError("says no size: neither viewBox nor width and height")
            self.document = Document(text)
            self.canvas = tuple(math.ceil(side) for side in size)
            box = view_box(root)
            self.viewport = SvgViewport(*(box[2:] if box else size))
            view = view_box_map(root, *size)
            self._view = torch.eye(3) if view is None else torch.tensor(view).float()
            self.settings.global_override(["transforms", "translation_mult"], max(self.canvas))
            with np.errstate(all="ignore"):  # what overflows is found where it is used
                self.root = _Node(self, self.document.root)
        except ImageError as error:
            raise ImageError(f"{path}: {error}") from error
        if verbose:
            nodes = list(self.root.all())
            print(f"{path}: {len(nodes)} elements, {sum(bool(node.paths) for node in nodes)} of them shapes")
        self.background = torch.ones(3, device=self.device, requires_grad=optimize_background)
        self._tuned = [tuned for node in self.root.all() for tuned in node.tuned]
        if optimize_background:
            default = self.settings.retrieve("default")[0]
            groups = [{"params": [self.background], "lr": default["color_lr"]}]
            self._tuned.append(Tuned(optimizer_of(default, groups), (1e-4, 1.0)))

    def build_scene(self) -> tuple[int, int, list[Shape], list[ShapeGroup]]:
        """Canvas width and height, shapes and groups, as they are now."""
        shapes: list[Shape] = []
        groups: list[ShapeGroup] = []
        self.root.build(self._view.to(self.device), torch.ones(1, device=self.device), shapes, groups)
        return self.canvas[0], self.canvas[1], shapes, groups

    def render(self, scale: float | None = None, seed: int = 0) -> Tensor:
        """The picture, see ``RenderFunction.apply``, magnified by ``scale``."""
        scene = self.build_scene()
        width, height = (side if scale is None else max(1, int(side * scale)) for side in scene[:2])
        return RenderFunction.apply(width, height, 2, 2, seed, None, *RenderFunction.serialize_scene(*scene))

    def zero_grad(self) -> None:
        """Forget gradients."""
        for tuned in self._tuned:
            tuned.optimizer.zero_grad()

    def step(self) -> None:
        """One step of all optimisers."""
        for tuned in self._tuned:
            tuned.step()

    def write_xml(self) -> str:
        """The document as it is now."""
        ElementTree.register_namespace("", NAMESPACE)
        root = copy.deepcopy(self.document.root)
        definitions = ElementTree.Element(f"{{{NAMESPACE}}}defs")
        with torch.no_grad():
            for node, element in zip(self.root.all(), self._copies(root), strict=True):
                kept, node.element = node.element, element
                node.write(definitions)
                node.element = kept
        if len(definitions):
            root.insert(0, definitions)
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="unicode", xml_declaration=True)

    def _copies(self, root: Element) -> Iterator[Element]:
        """Elements of a copy of the document, in the order of ``_Node.all``."""
        yield root
        for child in root:
            if name_of(child) in GROUPS | DRAWN:
                yield from self._copies(child)
