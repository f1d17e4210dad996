"""Elements of an SVG document whose transforms, points, colours and gradients are optimised."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple
from xml.etree import ElementTree

import torch

from warpsplat.pydiffvg.color import Color
from warpsplat.pydiffvg.optimizable import (
    COLORS,
    BoundedOptimizer,
    OptimizableGradient,
    OptimizableTransform,
    optimized,
)
from warpsplat.pydiffvg.save_svg import path_data, rgb_text
from warpsplat.pydiffvg.shape import Path, Shape, ShapeGroup, path_of
from warpsplat.svg.document import DRAWN, Document, Element, name_of
from warpsplat.svg.geometry import outline, parse_transform
from warpsplat.svg.gradients import FlatColor, Gradient, parse_link, resolve_paint
from warpsplat.svg.inspect import NAMESPACE
from warpsplat.svg.paths import Subpath, cubics
from warpsplat.svg.values import SvgViewport, fraction, length

Tensor = torch.Tensor
GROUPS = {"svg", "g", "a"}


class Context(NamedTuple):
    """Data that the elements of a document share."""

    document: Document
    viewport: SvgViewport
    device: torch.device
    retrieve: Callable[[str | None], tuple[dict[str, Any], bool]]
    """``SvgOptimizationSettings.retrieve``."""


class OptimizableElement:
    """An element, its children, and the optimisers of what is optimised of it."""

    def __init__(self, context: Context, element: Element) -> None:
        self._context, self._element = context, element
        self._settings = context.retrieve(element.get("id"))[0]
        self._style = context.document.style_of(element)
        self.children = [OptimizableElement(context, child) for child in drawn_children(element)]
        self.optimizers: list[BoundedOptimizer] = []
        self.transform = None
        text = self._style["transform"]
        if text not in {"", "none"}:
            matrix = torch.tensor(parse_transform(text)).float()
            self.transform = OptimizableTransform(matrix, self._settings["transforms"]).to(context.device)
            self.optimizers += self.transform.optimizers(self._settings)
        self.opacity = self._opacity("opacity")
        self.paths: list[Path] = []
        if name_of(element) in DRAWN:
            self._read_shape()

    def _opacity(self, name: str) -> Tensor:
        """Return an opacity, shape (1,), optimised where the element sets it."""
        value = torch.tensor([fraction(self._style[name])], device=self._context.device)
        if name in self._element.attrib and self._settings["optimize_alpha"]:
            self.optimizers.append(optimized(self._settings, [value], self._settings["alpha_lr"], COLORS))
        return value

    def _read_shape(self) -> None:
        viewport, device = self._context.viewport, self._context.device
        data = outline(name_of(self._element), self._element.attrib, viewport)
        subpaths = cubics(data, keep_dots=False)
        width = length(self._style["stroke-width"], viewport.diagonal, "stroke-width") or 0.0
        half = torch.tensor(width / 2, device=device)
        self.paths = [path_of(subpath) for subpath in subpaths]
        for path in self.paths:
            path.points, path.stroke_width = path.points.to(device), half
        chosen = self._settings["paths"]
        if chosen["optimize_points"]:
            points = [path.points for path in self.paths]
            self.optimizers.append(optimized(self._settings, points, chosen["shape_lr"]))
        self._opacities = [self._opacity(f"{name}-opacity") for name in ("fill", "stroke")]
        self._paints = [self._paint(name, subpaths) for name in ("fill", "stroke")]

    def _paint(self, name: str, subpaths: list[Subpath]) -> Tensor | OptimizableGradient | None:
        document, viewport, device, retrieve = self._context
        text = self._style[name]
        paint = resolve_paint(text, self._style, document, viewport, subpaths, torch.eye(3).numpy())
        if isinstance(paint, FlatColor):
            color = torch.tensor(paint.color, device=device)
            if self._settings["optimize_color"]:
                self.optimizers.append(optimized(self._settings, [color], self._settings["color_lr"], COLORS))
            return color
        if isinstance(paint, Gradient):
            link = parse_link(text.strip())
            gradient = OptimizableGradient(paint, retrieve(link[0] if link else None)[0], device)
            self.optimizers += gradient.optimizers
            return gradient
        return None

    def build(self, matrix: Tensor, opacity: Tensor, shapes: list[Shape], groups: list[ShapeGroup]) -> None:
        """Append what the element draws to ``shapes`` and ``groups``.

        ``matrix``: from the parent's units to the canvas, shape (3, 3); ``opacity``: its own, shape (1,).
        """
        if self.transform is not None:
            matrix = matrix @ self.transform()
        opacity = opacity * self.opacity
        if self.paths:
            colors: list[Color] = []
            for paint, share in zip(self._paints, self._opacities, strict=True):
                if isinstance(paint, Tensor):
                    colors.append(torch.cat([paint, opacity * share]))
                else:
                    colors.append(paint.color(opacity * share, matrix) if paint else None)
            numbers = torch.arange(len(shapes), len(shapes) + len(self.paths))
            even_odd, name = self._style["fill-rule"] == "evenodd", self._element.get("id", "")
            groups.append(ShapeGroup(numbers, colors[0], even_odd, colors[1], matrix, name))
            shapes += self.paths
        for child in self.children:
            child.build(matrix, opacity, shapes, groups)

    def walk(self) -> Iterator[OptimizableElement]:
        """Yield the element and all elements inside it."""
        yield self
        for child in self.children:
            yield from child.walk()

    def write(self, element: Element, definitions: Element) -> None:
        """Write the current values into a copy of the element, and append gradients to ``definitions``."""
        for child, copied in zip(self.children, drawn_children(element), strict=True):
            child.write(copied, definitions)
        if self.transform is not None:
            set_property(element, "transform", self.transform.text())
        if element.get("opacity") is not None:
            set_property(element, "opacity", f"{float(self.opacity):.6g}")
        if not self.paths:
            return
        if self._settings["paths"]["optimize_points"]:
            element.tag = f"{{{NAMESPACE}}}path"
            element.set("d", " ".join(map(path_data, self.paths)))
        for name, paint in zip(("fill", "stroke"), self._paints, strict=True):
            if isinstance(paint, Tensor):
                set_property(element, name, rgb_text(paint))
            elif paint is not None:
                identity = f"{name}-{len(definitions)}"
                definitions.append(paint.element(identity))
                set_property(element, name, f"url(#{identity})")


def drawn_children(element: Element) -> list[ElementTree.Element]:
    """Return the children that draw something."""
    return [child for child in element if name_of(child) in GROUPS | DRAWN]


def set_property(element: Element, name: str, value: str) -> None:
    """Set a property as an attribute and in ``style``, which overrides style sheets."""
    parts = [part for part in element.get("style", "").split(";") if part.partition(":")[0].strip() != name]
    element.set(name, value)
    if name != "transform":
        element.set("style", ";".join([*filter(None, parts), f"{name}:{value}"]))
