"""Strokes whose pen changes: cut where two widths are nearer to the ink by more than a stroke is worth."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from warpsplat.drawing.trace.beziers import from_parameter, points_at
from warpsplat.drawing.trace.grids import Floats, Ints, nearest_in
from warpsplat.drawing.trace.polylines import arc_lengths
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Scene
from warpsplat.scene.scene import starts_of

SAME_PEN = 1.2
"""Difference of widths up to which one pen drew them [px]: ink in one bit is a pixel wider by chance."""

SHARES = np.linspace(0, 1, 9)  # of a cubic, between which it is taken for straight
APART = 1.0  # [px] between places along a stroke at which its width is measured, about


class WidthProfile(NamedTuple):
    """The widths that a stroke should have from place to place."""

    cubics: Floats
    """Its cubics, shape (cubic, 4, 2)."""
    at: Floats
    """Where each place is, in cubics from its beginning, shape (place,)."""
    points: Floats
    """Shape (place, 2)."""
    lengths: Floats
    """Width of the stroke around each place [px], shape (place,)."""


def cut_at_steps(strokes: Scene, lack: Floats, price: float) -> tuple[Scene, Ints]:
    """Return strokes, cut where their widths change, and the stroke that each is a part of.

    Args:
        strokes: Fitted, of one contour and one width each.
        lack: Share of each pixel that is inked and not drawn, below 0 where it is the other way round; shape
            (height, width).
        price: Squared error, summed over pixels, that a further stroke is worth.
    """
    profiles = _profiles(strokes)
    owner, pieces, widths, closed = list[int](), list[Floats](), list[float](), list[bool]()
    for stroke, (profile, lacking) in enumerate(
        zip(profiles, _nearest_sums(strokes, profiles, lack), strict=True)
    ):
        width, is_ring = float(strokes.widths[stroke]), bool(strokes.closed[stroke])
        wanted = np.maximum(width + lacking / profile.lengths, 0)
        bounds = _bounds(wanted, profile.lengths, price, is_ring=is_ring)
        if len(bounds) == 2:
            pieces.append(strokes.points_of(stroke))
            widths.append(width)
        else:
            for low, high in itertools.pairwise(bounds):
                ends = (_edge(profile, place, is_ring=is_ring) for place in (low, high))
                pieces.append(_part(profile.cubics, *ends))
                widths.append(_mean(wanted, profile.lengths, low, high))
        closed += [is_ring and len(bounds) == 2] * (len(bounds) - 1)
        owner += [stroke] * (len(bounds) - 1)
    first = starts_of(np.array([len(piece) for piece in pieces], np.int64))
    cut = replace(
        strokes.take(np.array(owner, np.intp)),
        first=first,
        starts=first,
        points=np.concatenate(pieces).astype(np.float32),
        widths=np.array(widths, np.float32),
        closed=np.array(closed, np.int32),
    )
    return cut, np.array(owner, np.intp)


def rejoined(pieces: Scene, owner: Ints) -> Scene:
    """Return parts of strokes that end where the next part begins; ``owner``: the stroke of each."""
    points = pieces.points.astype(np.float64)
    for number in np.flatnonzero(owner[1:] == owner[:-1]).tolist():
        begin = int(pieces.first[number + 1])
        shift = (points[begin] - points[begin - 1]) / 2
        points[begin - 2 : begin] += shift
        points[begin : begin + 2] -= shift
    return replace(pieces, points=points.astype(np.float32))


def by_stroke(strokes: Scene, values: Floats) -> Floats:
    """Return the sums of the values of pixels (height, width) in and beside each stroke, shape (stroke,)."""
    return np.array([own.sum() for own in _nearest_sums(strokes, _profiles(strokes), values)])


def _profiles(strokes: Scene) -> list[WidthProfile]:
    return [_profile(strokes.points_of(i), bool(strokes.closed[i])) for i in range(len(strokes))]


def _profile(points: Floats, closed: bool) -> WidthProfile:
    """Return a stroke of no given width, and the places where it is measured."""
    points = points.astype(np.float64)
    points = np.concatenate([points, points[:1]]) if closed else points
    cubics = np.stack([points[k : len(points) - 3 + k : 3] for k in range(4)], axis=1)
    at, lengths = [], []
    for number, cubic in enumerate(cubics):
        length = max(float(arc_lengths(points_at(cubic, SHARES))[-1]), 1e-3)
        count = max(1, round(length / APART))
        at.append(number + (np.arange(count) + 0.5) / count)
        lengths.append(np.full(count, length / count))
    where = np.concatenate(at)
    return WidthProfile(
        cubics,
        where,
        points_at(cubics[where.astype(np.intp)], where[:, None] % 1)[:, 0],
        np.concatenate(lengths),
    )


def _nearest_sums(strokes: Scene, profiles: list[WidthProfile], values: Floats) -> list[Floats]:
    """Return the sums of the values of pixels (height, width) that are nearest to each place of each stroke.

    Pixels farther away than a stroke is wide do not count.
    """
    height, width = values.shape
    counts = [len(profile.at) for profile in profiles]
    places = np.concatenate([profile.points for profile in profiles])
    reach = np.repeat(strokes.widths.astype(np.float64), counts) + 1
    columns, rows = (
        np.clip(places[:, k].astype(np.intp), 0, side - 1) for k, side in ((0, width), (1, height))
    )
    owner = np.full(values.shape, -1, np.intp)
    owner[rows, columns] = np.arange(len(places))
    nearest = owner.reshape(-1)[nearest_in(owner >= 0)]
    away = np.indices(values.shape)[::-1] + 0.5 - places[nearest].transpose(2, 0, 1)
    near = hypot(away[0], away[1]) <= reach[nearest]
    return np.split(np.bincount(nearest[near], values[near], len(places)), np.cumsum(counts)[:-1])


def _bounds(widths: Floats, lengths: Floats, price: float, *, is_ring: bool) -> list[int]:
    """Return where parts of one width begin, and where the last one ends; in a ring beyond its last place."""
    count, cuts = len(widths), _cuts(widths, lengths, price)
    first = cuts[0] if is_ring and cuts else 0  # a ring's points may begin in the middle of a part
    if first:
        cuts = _cuts(np.roll(widths, -first), np.roll(lengths, -first), price)
    bounds = [first, *(cut + first for cut in cuts), first + count]
    while len(bounds) > 2:
        means = [_mean(widths, lengths, low, high) for low, high in itertools.pairwise(bounds)]
        steps = np.abs(np.diff(means))
        if steps.min() > SAME_PEN:
            break
        del bounds[int(steps.argmin()) + 1]
    if is_ring and len(bounds) > 3 and abs(means[0] - means[-1]) <= SAME_PEN:
        bounds = [*bounds[1:-1], bounds[1] + count]
    return bounds


def _mean(widths: Floats, lengths: Floats, low: int, high: int) -> float:
    """Return the mean width of places from one to before another, beyond the last from the first on."""
    index = np.arange(low, high) % len(widths)
    return float((widths[index] * lengths[index]).sum() / lengths[index].sum())


def _cuts(widths: Floats, lengths: Floats, price: float) -> list[int]:
    """Return where parts of one width begin, but for the first: the cheapest by squared errors and prices.

    A stroke that is d too wide or narrow has an error of d / 2 on each side, squared d² / 2 in all.
    """
    count = len(widths)
    weight, first, second = (
        np.concatenate([[0.0], np.cumsum(lengths * power)]) for power in (1, widths, widths * widths)
    )
    best, last = np.zeros(count + 1), np.zeros(count + 1, np.intp)
    for end in range(1, count + 1):
        total, mass = first[end] - first[:end], weight[end] - weight[:end]
        costs = best[:end] + price + 0.5 * (second[end] - second[:end] - total * total / mass)
        last[end] = costs.argmin()
        best[end] = costs[last[end]]
    cuts, end = [], int(last[count])
    while end:
        cuts.append(end)
        end = int(last[end])
    return cuts[::-1]


def _edge(profile: WidthProfile, place: int, *, is_ring: bool) -> float:
    """Return where a part of a stroke begins or ends that ends before a place, in cubics."""
    count, whole = len(profile.at), len(profile.cubics)
    if not is_ring and place in (0, count):
        return float(whole if place else 0)
    turns, place = divmod(place, count)
    before = profile.at[place - 1] - (whole if place == 0 else 0)
    return float(turns * whole + 0.5 * (before + profile.at[place]))


def _part(cubics: Floats, begin: float, end: float) -> Floats:
    """Return the control points of a part of a stroke, from one place to another, in cubics."""
    points: list[Floats] = []
    number = int(np.floor(begin))
    while number < end:
        cubic = cubics[number % len(cubics)]
        low, high = max(begin - number, 0.0), min(end - number, 1.0)
        cubic = from_parameter(cubic, low)
        cubic = from_parameter(cubic[::-1], (1 - high) / (1 - low))[::-1]
        points.append(cubic if not points else cubic[1:])
        number += 1
    return np.concatenate(points)
