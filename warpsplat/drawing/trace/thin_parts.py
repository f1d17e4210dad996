"""Lines and dots too thin to have a seed: pixels that no mixture of the regions around explains."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints, channel_max
from warpsplat.drawing.trace.mixtures import MIXED, mixed, unmix
from warpsplat.drawing.trace.palette import Coloring, Parts
from warpsplat.scene.scene import numbers_in

ROUNDS = 4  # colours in one thin part, at the most
MOST_PARTS = 4000  # in a round; an image with more is no drawing
COVERED = 0.35  # least share of a colour in a pixel for it to belong to a part, or tell its colour
OTHER_COLOR = 64.0  # [levels] a pixel this far off the part's mixtures has another colour
NEARBY = 5  # [px] how far from a thin part the colours lie that it may be a tip of
MATCHING = 0.8  # share of the least mixed pixels that must be mixed of a colour for it to match
SAMPLES = 500  # of these pixels, about, that are compared with all colours


def add_thin_parts(image: Floats, parts: Parts, noise: float) -> Parts:
    """Label the lines and dots that have no seed.

    A connected part may have several colours, as a thin bar and its outline: its pixels that are not between
    the colour found and what is beside the part make up the parts of the next round. They keep their label
    where no other colour of the image fits them.

    Args:
        image: Shape (height, width, channel).
        parts: What is labelled from seeds.
        noise: Of flat regions [levels].
    """
    waiting = parts.labels == NO_REGION
    for number in range(ROUNDS):
        cleared = replace(parts, labels=np.where(waiting, NO_REGION, parts.labels).astype(np.int32))
        found, unexplained, waiting = _round(image, cleared, noise, waiting, new_colors=number == 0)
        kept = unexplained & (found.labels == NO_REGION)
        parts = replace(
            found,
            labels=np.where(kept, parts.labels, found.labels),
            fills=np.where(kept[..., None], parts.fills, found.fills),
        )
        if not waiting.any():
            break
    return parts


def _round(
    image: Floats, parts: Parts, noise: float, waiting: Bools, *, new_colors: bool
) -> tuple[Parts, Bools, Bools]:
    """Find one colour for each thin part among the pixels that are ``waiting``.

    Returns:
        The parts with the thin ones; the pixels that no mixture explains; those of them that were labelled
        and seem to have another colour. The masks have shape (height, width).
    """
    limit = MIXED + noise
    rows, columns = np.nonzero(waiting)
    mixtures = unmix(image, parts.labels, parts.fills, rows, columns, noise)
    is_off = mixtures.residual > limit
    rows, columns, residual, bases = (
        rows[is_off],
        columns[is_off],
        mixtures.residual[is_off],
        mixtures.base[is_off],
    )
    shown, unexplained, other = image[rows, columns], np.zeros_like(waiting), np.zeros_like(waiting)
    unexplained[rows, columns] = True
    # What has no region near it may be the core of a line, or a tint beside one.
    known = parts.labels[parts.labels != NO_REGION]
    if len(known):
        main = parts.colorings[parts.paint[np.bincount(known).argmax()]].color
        residual = np.where(np.isfinite(residual), residual, channel_max(np.abs(shown - main)))
    labels, fills = parts.labels.copy(), parts.fills.copy()
    paint, colorings = parts.paint.tolist(), list(parts.colorings)
    for some in _components_by_size(unexplained):
        thin = some[np.argsort(-residual[some], kind="stable")]  # the least mixed first
        near = _near(labels, parts.paint, rows[thin], columns[thin])
        chosen = _matching_color(shown[thin], bases[thin], colorings, near, limit)
        if chosen is None or (chosen == len(colorings) and not new_colors):
            continue
        if chosen == len(colorings):
            colorings.append(Coloring(np.round(np.median(shown[thin[: 1 + len(thin) // 4]], axis=0))))
        color = colorings[chosen].color
        share, off = mixed(shown[thin], color, bases[thin])
        own = share >= COVERED
        place = rows[thin[own]], columns[thin[own]]
        other[place], labels[place], fills[place] = off[own] > OTHER_COLOR, len(paint), color
        paint.append(chosen)
    return Parts(labels, fills, np.asarray(paint, np.int32), colorings), unexplained, other


def _components_by_size(mask: Bools) -> list[Ints]:
    """Return the connected components of the pixels of a mask, by their numbers in it, the largest first."""
    _, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    owner = parts[mask]
    order = np.argsort(owner, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(owner[order])) + 1)
    return list[Ints](sorted(groups, key=len, reverse=True)[:MOST_PARTS]) if len(order) else []


def _near(labels: Ints, paint: Ints, y: Ints, x: Ints) -> Ints:
    """Return the numbers of the colourings, of parts that have a ``paint``, beside a thin part."""
    rows = slice(max(int(y.min()) - NEARBY, 0), int(y.max()) + NEARBY + 1)
    columns = slice(max(int(x.min()) - NEARBY, 0), int(x.max()) + NEARBY + 1)
    seen = labels[rows, columns]
    return numbers_in(paint[seen[(seen != NO_REGION) & (seen < len(paint))]])


def _matching_color(
    shown: Floats, bases: Floats, colorings: list[Coloring], near: Ints, limit: float
) -> int | None:
    """Return the number of a thin part's colouring, one more than there are for a new one; None for no part.

    A known flat colour matches if the pixels lie between what is beside them and that colour. If that is a
    colour ``near`` them but their share of it is small, they are the tip of its region, too faint to show.

    Args:
        shown: Colours of the pixels, the least mixed first, shape (pixel, channel).
        bases: The colour of the nearest region, shape (pixel, channel).
        colorings: Those that are known.
        near: The numbers of those beside the part.
        limit: How far off mixtures may be [levels].
    """
    numbers = np.flatnonzero([coloring.ramp is None for coloring in colorings])
    if not len(numbers):
        return len(colorings)
    colors = np.array([colorings[i].color for i in numbers.tolist()])
    some = slice(0, 1 + len(shown) // 2, 1 + len(shown) // (2 * SAMPLES))
    share, off = mixed(shown[some, None], colors, bases[some, None])
    fits, largest = np.quantile(off, MATCHING, axis=0) <= limit, share.max(axis=0)
    clear = fits & (largest >= COVERED)
    if clear.any():
        return int(numbers[np.where(clear, largest, -np.inf).argmax()])
    return None if np.isin(numbers[fits], near).any() else len(colorings)
