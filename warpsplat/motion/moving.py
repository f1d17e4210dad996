"""Shapes of a run as moving elements of an SVG: SMIL moves them, new ones fade in, removed ones fade out.

Viewers interpolate path data with equal commands, so an element has as many points throughout as in the
beginning: a point that the run has removed lies between its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from warpsplat.motion.follow import track_shapes
from warpsplat.portable.sequences import interp
from warpsplat.scene import Basis, FloatArray, IndexArray, Kind, Paint, Scene
from warpsplat.scene.attributes import NO_DASHES, Cap, Join
from warpsplat.svg.commands import Pair, minus
from warpsplat.svg.data import integers, relative_smooth, spline_joints
from warpsplat.svg.numbers import hex_colors, number
from warpsplat.svg.write import OPACITY_DECIMALS, PAINTED, STROKE_ATTRIBUTES


class PathForm(NamedTuple):
    """Properties that stay the same while a shape moves."""

    kind: int
    basis: int
    rule: int
    closed: int


Value = tuple[FloatArray, str]
"""An attribute at a keyframe: its numbers, and its text."""


@dataclass
class MovingElement:
    """The element of a shape, from one keyframe to another."""

    key: int
    """First keyframe."""
    form: PathForm | None
    """None: it cannot move."""
    slots: IndexArray
    """Which of its points are those of the shape at the last keyframe, shape (point,)."""
    points: list[FloatArray] = field(default_factory=list)
    """By keyframe, shape (point, 2)."""
    values: dict[str, list[Value]] = field(default_factory=dict)
    """By attribute and keyframe."""
    end: int = 0
    """Last keyframe."""
    markup: str = ""
    """If it cannot move."""
    covers: bool = False
    """Whether it is nearly opaque."""
    continued: bool = False
    """Whether another element of the same shape follows."""


def moving_elements(
    scenes: Sequence[Scene], keys: Sequence[int], tick: float, units: float, static: Callable[[Scene], str]
) -> tuple[str, str]:
    """Return elements that move between keyframes, and their style sheet.

    Args:
        scenes: of the run, as their files show them, with little movement between two.
        keys: indices of the scenes that are keyframes, ascending.
        tick: time between two keyframes [s].
        units: width of the canvas in the elements' coordinates.
        static: returns the markup of a scene of shapes that cannot move, such as gradients.
    """
    scenes = [scene.drawn() for scene in scenes]
    numbers, order = track_shapes(scenes)
    elements: dict[int, list[MovingElement]] = {}
    for key, index in enumerate(keys):
        _add_keyframe(elements, key, scenes[index], numbers[index], units, static)
    ordered = [element for shape in order for element in elements.get(shape, ())]
    written = [_written(element, f"p{i}", tick, len(keys) - 1) for i, element in enumerate(ordered)]
    return "".join(text for text, _ in written), STYLE + "".join(rule for _, rule in written)


def _add_keyframe(
    elements: dict[int, list[MovingElement]],
    key: int,
    scene: Scene,
    numbers: IndexArray,
    units: float,
    static: Callable[[Scene], str],
) -> None:
    """Add a keyframe to the elements of each shape."""
    zoom = units / scene.canvas.width
    colors, movable = hex_colors(scene.colors), _movable(scene)
    twins = np.append(scene.twin[1:], 0)
    # Opacity from which an element stays until the next one of its shape is there. Translucent ones fade out
    # as the next fades in: two of them cover too much; but two fading opaque ones let the background shine
    # through.
    covering = 0.8
    for row in np.flatnonzero(scene.twin == 0).tolist():
        own = elements.setdefault(int(numbers[row]), [])
        if movable[row]:
            form, points = _form(scene, row), zoom * scene.points[scene.first[row] : scene.first[row + 1]]
            if not (own and _continues(own[-1], form, points)):
                _append(own, MovingElement(key, form, np.arange(len(points)), [points]))
            opacity = float(scene.opacities[row])
            for name, value in _attributes(scene, row, colors[row], zoom).items():
                own[-1].values.setdefault(name, []).append(value)
        else:
            markup = static(scene.take(np.arange(row, row + 1 + twins[row])))
            if not (own and own[-1].markup == markup):
                _append(own, MovingElement(key, None, np.zeros(0, np.intp), markup=markup))
            alone = scene.take(np.arange(row, row + 1))
            opacity = float(alone.opacities[0] * alone.stop_opacities.min(initial=1.0))
        own[-1].end, own[-1].covers = key, opacity >= covering


def _append(elements: list[MovingElement], element: MovingElement) -> None:
    if elements:
        elements[-1].continued = elements[-1].end == element.key - 1
    elements.append(element)


def _attributes(scene: Scene, row: int, color: str, zoom: float) -> dict[str, Value]:
    """Return a shape's colour, opacity and width as attributes."""
    kind = Kind(int(scene.kind[row]))
    opacity, width = scene.opacities[row : row + 1], zoom * scene.widths[row : row + 1]
    found = {
        PAINTED[kind]: (scene.colors[row], color),
        f"{PAINTED[kind]}-opacity": (opacity, number(float(opacity[0]), OPACITY_DECIMALS)),
    }
    if kind == Kind.STROKE:
        found["stroke-width"] = (width, number(float(width[0]), 1))
    return found


def _movable(scene: Scene) -> list[bool]:
    """Return which shapes have one contour and one colour and, if strokes, round ends and no dashes."""
    single = np.bincount(scene.contour_shapes(), minlength=len(scene)) == 1
    alone = (scene.twin == 0) & (np.append(scene.twin[1:], 0) == 0)
    rounded = (scene.cap == Cap.ROUND) & (scene.join == Join.ROUND) & (scene.dash == NO_DASHES)
    plain = (scene.kind == Kind.FILL) | rounded
    found: list[bool] = (single & alone & plain & (scene.paint == Paint.FLAT)).tolist()
    return found


def _form(scene: Scene, row: int) -> PathForm:
    contour = int(np.searchsorted(scene.starts, scene.first[row]))
    return PathForm(
        int(scene.kind[row]), int(scene.basis[row]), int(scene.rule[row]), int(scene.closed[contour])
    )


def _continues(element: MovingElement, form: PathForm, points: FloatArray) -> bool:
    """Make a shape's outline the next keyframe of an element; return False if it cannot be."""
    if element.form != form or len(points) > len(element.slots):
        return False
    if len(points) < len(element.slots):
        if form.basis == Basis.CUBIC:
            return False
        element.slots = element.slots[kept_points(element.points[-1][element.slots], points)]
    count = len(element.points[0])
    slots = element.slots
    if form.closed:
        slots = np.concatenate([slots[-1:] - count, slots, slots[:1] + count])
        points = np.concatenate([points[-1:], points, points[:1]])
    filled = [interp(np.arange(count), slots, column) for column in points.T]
    element.points.append(np.stack(filled, axis=1).astype(np.float32))
    return True


def kept_points(before: FloatArray, after: FloatArray) -> IndexArray:
    """Return which points of an outline remain in one with fewer: the nearest in total, in order.

    ``before``: shape (point, 2); ``after``: shape (kept, 2); the result: shape (kept,).
    """
    squares = ((after[:, None] - before) ** 2).sum(axis=2)
    # sums[i, j]: the least sum for the first points of both, where point i of ``after`` is j of ``before``.
    sums = np.full(squares.shape, np.inf)
    sums[0] = squares[0]
    for i in range(1, len(after)):
        sums[i, 1:] = squares[i, 1:] + np.minimum.accumulate(sums[i - 1])[:-1]
    found, end = np.zeros(len(after), np.intp), len(before)
    for i in reversed(range(len(after))):
        found[i] = end = int(np.argmin(sums[i, :end]))
    return found


# Markup.

TOLERANCE = {
    **dict.fromkeys(("fill", "stroke"), 6 / 255),
    **dict.fromkeys(("fill-opacity", "stroke-opacity"), 0.04),
    "stroke-width": 0.5,
}
"""Changes of attributes that are not shown, as each costs time: colour and opacity [0, 1], width [units]."""

STYLE = (
    "@keyframes i{from{fill-opacity:0;stroke-opacity:0}}@keyframes gi{from{opacity:0}}"
    "@keyframes o{to{fill-opacity:0;stroke-opacity:0}}@keyframes go{to{opacity:0}}"
)
"""How paths and groups fade in and out."""


def _written(element: MovingElement, name: str, tick: float, last: int) -> tuple[str, str]:
    """Return an element and the rule of its changes, of this ``name``; ``last``: the last keyframe.

    Paths move by SMIL, which all browsers support; colours and opacities change by style sheets, which take a
    third of the time.
    """
    group = "g" if element.form is None else ""
    animations, rule = [], ""

    def animate(rule_name: str, key: int, ticks: int, fill: str = "backwards") -> None:
        animations.append(f"{rule_name} {_seconds(ticks * tick)} linear {_seconds(key * tick)} {fill}")

    if changes := _changes(element.values):
        rule = f"@keyframes {name}{{{_steps(element.values, changes)}}}"
        animate(name, element.key + changes[0], changes[-1] - changes[0])
    if element.key:
        animate(f"{group}i", element.key - 1, 1)
    if element.end < last:
        waits = element.continued and element.covers
        animate(f"{group}o", element.end + waits, 1 - waits, "forwards")
    style = f' style="animation:{",".join(animations)}"' if animations else ""
    if element.form is None:
        return f"<g{style}>{element.markup}</g>\n", ""
    attributes = "".join(f' {name}="{values[-1][1]}"' for name, values in element.values.items())
    if element.form.kind == Kind.STROKE:
        attributes += f" {STROKE_ATTRIBUTES}"
    elif element.form.rule:
        attributes += ' fill-rule="evenodd"'
    data = [_path_data(points, element.form) for points in element.points]
    return _path(data, attributes + style, element.key, tick), rule


def _path(data: list[str], attributes: str, key: int, tick: float) -> str:
    """Return a path that moves from keyframe ``key`` on and waits at its first position while it fades in.

    Before and after, it has its last position: before, it is invisible, and finished animations cost no time.
    """
    head = f'<path d="{data[-1]}"{attributes}'
    if len(set(data)) == 1:
        return f"{head}/>\n"
    if key:
        key, data = key - 1, [data[0], *data]
    times = f'begin="{_seconds(key * tick)}" dur="{_seconds((len(data) - 1) * tick)}"'
    return f'{head}><animate attributeName="d" {times} values="{";".join(data)}"/></path>\n'


def _changes(values: dict[str, list[Value]]) -> list[int]:
    """Return keyframes at which an attribute has changed by more than its tolerance, and those before."""
    found: set[int] = set()
    for name, course in values.items():
        now = course[0][0]
        for i, (numbers, _) in enumerate(course[1:], 1):
            if np.abs(numbers - now).max() > TOLERANCE[name]:
                now = numbers
                found |= {i - 1, i}
    return sorted(found)


def _steps(values: dict[str, list[Value]], changes: list[int]) -> str:
    """Return the steps of a rule, with the attributes' final values at the last one."""
    first, length = changes[0], changes[-1] - changes[0]
    texts = []
    for i in changes:
        key = -1 if i == changes[-1] else i
        declarations = ";".join(f"{name}:{course[key][1]}" for name, course in values.items())
        texts.append(f"{number(100 * (i - first) / length, 1)}%{{{declarations}}}")
    return "".join(texts)


def _seconds(time: float) -> str:
    return f"{number(time, 3)}s"


def _path_data(points: FloatArray, form: PathForm) -> str:
    """Return path data whose commands depend only on the number of points."""
    spline = form.basis == Basis.SPLINE
    grid = [(x, y) for x, y in np.round(points / 2 if spline else points).astype(np.int64).tolist()]
    closed = bool(form.closed)
    text = relative_smooth(*spline_joints(grid, closed)) if spline else _relative_cubics(grid, closed)
    return f"{text}z" if closed else text


def _relative_cubics(grid: list[Pair], closed: bool) -> str:
    """Return relative cubics, without the command that closes a ring."""
    chain = [*grid, grid[0]] if closed else grid
    steps = [minus(point, chain[i // 3 * 3]) for i, point in enumerate(chain[1:])]
    return f"M{integers(grid[:1])}c{integers(steps)}"
