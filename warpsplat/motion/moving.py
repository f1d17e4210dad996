"""Write the shapes of a run as animated elements of an SVG (SMIL): those that persist move, others fade in or
out.

Path data are interpolated by viewers where their commands are the same, so that a shape has as many points
throughout as in the beginning: where the run has removed one, it lies between its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from warpsplat.motion.follow import lives
from warpsplat.portable.sequences import interp
from warpsplat.scene import Basis, FloatArray, IndexArray, Kind, Paint, Scene
from warpsplat.scene.attributes import NO_DASHES, Cap, Join
from warpsplat.svg.data import even_cubic_data, even_spline_data
from warpsplat.svg.numbers import hex_colors, number
from warpsplat.svg.write import OPACITY_DECIMALS, PAINTED, STROKE_ATTRIBUTES

Form = tuple[int, int, int, int]
"""Properties that are fixed while a shape moves: kind, basis, rule, closed."""


class Value(NamedTuple):
    """Of an attribute."""

    numbers: FloatArray
    """As they are."""
    text: str
    """As it is written."""


@dataclass
class Piece:
    """A life, or a part of one, as an element."""

    key: int
    """The first one that it is in."""
    form: Form | None
    """None: it stays where it is."""
    slots: IndexArray
    """Which of its points are those of the shape as it is now, shape (point,)."""
    points: list[FloatArray] = field(default_factory=list)
    """By key, shape (point, 2)."""
    values: dict[str, list[Value]] = field(default_factory=dict)
    """Of its attributes, by key."""
    end: int = 0
    """The last key that it is in."""
    markup: str = ""
    """Of what stays."""
    covers: bool = False
    """Whether nearly nothing is seen through it."""
    followed: bool = False
    """Whether its life goes on in another piece."""


def elements(
    scenes: Sequence[Scene], keys: Sequence[int], tick: float, units: float, still: Callable[[Scene], str]
) -> tuple[str, str]:
    """What moves from each of the scenes ``keys`` to the next one, as elements and their style sheet.

    Args:
        scenes: of the run, as their files have them, without gaps in which shapes move far.
        keys: indices of those that are shown, ascending.
        tick: time from one of them to the next [s].
        units: of the elements' coordinates that a canvas is wide.
        still: the markup of a scene of shapes that cannot move, as gradients: what is to be shown from one
            key to the next.
    """
    followed = lives(scenes)
    pieces: dict[int, list[Piece]] = {}
    for key, index in enumerate(keys):
        _add(pieces, key, scenes[index], followed.numbers[index], units, still)
    ordered = [piece for life in followed.order for piece in pieces.get(life, ())]
    made = [_element(piece, f"p{i}", tick, len(keys) - 1) for i, piece in enumerate(ordered)]
    return "".join(element for element, _ in made), STYLE + "".join(rule for _, rule in made)


def _add(
    pieces: dict[int, list[Piece]],
    key: int,
    scene: Scene,
    numbers: IndexArray,
    units: float,
    still: Callable[[Scene], str],
) -> None:
    """The shapes of a key, each behind what its life has so far."""
    zoom = units / scene.canvas.width
    colors, movable = hex_colors(scene.colors), _movable(scene)
    twins = np.append(scene.twin[1:], 0)
    for row in np.flatnonzero(scene.twin == 0).tolist():
        life = pieces.setdefault(int(numbers[row]), [])
        if not movable[row]:
            markup = still(scene.take(np.arange(row, row + 1 + twins[row])))
            if not (life and life[-1].markup == markup):
                _begin(life, Piece(key, None, np.zeros(0, np.intp), markup=markup))
            life[-1].end, life[-1].covers = key, _opacity(scene, row) >= COVERING
            continue
        form, points = _form(scene, row), zoom * scene.points[scene.first[row] : scene.first[row + 1]]
        if not (life and _goes_on(life[-1], form, points)):
            _begin(life, Piece(key, form, np.arange(len(points)), [points]))
        life[-1].end, life[-1].covers = key, bool(scene.opacities[row] >= COVERING)
        for name, value in _look(scene, row, colors[row], zoom).items():
            life[-1].values.setdefault(name, []).append(value)


def _begin(life: list[Piece], piece: Piece) -> None:
    if life:
        life[-1].followed = life[-1].end == piece.key - 1
    life.append(piece)


COVERING = 0.8
"""Opacity from which on it is better that a piece stays below the next one until that is there, than that one
goes as the other comes: then more of what is behind them would be seen than of translucent ones too little.
"""


def _opacity(scene: Scene, row: int) -> float:
    """Of a shape where it is most translucent."""
    own = scene.take(np.arange(row, row + 1))
    return float(own.opacities[0] * own.stop_opacities.min(initial=1.0))


def _look(scene: Scene, row: int, color: str, zoom: float) -> dict[str, Value]:
    """What a shape looks like, besides its outline."""
    kind = Kind(int(scene.kind[row]))
    opacity, width = scene.opacities[row : row + 1], zoom * scene.widths[row : row + 1]
    found = {
        PAINTED[kind]: Value(scene.colors[row], color),
        f"{PAINTED[kind]}-opacity": Value(opacity, number(float(opacity[0]), OPACITY_DECIMALS)),
    }
    return found | ({"stroke-width": Value(width, number(float(width[0]), 1))} if kind == Kind.STROKE else {})


def _movable(scene: Scene) -> list[bool]:
    """Which shapes are plain: of one contour and one colour, strokes round and whole."""
    single = np.bincount(scene.contour_shapes(), minlength=len(scene)) == 1
    alone = (scene.twin == 0) & (np.append(scene.twin[1:], 0) == 0)
    rounded = (scene.cap == Cap.ROUND) & (scene.join == Join.ROUND) & (scene.dash == NO_DASHES)
    plain = (scene.kind == Kind.FILL) | rounded
    found: list[bool] = (single & alone & plain & (scene.paint == Paint.FLAT)).tolist()
    return found


def _form(scene: Scene, row: int) -> Form:
    contour = int(np.searchsorted(scene.starts, scene.first[row]))
    return int(scene.kind[row]), int(scene.basis[row]), int(scene.rule[row]), int(scene.closed[contour])


def _goes_on(piece: Piece, form: Form, points: FloatArray) -> bool:
    """Whether a shape can be the next place of a piece; if so, it is that now."""
    if piece.form != form or len(points) > len(piece.slots):
        return False
    if len(points) < len(piece.slots):
        if form[1] == Basis.CUBIC:
            return False
        piece.slots = piece.slots[kept_points(piece.points[-1][piece.slots], points)]
    count = len(piece.points[0])
    slots = piece.slots
    if form[3]:
        slots = np.concatenate([slots[-1:] - count, slots, slots[:1] + count])
        points = np.concatenate([points[-1:], points, points[:1]])
    filled = [interp(np.arange(count), slots, column) for column in points.T]
    piece.points.append(np.stack(filled, axis=1).astype(np.float32))
    return True


def kept_points(before: FloatArray, after: FloatArray) -> IndexArray:
    """Which points of an outline are those of one with fewer, in their order: the nearest in all.

    Args:
        before: shape (point, 2).
        after: shape (kept, 2).

    Returns:
        shape (kept,).
    """
    apart = ((after[:, None] - before) ** 2).sum(axis=2)
    # Of the first points of either: the least sum in which the last one of ``after`` is that of the column.
    sums = np.full(apart.shape, np.inf)
    sums[0] = apart[0]
    for i in range(1, len(after)):
        sums[i, 1:] = apart[i, 1:] + np.minimum.accumulate(sums[i - 1])[:-1]
    found, end = np.zeros(len(after), np.intp), len(before)
    for i in reversed(range(len(after))):
        found[i] = end = int(np.argmin(sums[i, :end]))
    return found


# Elements.

TOLERANCE = {
    **dict.fromkeys(("fill", "stroke"), 6 / 255),
    **dict.fromkeys(("fill-opacity", "stroke-opacity"), 0.04),
    "stroke-width": 0.5,
}
"""By which attributes may lag behind the run's: colours, opacities, units. Only what changes costs time."""

STYLE = (
    "@keyframes i{from{fill-opacity:0;stroke-opacity:0}}@keyframes gi{from{opacity:0}}"
    "@keyframes o{to{fill-opacity:0;stroke-opacity:0}}@keyframes go{to{opacity:0}}"
)
"""How paths, and groups, come and go."""


def _element(piece: Piece, name: str, tick: float, last: int) -> tuple[str, str]:
    """An element, and the rule of how it changes.

    Paths move by SMIL, which all browsers know; colours and opacities change by style sheets, which take a
    third of the time.

    Args:
        piece: what it is.
        name: of the rule.
        tick: from a key to the next [s].
        last: number of the last key.
    """
    group = "g" if piece.form is None else ""
    plays, rule = [], ""
    if changes := _changes(piece.values):
        first, end = changes[0], changes[-1]
        rule = f"@keyframes {name}{{{_steps(piece.values, changes)}}}"
        plays.append(_play(name, piece.key + first, end - first, tick, "backwards"))
    if piece.key:
        plays.append(_play(f"{group}i", piece.key - 1, 1, tick, "backwards"))
    if piece.end < last and piece.followed and piece.covers:
        plays.append(_play(f"{group}o", piece.end + 1, 0, tick, "forwards"))
    elif piece.end < last:
        plays.append(_play(f"{group}o", piece.end, 1, tick, "forwards"))
    style = f' style="animation:{",".join(plays)}"' if plays else ""
    if piece.form is None:
        return f"<g{style}>{piece.markup}</g>\n", ""
    attributes = "".join(f' {name}="{values[-1].text}"' for name, values in piece.values.items())
    kind, _, evenodd, _ = piece.form
    more = f" {STROKE_ATTRIBUTES}" if kind == Kind.STROKE else ' fill-rule="evenodd"' if evenodd else ""
    return _path(
        [_data(points, piece.form) for points in piece.points], attributes + more + style, piece.key, tick
    ), rule


def _path(data: list[str], attributes: str, key: int, tick: float) -> str:
    """A path that moves from a key on; while it comes, before that, it is where it is first. Before and after
    it has its last place: before, it is not seen, and animations that are over cost no time.
    """
    head = f'<path d="{data[-1]}"{attributes}'
    if len(set(data)) == 1:
        return f"{head}/>\n"
    if key:
        key, data = key - 1, [data[0], *data]
    times = f'begin="{_seconds(key * tick)}" dur="{_seconds((len(data) - 1) * tick)}"'
    return f'{head}><animate attributeName="d" {times} values="{";".join(data)}"/></path>\n'


def _changes(values: dict[str, list[Value]]) -> list[int]:
    """Keys of the piece at which attributes have left what they were by more than their tolerance, and those
    before them.
    """
    found: set[int] = set()
    for name, course in values.items():
        now = course[0].numbers
        for i, value in enumerate(course[1:], 1):
            if np.abs(value.numbers - now).max() > TOLERANCE[name]:
                now = value.numbers
                found |= {i - 1, i}
    return sorted(found)


def _steps(values: dict[str, list[Value]], changes: list[int]) -> str:
    first, length = changes[0], changes[-1] - changes[0]
    texts = []
    for i in changes:
        share = number(100 * (i - first) / length, 1)
        said = ";".join(
            f"{name}:{course[-1 if i == changes[-1] else i].text}" for name, course in values.items()
        )
        texts.append(f"{share}%{{{said}}}")
    return "".join(texts)


def _play(name: str, key: int, ticks: int, tick: float, fill: str) -> str:
    """Of a rule, from a key on for some ticks."""
    return f"{name} {_seconds(ticks * tick)} linear {_seconds(key * tick)} {fill}"


def _seconds(time: float) -> str:
    return f"{number(time, 3)}s"


def _data(points: FloatArray, form: Form) -> str:
    """Of an outline, with commands that depend on the number of its points alone."""
    kind, basis, _, closed = form
    spline = basis == Basis.SPLINE
    grid = [(x, y) for x, y in np.round(points / 2 if spline else points).astype(np.int64).tolist()]
    text = even_spline_data(grid, bool(closed)) if spline else even_cubic_data(grid, bool(closed))
    return f"{text}z" if closed and kind == Kind.STROKE else text
