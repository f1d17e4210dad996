"""Lines and cubics in the path commands that take the fewest characters (SVG 1.1, 8.3).

Each may be said in several ways: relative or absolute, level and upright lines by one number, a cubic whose
first handle mirrors the one before without it; and a command that is the one before needs no letter. The
shortest text is found by dynamic programming over the last letter.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

Pair = tuple[int, int]


class Segment(NamedTuple):
    """A piece of an outline, in whole numbers."""

    start: Pair
    handles: tuple[Pair, Pair] | None
    """Of a cubic; None: a line."""
    end: Pair

    def has_extent(self) -> bool:
        """Whether it is more than a point."""
        return self.end != self.start or self.handles not in (None, (self.start, self.start))

    def mirrored(self) -> Pair:
        """The first handle that a smooth cubic has behind it."""
        if self.handles is None:
            return self.end
        (x, y), (u, v) = self.end, self.handles[1]
        return 2 * x - u, 2 * y - v


class Written(NamedTuple):
    """What is written so far: a chain, so that a long contour is not copied with each piece."""

    length: int
    added: str
    """What came last."""
    before: Written | None

    def text(self) -> str:
        """All of it."""
        parts, last = [], self
        while last.before:
            parts.append(last.added)
            last = last.before
        return "".join([last.added, *reversed(parts)])


def minus(a: Pair, b: Pair) -> Pair:
    """The way from ``b`` to ``a``."""
    return a[0] - b[0], a[1] - b[1]


def row(numbers: Sequence[int], separated: bool) -> str:
    """Numbers with the fewest separators: a sign separates itself. ``separated``: something stands before."""
    text = " ".join(map(str, numbers)).replace(" -", "-")
    return f" {text}" if separated and numbers[0] >= 0 else text


IMPLIED = {"M": "L", "m": "l"}
"""What pairs behind a move are (SVG 1.1, 8.3.2)."""


def _ways(segment: Segment, mirrored: Pair) -> list[tuple[str, tuple[int, ...]]]:
    """Commands that draw ``segment``; ``mirrored``: the first handle that smooth ones have."""
    start, handles, end = segment
    dx, dy = minus(end, start)
    if handles is None:
        ways: list[tuple[str, tuple[int, ...]]] = [("l", (dx, dy)), ("L", end)]
        if dy == 0:
            ways += [("h", (dx,)), ("H", (end[0],))]
        if dx == 0:
            ways += [("v", (dy,)), ("V", (end[1],))]
        return ways
    first, second = handles
    ways = [
        ("c", (*minus(first, start), *minus(second, start), dx, dy)),
        ("C", (*first, *second, *end)),
    ]
    if first == mirrored:
        ways += [("s", (*minus(second, start), dx, dy)), ("S", (*second, *end))]
    return ways


class Way(NamedTuple):
    """A command that draws a segment."""

    letter: str
    after_another: str
    """Its numbers, where the letter need not be said."""
    fresh: str
    """With the letter."""


def _written_ways(segment: Segment, mirrored: Pair) -> list[Way]:
    """``_ways`` as text."""
    found = []
    for letter, numbers in _ways(segment, mirrored):
        text = row(numbers, False)
        found.append(Way(letter, f" {text}" if numbers[0] >= 0 else text, letter + text))
    return found


def shortest(pen: Pair | None, segments: Sequence[Segment]) -> str:
    """Path data of a contour, from its move on; ``pen``: where the one before ended, if there is one."""
    start = segments[0].start
    mirrored = [start, *(segment.mirrored() for segment in segments[:-1])]
    return _shortest(pen, start, map(_written_ways, segments, mirrored))


def _shortest(pen: Pair | None, start: Pair, ways_of: Iterable[Sequence[Way]]) -> str:
    """The same of segments of which only the ways to write them are known."""
    moves = {"M": f"M{row(start, False)}", "m": f"m{row(minus(start, pen or (0, 0)), False)}"}
    best = {letter: Written(len(text), text, None) for letter, text in moves.items()}
    for ways in ways_of:
        after: dict[str, Written] = {}
        for letter, written in best.items():
            implied, length = IMPLIED.get(letter, letter), written.length
            for way, after_another, fresh in ways:
                added = after_another if way == implied else fresh
                total = length + len(added)
                if way not in after or total < after[way].length:
                    after[way] = Written(total, added, written)
        best = after
    least = min(written.length for written in best.values())
    return min(written.text() for written in best.values() if written.length == least)


STARTS = 4
"""Starts of a ring that are tried: those that promise most."""


def shortest_ring(pen: Pair | None, segments: list[Segment]) -> tuple[str, Pair]:
    """Path data of a ring that a fill closes, from where it is shortest, and where its last command ends.

    A line that comes last need not be written.
    """
    behind = [segments[-1], *segments[:-1]]
    ways = [
        _written_ways(segment, before.mirrored()) for before, segment in zip(behind, segments, strict=True)
    ]
    promise = []
    for i, (before, segment) in enumerate(zip(behind, segments, strict=True)):
        spared = 0
        if before.handles is None and len(segments) > 1:
            spared = 1 + min(len(way.after_another) for way in ways[i - 1])
        promise.append((len(row(segment.start, False)) - spared, segment.start, i))
    found = []
    for _, start, i in sorted(promise)[:STARTS]:
        # Behind the move no handle is mirrored.
        turned = [_written_ways(segments[i], start), *ways[i + 1 :], *ways[:i]]
        last = i - 1
        if behind[i].handles is None and len(turned) > 1:
            turned.pop()
            last -= 1
        found.append((_shortest(pen, start, turned), segments[last].end))
    return min(found, key=lambda one: len(one[0]))


def segments_of(grid: Sequence[Pair], straight: Sequence[bool], closed: bool) -> list[Segment]:
    """Pieces of a chain of cubics; ``straight``: which of them are lines."""
    chain = [*grid, grid[0]] if closed else grid
    return [
        Segment(chain[3 * i], None if is_line else (chain[3 * i + 1], chain[3 * i + 2]), chain[3 * i + 3])
        for i, is_line in enumerate(straight)
    ]
