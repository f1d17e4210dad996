"""An image read, at a size that memory has room for, and looked at."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpsplat.files.sources import ImageSource, held, image_of, load_importance, source_name
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.jobs.keys import job_key
from warpsplat.jobs.reduction import Memory, Reduction
from warpsplat.jobs.subjects import decided
from warpsplat.native import release_memory
from warpsplat.scene import FloatArray


@dataclass(frozen=True)
class Prepared:
    """An image that was read, and all that a run on it needs to know."""

    target: FloatArray
    """What shapes are fitted to, see ``vectorize``."""
    settings: Settings
    """With a subject."""
    why: str
    """The subject; empty where it was given."""
    importance: FloatArray | None
    reduction: Reduction | None
    key: str = ""
    """Of the job, where the file is to name it."""
    name: str = "the image"
    """How messages call it."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image [px]."""
        if self.reduction:
            return self.reduction.width, self.reduction.height
        return self.target.shape[1], self.target.shape[0]


def prepare(
    source: ImageSource,
    settings: Settings,
    *,
    name: str | None = None,
    importance: ImageSource | None = None,
    keyed: bool = False,
) -> Prepared:
    """Read an image and its mask, at a size that memory has room for, and see what it shows.

    Arguments and errors are those of ``vectorize_image``.
    """
    name = name or source_name(source)
    mask_name = source_name(importance, "the mask")
    key = ""
    source, importance = held(source), None if importance is None else held(importance)
    if keyed:
        assert isinstance(source, bytes), "pixels have no key"
        assert importance is None or isinstance(importance, bytes)
        key = job_key(settings, source, importance)
    memory = Memory.of(source, settings, importance)
    factor = memory.factor(name, settings)
    target = load_target(source, name, settings.background, factor)
    chosen, why = decided(target, settings)
    target, factor = memory.smaller(target, name, chosen, factor)
    release_memory()
    work = Prepared(target, chosen, why, None, memory.reduction(factor, target, chosen), key, name)
    if importance is None:
        return work
    mask = load_importance(importance, *work.size, mask_name, memory.mask_factor(factor))
    return replace(work, importance=mask)


def load_target(source: ImageSource, name: str | None, background: str, factor: int = 1) -> FloatArray:
    """An image as ``Settings.background`` asks for it: with opacity, (height, width, 4), or on a colour.

    ``factor``: how many times smaller to read it.

    Raises:
        ImageError: as ``image_of``.
    """
    color = solid_color(background)
    image = image_of(source, name, paper=color, factor=factor)
    if background == "none" and image.shape[2] == 3:
        image = np.concatenate([image, np.ones_like(image[..., :1])], axis=2)
    return image
