"""Outlines as the path data with the fewest characters (SVG 1.1, 8.3).

A segment may be written in several ways: relative or absolute, level and upright lines by one number, a cubic
whose first handle mirrors the one before without it; and a command equal to the one before needs no letter.
The shortest text is found by dynamic programming over the last letter.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

Pair = tuple[int, int]


class Segment(NamedTuple):
    """A piece of an outline, in whole numbers."""

    start: Pair
    handles: tuple[Pair, Pair] | None
    """None: a line."""
    end: Pair

    def has_extent(self) -> bool:
        """Return whether it is more than a point."""
        return self.end != self.start or self.handles not in (None, (self.start, self.start))

    def mirrored(self) -> Pair:
        """Return the first handle of a smooth cubic that follows."""
        if self.handles is None:
            return self.end
        (x, y), (u, v) = self.end, self.handles[1]
        return 2 * x - u, 2 * y - v


_Written = tuple[int, str, "_Written | None"]
"""The length of path data so far, what was added last, and what is before: nothing long is copied."""


def _text(written: _Written | None) -> str:
    """Return path data."""
    parts = []
    while written:
        _, added, written = written
        parts.append(added)
    return "".join(reversed(parts))


def plus(a: Pair, b: Pair) -> Pair:
    """Return the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1]


def minus(a: Pair, b: Pair) -> Pair:
    """Return the vector from ``b`` to ``a``."""
    return a[0] - b[0], a[1] - b[1]


def row(numbers: Sequence[int], separated: bool) -> str:
    """Return numbers with the fewest separators; ``separated``: also before the first."""
    text = " ".join(map(str, numbers)).replace(" -", "-")  # a sign separates
    return f" {text}" if separated and numbers[0] >= 0 else text


IMPLIED = {"M": "L", "m": "l"}
"""The commands that pairs after a move stand for (SVG 1.1, 8.3.2)."""


def choices(segment: Segment, mirrored: Pair) -> list[tuple[str, tuple[int, ...]]]:
    """Return the commands that draw ``segment``; ``mirrored``: the first handle of a smooth cubic."""
    start, handles, end = segment
    dx, dy = minus(end, start)
    if handles is None:
        found: list[tuple[str, tuple[int, ...]]] = [("l", (dx, dy)), ("L", end)]
        if dy == 0:
            found += [("h", (dx,)), ("H", (end[0],))]
        if dx == 0:
            found += [("v", (dy,)), ("V", (end[1],))]
        return found
    first, second = handles
    found = [("c", (*minus(first, start), *minus(second, start), dx, dy)), ("C", (*first, *second, *end))]
    if first == mirrored:
        found += [("s", (*minus(second, start), dx, dy)), ("S", (*second, *end))]
    return found


_Command = tuple[str, str, str]
"""A letter, the numbers as they follow the same letter, and both together."""


def _commands(segment: Segment, mirrored: Pair) -> list[_Command]:
    """Return the commands that draw ``segment``; ``mirrored``: the first handle of a smooth cubic."""
    found = []
    for letter, numbers in choices(segment, mirrored):
        text = row(numbers, False)
        found.append((letter, text if numbers[0] < 0 else f" {text}", letter + text))
    return found


def shortest(pen: Pair | None, segments: Sequence[Segment]) -> str:
    """Return path data of a contour, its move included; ``pen``: where the contour before ended, if any."""
    start = segments[0].start
    mirrored = [start, *(segment.mirrored() for segment in segments[:-1])]
    return _shortest(pen, start, map(_commands, segments, mirrored))


def _shortest(pen: Pair | None, start: Pair, commands: Iterable[Sequence[_Command]]) -> str:
    """Return the shortest path data, given the commands that may draw each segment."""
    moves = f"M{row(start, False)}", f"m{row(minus(start, pen or (0, 0)), False)}"
    best: list[_Written] = [(len(text), text, None) for text in moves]
    places = {IMPLIED[text[0]]: i for i, text in enumerate(moves)}  # in ``best``, by the letter to leave out
    for options in commands:
        lengths = [written[0] for written in best]
        least = min(lengths)
        first = lengths.index(least)
        after: list[_Written] = []
        for letter, repeated, full in options:
            total, added, before = least + len(full), full, first
            place = places.get(letter)
            if place is not None:
                other = lengths[place] + len(repeated)
                if other < total or (other == total and place <= first):
                    total, added, before = other, repeated, place
            after.append((total, added, best[before]))
        best, places = after, {option[0]: i for i, option in enumerate(options)}
    least = min(written[0] for written in best)
    return min(_text(written) for written in best if written[0] == least)


def shortest_ring(pen: Pair | None, segments: list[Segment]) -> tuple[str, Pair]:
    """Return path data of a ring, from its best start, and that start, where the pen is then.

    A line that comes last need not be written: the command that closes the ring draws it.
    """
    behind = [segments[-1], *segments[:-1]]
    commands = list(map(_commands, segments, (before.mirrored() for before in behind)))
    promise = []
    for i, (before, segment) in enumerate(zip(behind, segments, strict=True)):
        spared = 0
        if before.handles is None and len(segments) > 1:
            spared = 1 + min(len(repeated) for _, repeated, _ in commands[i - 1])
        promise.append((len(row(segment.start, False)) - spared, segment.start, i))
    found = []
    starts = 4  # most promising starts of a ring that are tried
    for _, start, i in sorted(promise)[:starts]:
        # No handle is mirrored behind the move.
        is_same = segments[i].handles is None or behind[i].mirrored() == start
        first = commands[i] if is_same else _commands(segments[i], start)
        rotated = [first, *commands[i + 1 :], *commands[:i]]
        if behind[i].handles is None and len(rotated) > 1:
            rotated.pop()
        found.append((f"{_shortest(pen, start, rotated)}z", start))
    return min(found, key=lambda one: len(one[0]))


MOVED = re.compile(r"([Mm])(-?\d+) ?(-?\d+)")


class Rings:
    """Path data of rings of fills; of those that differ by their place only, it is looked for once."""

    def __init__(self) -> None:
        """Begin without any."""
        self._known: dict[tuple[Segment, ...], tuple[Pair, str]] = {}
        """Where the text of a ring begins, from the first segment, and it without the move."""

    def data(self, pen: Pair | None, segments: list[Segment]) -> tuple[str, Pair]:
        """Return path data of a ring, and where the pen is then, as ``shortest_ring``."""
        origin = segments[0].start
        key = tuple(_moved(segment, origin) for segment in segments)
        if key in self._known:
            first, drawn = self._known[key]
            start = plus(first, origin)
            moves = [f"m{row(minus(start, pen or (0, 0)), False)}", f"M{row(start, False)}"]
            # Behind a relative move, lines need no letter.
            move = min(moves, key=len) if drawn[:1].isalpha() else moves[0]
            return move + drawn, start
        text, start = shortest_ring(pen, segments)
        if found := MOVED.match(text):
            drawn = text[found.end() :]
            if drawn.islower() and (found[1] == "m" or drawn[0].isalpha()):
                self._known[key] = minus(start, origin), drawn
        return text, start


def _moved(segment: Segment, origin: Pair) -> Segment:
    """Return a segment with ``origin`` at 0."""
    start, handles, end = segment
    inner = None if handles is None else (minus(handles[0], origin), minus(handles[1], origin))
    return Segment(minus(start, origin), inner, minus(end, origin))


def segments_of(grid: Sequence[Pair], straight: Sequence[bool], closed: bool) -> list[Segment]:
    """Return the segments of a chain of cubics; ``straight``: which of them are lines."""
    chain = [*grid, grid[0]] if closed else grid
    return [
        Segment(chain[3 * i], None if is_line else (chain[3 * i + 1], chain[3 * i + 2]), chain[3 * i + 3])
        for i, is_line in enumerate(straight)
    ]


SMALL = 300
"""Largest coordinates for which ``shortest_smooth`` is worth its time: larger absolute ones are hardly ever
shorter than relative ones."""


def shortest_smooth(joints: Sequence[Pair], control: Pair) -> str:
    """Return path data of smooth quadratics through ``joints``; ``control``: that of the first one."""
    start, end = joints[:2]
    relative = "q" + row((*minus(control, start), *minus(end, start)), False)
    absolute = "Q" + row((*control, *end), False)
    best = {text[0]: f"M{row(start, False)}{text}" for text in (relative, absolute)}
    for before, after in itertools.pairwise(joints[1:]):
        found = {}
        for letter, numbers in (("t", minus(after, before)), ("T", after)):
            repeated, full = row(numbers, True), letter + row(numbers, False)
            texts = (text + (repeated if last == letter else full) for last, text in best.items())
            found[letter] = min(texts, key=lambda text: (len(text), text))
        best = found
    return min(best.values(), key=lambda text: (len(text), text))
