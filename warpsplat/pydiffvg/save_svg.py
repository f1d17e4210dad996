"""Shapes and groups -> an SVG file that shows what they render as."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from pathlib import Path as FilePath
from xml.etree import ElementTree

import numpy as np
import torch

from warpsplat.files.output import write_atomically
from warpsplat.pydiffvg.arguments import take_down
from warpsplat.pydiffvg.color import Color, LinearGradient, RadialGradient
from warpsplat.pydiffvg.layout import segments_of
from warpsplat.pydiffvg.shape import Circle, Ellipse, Path, Polygon, Rect, Shape, ShapeGroup
from warpsplat.pydiffvg.tapered import ring_points
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
    """Write a scene as an SVG file.

    Args:
        filename: the file.
        width: of the canvas.
        height: of the canvas.
        shapes: see ``RenderFunction.serialize_scene``.
        shape_groups: the same.
        use_gamma: whether viewers raise all that is drawn to 1 / 2.2, as ``imwrite`` does.
        background: style of the whole, as ``background: #fff``, for browsers, as in LIVE's copy of DiffVG.
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
        _gamma(definitions)
        drawing.set("style", "filter:url(#gamma)")
    with torch.no_grad():
        for number, group in enumerate(shape_groups):
            _Group(definitions, drawing, number, group, [shapes[int(i)] for i in group.shape_ids]).write()
    ElementTree.indent(root)
    path = FilePath(filename)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def prettify(elem: Element) -> str:
    """An XML element as indented text."""
    copied = copy.deepcopy(elem)
    ElementTree.indent(copied)
    return ElementTree.tostring(copied, encoding="unicode", xml_declaration=True)


def _gamma(definitions: Element) -> None:
    box = {"x": "0", "y": "0", "width": "100%", "height": "100%"}
    found = ElementTree.SubElement(definitions, "filter", {"id": "gamma", **box})
    transfer = ElementTree.SubElement(found, "feComponentTransfer", {"color-interpolation-filters": "sRGB"})
    for channel in "RGBA":
        values = {"type": "gamma", "amplitude": "1", "exponent": str(GAMMA)}
        ElementTree.SubElement(transfer, f"feFunc{channel}", values)


def _text(values: Iterable[float]) -> str:
    return " ".join(f"{float(value):.7g}" for value in values)


class _Group:
    """Writes a group."""

    def __init__(
        self, definitions: Element, drawing: Element, number: int, group: ShapeGroup, shapes: list[Shape]
    ) -> None:
        self._definitions, self._drawing, self._number = definitions, drawing, number
        self._group, self._shapes = group, shapes
        self._matrix = group.shape_to_canvas.detach().cpu().double().numpy()

    def write(self) -> None:
        """One element; where widths differ, one for the fill and one for each stroke."""
        group, shapes = self._group, self._shapes
        tapered = [s for s in shapes if s.stroke_width.numel() > 1]
        widths = {float(s.stroke_width) for s in shapes if s.stroke_width.numel() == 1}
        has_stroke = group.stroke_color is not None
        if not has_stroke or (not tapered and len(widths) == 1):
            self._element(shapes, group.fill_color, group.stroke_color)
            return
        if group.fill_color is not None:
            self._element(shapes, group.fill_color, None)
        for shape in shapes:
            if shape.stroke_width.numel() > 1:
                self._area(shape)
            else:
                self._element([shape], None, group.stroke_color)

    def _element(self, shapes: list[Shape], fill: Color, stroke: Color) -> None:
        if not shapes:
            return
        tag, attributes = (
            _form(shapes[0]) if len(shapes) == 1 else ("path", {"d": "".join(map(path_data, shapes))})
        )
        attributes["fill"] = "none"
        if fill is not None:
            attributes |= self._paint(fill, "fill")
            attributes["fill-rule"] = "evenodd" if self._group.use_even_odd_rule else "nonzero"
        if stroke is not None:
            attributes |= self._paint(stroke, "stroke")
            attributes |= {"stroke-width": _text([2 * float(shapes[0].stroke_width)]), **self._line()}
        self._add(tag, attributes)

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
        said = {
            "stroke-linecap": Cap(line.cap).name.lower(),
            "stroke-linejoin": Join(line.join).name.lower(),
            "stroke-miterlimit": _text([line.miter_limit]),
        }
        if line.dashes:
            said |= {"stroke-dashoffset": _text(line.dashes[:1]), "stroke-dasharray": _text(line.dashes[1:])}
        return said

    def _area(self, shape: Shape) -> None:
        """A stroke whose width changes, as a fill."""
        scene = take_down(1, 1, [shape], [], torch.device("cpu"))
        form = scene.structure.forms[0]
        points, width = scene.tensors
        blend = segments_of(form, False)
        index, weight = torch.from_numpy(blend.which), torch.from_numpy(blend.weight)
        segments = (weight[..., None] * points[index]).sum(dim=-2)
        radii = (weight * width[index]).sum(dim=-1)
        data = ""
        for ring in ring_points(segments[None], radii[None], form.closed):
            first, *rest = torch.cat([ring[:, 0], ring[:1, 0]]).tolist()
            data += f"M{_text(first)}C{_text(x for point in rest for x in point)}Z"
        self._add("path", {"d": data, **self._paint(self._group.stroke_color, "fill")})

    def _paint(self, color: Color, name: str) -> dict[str, str]:
        if isinstance(color, Tensor):
            return {name: rgb_text(color), f"{name}-opacity": _text(color[3:].clamp(0, 1))}
        assert color is not None
        identity = f"shape_{self._number}_{name}"
        self._definitions.append(gradient_element(identity, color, self._matrix))
        return {name: f"url(#{identity})"}


UNIT = {"cx": 0.0, "cy": 0.0, "r": 1.0}


def gradient_element(identity: str, color: LinearGradient | RadialGradient, matrix: np.ndarray) -> Element:
    """A gradient on the canvas as an element, for shapes whose units ``matrix`` maps to the canvas."""
    if isinstance(color, LinearGradient):
        tag, own = "linearGradient", np.eye(3)
        numbers = dict(zip(("x1", "y1", "x2", "y2"), [*color.begin, *color.end], strict=True))
    else:
        # The unit circle, which a transform stretches: SVG's gradients have one radius.
        tag, numbers = "radialGradient", {name: torch.tensor(value) for name, value in UNIT.items()}
        own = np.diag([*color.radius.tolist(), 1.0])
        own[:2, 2] = color.center.tolist()
    placed = np.linalg.pinv(matrix) @ own
    attributes = {key: _text([value]) for key, value in numbers.items()}
    attributes |= {"id": identity, "gradientUnits": "userSpaceOnUse"}
    if not np.array_equal(placed, np.eye(3)):
        attributes["gradientTransform"] = f"matrix({_text(placed[:2].T.ravel())})"
    element = ElementTree.Element(tag, attributes)
    for offset, stop in zip(color.offsets, color.stop_colors, strict=True):
        said = {"stop-color": rgb_text(stop), "stop-opacity": _text(stop[3:].clamp(0, 1))}
        ElementTree.SubElement(element, "stop", {"offset": _text([offset]), **said})
    return element


def rgb_text(color: Tensor) -> str:
    """A colour's value, shape (3,) or (4,), without the opacity."""
    return "rgb({}, {}, {})".format(*(round(255 * value) for value in color[:3].clamp(0, 1).tolist()))


def _form(shape: Shape) -> tuple[str, dict[str, str]]:
    """Element of a shape, and what says its form."""
    if isinstance(shape, Circle):
        x, y = shape.center
        return "circle", {"cx": _text([x]), "cy": _text([y]), "r": _text([float(shape.radius)])}
    if isinstance(shape, Ellipse):
        values = [*shape.center, *shape.radius]
        return "ellipse", {n: _text([v]) for n, v in zip(("cx", "cy", "rx", "ry"), values, strict=True)}
    if isinstance(shape, Rect):
        values = [*shape.p_min, *(shape.p_max - shape.p_min)]
        return "rect", {n: _text([v]) for n, v in zip(("x", "y", "width", "height"), values, strict=True)}
    if isinstance(shape, Polygon):
        return "polygon" if shape.is_closed else "polyline", {"points": _text(shape.points.flatten())}
    return "path", {"d": path_data(shape)}


COMMANDS = "LQC"


def path_data(shape: Shape) -> str:
    """Path data of a shape."""
    if isinstance(shape, Path):
        points, counts = shape.points.tolist(), shape.num_control_points.tolist()
        data, at = f"M {_text(points[0])}", 1
        for count in counts:
            own = [points[(at + i) % len(points)] for i in range(count + 1)]
            data += f" {COMMANDS[count]} {_text(x for point in own for x in point)}"
            at += count + 1
        return data + (" Z" if shape.is_closed else "")
    first, second, *_ = take_down(1, 1, [shape], [], torch.device("cpu")).tensors
    if isinstance(shape, Polygon):
        return f"M {_text(shape.points.flatten())}" + (" Z" if shape.is_closed else "")
    if isinstance(shape, Rect):
        (x, y), (right, bottom) = first.tolist(), second.tolist()
        return f"M {_text([x, y])} H {_text([right])} V {_text([bottom])} H {_text([x])} Z"
    (x, y), (across, down) = first.tolist(), second.expand(2).tolist()
    arc = f"A {_text([across, down])} 0 0 1"
    return f"M {_text([x + across, y])} {arc} {_text([x - across, y])} {arc} {_text([x + across, y])} Z"
