"""Polygons whose union is a stroke with caps, joins and dashes, in float64 with autograd.

The rules by which neighbours share corners are those of ``kernels.stroker``; the rest is independent, contour
by contour and dash by dash.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import torch

from warpsplat.scene import Cap, Join

SHORT, ARC_FLATNESS, UNSEEN, PERIOD_MIN = 1e-3, 0.02, 0.04, 0.5
Polygon = list[torch.Tensor]


@dataclass(frozen=True)
class Style:
    """Width, caps, joins and dashes of a stroke [px]."""

    half: torch.Tensor
    cap: Cap
    join: Join
    limit: float
    dashes: tuple[float, ...]
    """As of ``Scene``, () for a solid one."""


@dataclass
class Piece:
    """A straight part of a stroke."""

    start: torch.Tensor
    stop: torch.Tensor
    t: torch.Tensor
    """Unit vector."""
    corner: bool
    """Whether two Béziers meet where it starts."""
    share: float = 1.0
    """Its length [px], as a number."""


def number(value: torch.Tensor) -> float:
    return float(value.detach())


def perp(v: torch.Tensor) -> torch.Tensor:
    return torch.stack([-v[1], v[0]])


def rotated(v: torch.Tensor, angle: torch.Tensor | float) -> torch.Tensor:
    angle = torch.as_tensor(angle, dtype=v.dtype)
    return torch.cos(angle) * v + torch.sin(angle) * perp(v)


def chords(angle: float, half: float) -> int:
    step = 2 * math.sqrt(2 * ARC_FLATNESS / max(half, ARC_FLATNESS))
    return min(max(math.ceil(abs(angle) / step), 1), 256)


def polygons(line: torch.Tensor, corners: list[bool], closed: bool, style: Style) -> list[Polygon]:
    """Return polygons of a contour; ``line``: [vertex, 2]; ``corners``: of the segments' starts."""
    pieces, corner = [], False
    for a, b, flag in zip(line[:-1], line[1:], corners, strict=True):
        corner |= flag
        length = (b - a).norm()
        if number(length) >= SHORT:
            pieces.append(Piece(a, b, (b - a) / length, corner, number(length)))
            corner = False
    if not pieces:
        return [] if style.dashes else dot(line[0], style)
    if not style.dashes:
        return drawn(pieces, closed, style)
    found = []
    for dash in dashed(pieces, closed, style.dashes):
        if len(dash) == 1 and dash[0].share == 0:
            found += dot(dash[0].start, style)
        else:
            found += drawn(dash, False, style)
    return found


def dot(at: torch.Tensor, style: Style) -> list[Polygon]:
    if style.cap == Cap.BUTT:
        return []
    count = max(chords(2 * math.pi, number(style.half)), 4) if style.cap == Cap.ROUND else 4
    radius = style.half * (1 if style.cap == Cap.ROUND else math.sqrt(2))
    x = torch.tensor([1.0, 0.0], dtype=at.dtype)
    return [[at + radius * rotated(x, math.pi / 4 + 2 * math.pi * k / count) for k in range(count)]]


def intervals(dashes: tuple[float, ...], length: float) -> list[tuple[float, float]]:
    """Where dashes begin and end on a contour, from 0 to its length."""
    offset, *pattern = dashes
    period = sum(pattern)
    stretch = max(math.ceil(PERIOD_MIN / period), 1)
    at, found = -((offset * stretch) % (period * stretch)), []
    for k in itertools.count():
        if at > length:
            break
        end = at + stretch * pattern[k % len(pattern)]
        if k % 2 == 0 and (end > 0 or at == end == 0):
            found.append((max(at, 0.0), min(end, length)))
        at = end
    return found


def dashed(pieces: list[Piece], closed: bool, dashes: tuple[float, ...]) -> list[list[Piece]]:
    """The pieces of each dash; those over the start of a closed contour are one."""
    lengths = [(piece.stop - piece.start).norm() for piece in pieces]
    before = [sum(lengths[:i], torch.zeros(())) for i in range(len(pieces) + 1)]
    length = number(before[-1])
    found = []
    for low, high in intervals(dashes, length):
        dash = []
        for piece, own, behind in zip(pieces, lengths, before, strict=False):
            ends = number(behind), number(behind + own)
            empty = low == high and ends[0] <= low < ends[1]
            if empty or max(low, ends[0]) < min(high, ends[1]):
                start = piece.start + max(low - behind, 0.0) * piece.t if low > ends[0] else piece.start
                stop = piece.start + (high - behind) * piece.t if high < ends[1] else piece.stop
                share = min(high, ends[1]) - max(low, ends[0])
                dash.append(Piece(start, stop, piece.t, piece.corner, share))
        if dash:
            found.append(dash)
    over = found and found[0][0].start is pieces[0].start and found[-1][-1].stop is pieces[-1].stop
    if closed and over and len(found) > 1:
        return [*found[1:-1], found[-1] + found[0]]
    return found


@dataclass
class Meeting:
    """Corners of a joint that both pieces have, by side, and what fills its gap."""

    right: torch.Tensor | None
    left: torch.Tensor | None
    gap: Polygon


def meet(a: Piece, b: Piece, style: Style) -> Meeting:
    """``a`` ends where ``b`` starts; its left is where it turns by positive angles."""
    half, at = style.half, a.stop
    turn = torch.atan2((perp(a.t) * b.t).sum(), (a.t * b.t).sum())
    ratio = 1 / torch.cos(turn / 2).clamp(min=1e-6)
    join = style.join if b.corner else Join.ROUND
    miter = join == Join.MITER and number(ratio) <= style.limit
    tip = half * ratio * rotated(perp(a.t), turn / 2)
    side = -1 if number(turn) > 0 else 1
    outer = [at + side * half * perp(a.t)]
    if miter:
        outer.append(at + side * tip)
    elif join == Join.ROUND:
        count = chords(number(turn), number(half))
        outer += [at + side * half * rotated(perp(a.t), turn * k / count) for k in range(1, count)]
    outer.append(b.start + side * half * perp(b.t))
    gap = [at, *(outer if side < 0 else outer[::-1])]
    if number(half * torch.tan(turn / 2).abs()) > 0.5 * min(a.share, b.share):
        return Meeting(None, None, gap)
    if miter or number(half * (ratio - 1)) <= UNSEEN:
        return Meeting(at - tip, at + tip, [])
    return Meeting(None, at + tip, gap) if side < 0 else Meeting(at - tip, None, gap)


def drawn(pieces: list[Piece], ring: bool, style: Style) -> list[Polygon]:
    """A quadrilateral for each piece, what fills the gaps, and caps."""
    after = [*pieces[1:], pieces[0]] if ring else pieces[1:]
    none = Meeting(None, None, [])
    joints = [meet(a, b, style) for a, b in zip(pieces, after, strict=False)]
    found = [joint.gap for joint in joints if joint.gap]
    joints = joints if ring else [*joints, none]
    for i, piece in enumerate(pieces):
        side = style.half * perp(piece.t)
        start, stop = joints[i - 1] if i or ring else none, joints[i]
        found.append(
            [
                piece.start - side if start.right is None else start.right,
                piece.stop - side if stop.right is None else stop.right,
                piece.stop,
                piece.stop + side if stop.left is None else stop.left,
                piece.start + side if start.left is None else start.left,
                piece.start,
            ]
        )
    if not ring:
        found += capped(pieces[0].start, -pieces[0].t, style) + capped(pieces[-1].stop, pieces[-1].t, style)
    return found


def capped(at: torch.Tensor, outwards: torch.Tensor, style: Style) -> list[Polygon]:
    side, ahead = style.half * perp(outwards), style.half * outwards
    if style.cap == Cap.BUTT:
        return []
    if style.cap == Cap.SQUARE:
        return [[at - side, at - side + ahead, at + side + ahead, at + side]]
    count = chords(math.pi, number(style.half))
    return [[at + rotated(ahead, math.pi * (k / count - 0.5)) for k in range(count + 1)]]
