"""Shapes and groups -> an SVG file that looks as they render."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path as FilePath
from xml.etree import ElementTree

import numpy as np
import torch

from warpsplat.files.output import write_atomically
from warpsplat.pydiffvg.arguments import serialize
from warpsplat.pydiffvg.assemble import assemble
from warpsplat.pydiffvg.color import Color, LinearGradient, RadialGradient
from warpsplat.pydiffvg.layout import make_layout
from warpsplat.pydiffvg.shape import Circle, Ellipse, Path, Polygon, Rect, Shape, ShapeGroup
from warpsplat.scene import Cap, Join

Tensor = torch.Tensor
Element = ElementTree.Element
GAMMA = 1 / 2.2


def save_svg(
    filename: str | FilePath,
    width: int,
    height: int,
    shapes: Sequence[Shape],
    shape_groups: Sequence[ShapeGroup],
    use_gamma: bool = False,
    background: str | None = None,
) -> None:
    """Write a scene, see ``RenderFunction.serialize_scene``, as an SVG file; missing folders are made.

    ``use_gamma``: whether viewers raise all colours to the power 1 / 2.2, as ``imwrite`` does;
    ``background``: style of the root element, as ``background: #fff``, for browsers, as in LIVE's copy.
    """
    root = ElementTree.Element(
        "svg",
        {"version": "1.1", "xmlns": "http://www.w3.org/2000/svg", "width": str(width), "height": str(height)},
    )
    if background is not None:
        root.set("style", background)
    definitions = ElementTree.SubElement(root, "defs")
    drawing = ElementTree.SubElement(root, "g")
    if use_gamma:
        _add_gamma(definitions)
        drawing.set("style", "filter:url(#gamma)")
    with torch.no_grad():
        for number, group in enumerate(shape_groups):
            _Group(definitions, drawing, number, group).write([shapes[int(i)] for i in group.shape_ids])
    ElementTree.indent(root)
    path = FilePath(filename)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def prettify(elem: Element) -> str:
    """Return an XML element as indented text."""
    copied = copy.deepcopy(elem)
    ElementTree.indent(copied)
    return ElementTree.tostring(copied, encoding="unicode", xml_declaration=True)


def _add_gamma(definitions: Element) -> None:
    box = {"x": "0", "y": "0", "width": "100%", "height": "100%"}
    found = ElementTree.SubElement(definitions, "filter", {"id": "gamma", **box})
    transfer = ElementTree.SubElement(found, "feComponentTransfer", {"color-interpolation-filters": "sRGB"})
    for channel in "RGBA":
        values = {"type": "gamma", "amplitude": "1", "exponent": str(GAMMA)}
        ElementTree.SubElement(transfer, f"feFunc{channel}", values)


class _Group:
    """Writes a group."""

    def __init__(self, definitions: Element, drawing: Element, number: int, group: ShapeGroup) -> None:
        self._definitions, self._drawing, self._number, self._group = definitions, drawing, number, group
        self._matrix = group.shape_to_canvas.detach().cpu().double().numpy()

    def write(self, shapes: list[Shape]) -> None:
        """Write one element, or where widths differ one for the fill and one for each stroke."""
        fill, stroke = self._group.fill_color, self._group.stroke_color
        widths = {float(s.stroke_width) if s.stroke_width.numel() == 1 else None for s in shapes}
        if stroke is None or (len(widths) == 1 and widths != {None}):
            self._add_shapes(shapes, fill, stroke)
            return
        if fill is not None:
            self._add_shapes(shapes, fill, None)
        for shape in shapes:
            if shape.stroke_width.numel() > 1:
                self._add_area(shape)
            else:
                self._add_shapes([shape], None, stroke)

    def _add_shapes(self, shapes: list[Shape], fill: Color, stroke: Color) -> None:
        if not shapes:
            return
        tag, attributes = "path", {"d": "".join(map(path_data, shapes))}
        if len(shapes) == 1:
            tag, attributes = _element(shapes[0])
        attributes["fill"] = "none"
        if fill is not None:
            attributes |= self._paint(fill, "fill")
            attributes["fill-rule"] = "evenodd" if self._group.use_even_odd_rule else "nonzero"
        if stroke is not None:
            attributes |= self._paint(stroke, "stroke")
            attributes |= {"stroke-width": _text([2 * float(shapes[0].stroke_width)]), **self._line()}
        self._add(tag, attributes)

    def _add_area(self, shape: Shape) -> None:
        """Write a stroke whose width changes as the area that it covers."""
        alone = ShapeGroup(torch.tensor([0]), None, stroke_color=torch.ones(4))
        scene = serialize(1, 1, [shape], [alone], torch.device("cpu"))
        layout = make_layout(scene.structure, (1, 1), True, torch.device("cpu"))
        points, data = assemble(scene, layout)["points"].tolist(), ""
        for start, end in pairwise(layout.scene.starts):
            first, *rest = [*points[start:end], points[start]]
            data += f"M{_text(first)}C{_text(x for point in rest for x in point)}Z"
        self._add("path", {"d": data, **self._paint(self._group.stroke_color, "fill")})

    def _add(self, tag: str, attributes: dict[str, str]) -> None:
        if not np.array_equal(self._matrix, np.eye(3)):
            attributes["transform"] = f"matrix({_text(self._matrix[:2].T.ravel())})"
        if self._group.id:
            attributes["id"] = str(self._group.id)
        ElementTree.SubElement(self._drawing, tag, attributes)

    def _line(self) -> dict[str, str]:
        line = self._group.line
        if line is None:
            return {"stroke-linecap": "round", "stroke-linejoin": "round"}
        attributes = {
            "stroke-linecap": Cap(line.cap).name.lower(),
            "stroke-linejoin": Join(line.join).name.lower(),
            "stroke-miterlimit": _text([line.miter_limit]),
        }
        if line.dashes:
            attributes["stroke-dashoffset"] = _text(line.dashes[:1])
            attributes["stroke-dasharray"] = _text(line.dashes[1:])
        return attributes

    def _paint(self, color: Color, name: str) -> dict[str, str]:
        if isinstance(color, Tensor):
            return {name: rgb_text(color), f"{name}-opacity": _text(color[3:].clamp(0, 1))}
        assert color is not None
        identity = f"shape_{self._number}_{name}"
        self._definitions.append(gradient_element(identity, color, self._matrix))
        return {name: f"url(#{identity})"}


def gradient_element(identity: str, color: LinearGradient | RadialGradient, matrix: np.ndarray) -> Element:
    """Return the element of a gradient on the canvas.

    ``matrix``: from the painted shapes' units to the canvas, shape (3, 3).
    """
    if isinstance(color, LinearGradient):
        tag, own = "linearGradient", np.eye(3)
        attributes = _attributes("x1 y1 x2 y2", [*color.begin, *color.end])
    else:
        # The unit circle under a transform: SVG's gradients have one radius.
        tag, attributes = "radialGradient", _attributes("cx cy r", [0.0, 0.0, 1.0])
        own = np.diag([*color.radius.tolist(), 1.0])
        own[:2, 2] = color.center.tolist()
    attributes |= {"id": identity, "gradientUnits": "userSpaceOnUse"}
    placed = np.linalg.pinv(matrix) @ own
    if not np.array_equal(placed, np.eye(3)):
        attributes["gradientTransform"] = f"matrix({_text(placed[:2].T.ravel())})"
    element = ElementTree.Element(tag, attributes)
    for offset, stop in zip(color.offsets, color.stop_colors, strict=True):
        look = {"stop-color": rgb_text(stop), "stop-opacity": _text(stop[3:].clamp(0, 1))}
        ElementTree.SubElement(element, "stop", {"offset": _text([offset]), **look})
    return element


def rgb_text(color: Tensor) -> str:
    """Return the value of a colour of shape (3,) or (4,), without its opacity."""
    return "rgb({}, {}, {})".format(*(round(255 * value) for value in color[:3].clamp(0, 1).tolist()))


def path_data(shape: Shape) -> str:
    """Return a shape's path data."""
    if isinstance(shape, Path):
        points, at = shape.points.tolist(), 1
        data = f"M {_text(points[0])}"
        for count in shape.num_control_points.tolist():
            own = [points[(at + i) % len(points)] for i in range(count + 1)]
            data += f" {'LQC'[count]} {_text(x for point in own for x in point)}"
            at += count + 1
        return data + (" Z" if shape.is_closed else "")
    if isinstance(shape, Polygon):
        return f"M {_text(shape.points.flatten())}" + (" Z" if shape.is_closed else "")
    if isinstance(shape, Rect):
        (x, y), (right, bottom) = shape.p_min.tolist(), shape.p_max.tolist()
        return f"M {_text([x, y])} H {_text([right])} V {_text([bottom])} H {_text([x])} Z"
    (x, y), (rx, ry) = shape.center.tolist(), shape.radius.expand(2).tolist()
    arc = f"A {_text([rx, ry])} 0 0 1"
    return f"M {_text([x + rx, y])} {arc} {_text([x - rx, y])} {arc} {_text([x + rx, y])} Z"


def _element(shape: Shape) -> tuple[str, dict[str, str]]:
    """Return the tag and the geometry attributes of a shape's own element."""
    if isinstance(shape, Circle):
        return "circle", _attributes("cx cy r", [*shape.center, float(shape.radius)])
    if isinstance(shape, Ellipse):
        return "ellipse", _attributes("cx cy rx ry", [*shape.center, *shape.radius])
    if isinstance(shape, Rect):
        return "rect", _attributes("x y width height", [*shape.p_min, *(shape.p_max - shape.p_min)])
    if isinstance(shape, Polygon):
        return "polygon" if shape.is_closed else "polyline", {"points": _text(shape.points.flatten())}
    return "path", {"d": path_data(shape)}


def _attributes(names: str, values: Iterable[float | Tensor]) -> dict[str, str]:
    return {name: _text([value]) for name, value in zip(names.split(), values, strict=True)}


def _text(values: Iterable[float | Tensor]) -> str:
    return " ".join(f"{float(value):.7g}" for value in values)
