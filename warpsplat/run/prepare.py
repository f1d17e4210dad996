"""Read an image at a size that memory allows, and inspect it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpsplat.drawing.silhouette import silhouettes
from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.drawing.without_background import MOST_PIXELS, without_ground
from warpsplat.errors import UsageError
from warpsplat.files.image import ImageFacts
from warpsplat.files.sources import ImageSource, held, image_of, load_importance, source_name
from warpsplat.fit.custom_loss import CustomLoss
from warpsplat.fit.place import grid_scene
from warpsplat.fit.problem import Problem
from warpsplat.fit.settings import SUBJECTS, Settings, Subject, make_settings, solid_color
from warpsplat.native import release_memory
from warpsplat.portable.filters import boxed
from warpsplat.run.memory import Demand, DeviceMemory, Reduction, facts_of, near_edges
from warpsplat.run.result import job_key
from warpsplat.run.strategies import choose_strategy
from warpsplat.scene import FloatArray, Kind, Scene

if TYPE_CHECKING:
    from warpsplat.rendering.backend import Backend

OWN_LOSS = "a loss function"


@dataclass(frozen=True)
class PreparedImage:
    """An image that was read and inspected, and the problem that it poses."""

    problem: Problem
    why: str = ""
    """Why this subject was chosen; empty if it was given."""
    notes: tuple[str, ...] = ()
    """Notes for people on what may be unexpected, such as options that have no effect on the subject."""
    reduction: Reduction | None = None
    """How the image was reduced to fit into memory; None if it was not."""
    name: str = "the image"
    """Its name in messages."""
    resolution: tuple[float, float] | None = None
    """That its file states [pixels per inch along x and y]."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image [px]."""
        return (self.reduction.width, self.reduction.height) if self.reduction else self.problem.size


def prepare(
    source: ImageSource,
    settings: Settings,
    *,
    name: str | None = None,
    importance: ImageSource | None = None,
    loss: CustomLoss | None = None,
    keyed: bool = False,
    backend: Callable[[], Backend] | None = None,
) -> PreparedImage:
    """Read an image and its mask, at a size that memory allows, and find out what it shows.

    If ``keyed``, the file names the job that made it (``job_key``), by which batches recognise it: the
    source and the mask are files then. ``backend`` starts the device, whose memory counts if it is a GPU's.
    Raises ``ImageError`` if a file cannot be read, ``ResourceError`` if there is no memory for any size.
    """
    name = name or source_name(source)
    mask_name = source_name(importance, "the mask")
    key = ""
    source, importance = held(source), None if importance is None else held(importance)
    if keyed:
        assert isinstance(source, bytes), "pixels have no key"
        assert importance is None or isinstance(importance, bytes)
        key = job_key(settings, source, importance)
    facts = facts_of(source, name, "none" if settings.removal else settings.background)
    demand = Demand(facts, None if importance is None else facts_of(importance, mask_name))
    is_silhouette = settings.subject == "silhouette"
    first = demand.factor(settings, name, silhouette_factor(facts) if is_silhouette else 1)
    target = image_of(source, name, paper=solid_color(settings.background), factor=first)
    is_transparent = target.shape[2] == 4
    chosen, why, notes = choose_subject(target, settings, loss)
    if chosen.subject == "drawing":
        demand = replace(demand, edges=first * near_edges(target))
    if backend and choose_strategy(chosen).uses_device:
        demand = replace(demand, gpu=DeviceMemory.of(backend().device))
    factor = demand.factor(chosen, name, first)
    if factor > first:
        target = boxed(target, factor // first)
    release_memory()
    reduction = demand.reduction(source, target, chosen, factor)
    if is_silhouette:
        target = silhouettes(target, name)
        if factor > 1:
            reduction = Reduction(factor, facts.width, facts.height, None, "outlines need no more pixels")
    elif chosen.subject == "photo" and chosen.removal and target.shape[2] == 3:
        target, notes = without_background(target, chosen, notes)
        reduction = reduction and replace(reduction, whole=None)  # which has its background
    removes_none = is_transparent and bool(chosen.remove_background)
    notes += _unexpected(target, chosen, removes_none=removes_none, is_masked=importance is not None)
    problem = Problem(target, chosen, loss=loss, metadata=key)
    prepared = PreparedImage(problem, why, notes, reduction, name, facts.resolution)
    if importance is None:
        return prepared
    mask = load_importance(importance, *prepared.size, mask_name, demand.mask_factor(factor))
    return replace(prepared, problem=replace(prepared.problem, importance=mask))


def _unexpected(
    target: FloatArray, settings: Settings, *, removes_none: bool, is_masked: bool
) -> tuple[str, ...]:
    """Return notes on a background or a mask without effect, and on an image without anything in it."""
    notes = ["the image is transparent, so that no background was removed"] if removes_none else []
    if is_masked and settings.subject != "photo":
        notes.append(no_effect(["importance"], settings.subject))
    if target.shape[2] == 4 and not target[..., 3].any():
        notes.append("every pixel is fully transparent, so the file is empty")
    return tuple(notes)


def load_target(source: ImageSource, name: str | None, background: str) -> FloatArray:
    """Read an image to refine shapes against: with opacity, (height, width, 4), or on a colour.

    ``background``: as in the settings. Errors are those of ``image_of``.
    """
    image = image_of(source, name, paper=solid_color(background))
    if background == "none" and image.shape[2] == 3:
        image = np.concatenate([image, np.ones_like(image[..., :1])], axis=2)
    return image


def silhouette_factor(facts: ImageFacts) -> int:
    """Return how many times smaller an image is read for its silhouettes: a power of two."""
    factor = 1
    while facts.width * facts.height > 2 * MOST_PIXELS * factor * factor:
        factor *= 2
    return factor


def without_background(
    target: FloatArray, settings: Settings, notes: tuple[str, ...]
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return a photograph without its background, and notes with one on that."""
    cut = without_ground(target, everywhere=settings.removal == "everywhere")
    left, color = cut[..., 3].mean(), solid_color(settings.background)
    note = f"the background was removed, {1 - left:.0%} of the image"
    if color is not None:
        cut = np.asarray(cut[..., :3] + (1 - cut[..., 3:]) * color, np.float32)
    return cut, (*notes, note)


def load_image(image: ImageSource) -> FloatArray:
    """Read an image as it is fitted: upright, sRGB in [0, 1], shape (height, width, 3), float32; with opacity
    premultiplied, shape (height, width, 4).

    Raises:
        ImageError: it cannot be read.
    """
    return image_of(image)


def starting_scene(
    image: ImageSource, curves: int = 128, *, open: bool = False, seed: int = 0, background: str = "auto"
) -> Scene:
    """Return shapes to start a fit of your own from: a loose grid over the canvas, in the image's colours.

    Args:
        image: as for ``vectorize``.
        curves: number of shapes.
        open: strokes of three cubics instead of filled rings of quadratics.
        seed: of random numbers.
        background: as for ``vectorize``.

    Raises:
        UsageError: a value out of range.
        ImageError: the image cannot be read.
    """
    settings = make_settings(
        curves=curves, kind=Kind.STROKE if open else None, seed=seed, background=background
    )
    target = load_target(image, None, settings.background)
    return grid_scene(settings, target, curves, np.random.default_rng(seed))


def choose_subject(
    target: FloatArray, settings: Settings, loss: CustomLoss | None = None
) -> tuple[Settings, str, tuple[str, ...]]:
    """Return ``settings`` with a subject, the reason for it (empty if the subject was given), and notes.

    ``Option.elsewhere`` decides about options that have no effect on the subject that is detected. Raises
    ``UsageError`` if there is a loss, and the subject is none that is fitted.
    """
    subject, why, notes = settings.subject, "", list[str]()
    if subject == "auto":
        guess = guess_subject(target)
        subject, why = guess.subject, guess.why
        asking = [name for name, option in settings.unsuited(subject) if option.elsewhere == "fitted"]
        asking += [OWN_LOSS] if loss and subject != "photo" else []
        if asking:
            why = f"{_listed(asking)} {'ask' if asking[1:] else 'asks'} for fitted shapes"
            notes.append(
                f"looks like a {SUBJECTS[subject]}, but {why}, so it is treated as a photograph; "
                f"without {'them' if asking[1:] else 'it'} the image would be traced"
            )
            subject = "photo"
    if loss and subject != "photo":
        raise UsageError(f"subject {subject} and {OWN_LOSS} cannot be combined")
    without = settings.unsuited(subject)
    if without:
        notes.append(no_effect([name for name, _ in without], subject))
    usual = {option.field: option.default for _, option in without if option.elsewhere == "refused"}
    return replace(settings, subject=subject, **usual), why, tuple(notes)


def no_effect(names: list[str], subject: Subject) -> str:
    """Return the note that options have no effect on a subject."""
    return f"{_listed(names)} {'have' if names[1:] else 'has'} no effect on a {SUBJECTS[subject]}"


def _listed(names: list[str]) -> str:
    """Return names as English lists them."""
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
