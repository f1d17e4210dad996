"""``warpsplat.refine``."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from warpsplat.api.run import Callback, Watch, backend_on, checkpoint_file
from warpsplat.api.svg import SvgSource, svg_name_of, text_of
from warpsplat.files.sources import ImageSource, held, source_name
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.fit.stages import INTERVAL
from warpsplat.run.formats import write_named
from warpsplat.run.keywords import takes
from warpsplat.run.memory import check_refined
from warpsplat.run.prepare import load_target
from warpsplat.run.refine import refine as refine_scene
from warpsplat.run.result import Result
from warpsplat.run.typed import RefineOptions

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(RefineOptions)
def refine(
    svg: SvgSource,
    image: ImageSource,
    *,
    iterations: int = 200,
    max_memory: int | str | None = None,
    keep: bool = False,
    settings: Settings | None = None,
    output: str | os.PathLike[str] | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    name: str | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    checkpoint_every: float | str = INTERVAL,
    overwrite: bool = False,
    **options: Unpack[RefineOptions],
) -> Result:
    """Improve the paths of any SVG against an image by gradient descent; none is added.

    Args:
        svg: a string with a ``<`` in it is the SVG's text, any other its path; or bytes, or an open file.
        image: as for ``vectorize``.
        iterations: steps.
        keep: keep text, images, filters ... as they are, in their place, instead of refusing them.
        name: how messages call the SVG.
        max_memory: bytes, or ``"4GB"``; without, what the machine has. An image that takes more is refused:
            whether a result is better is for all of its pixels to say.
        settings: in place of all options.
        output: as for ``vectorize``, as is all that follows.
        device: see there.
        threads: see there.
        callback: see there.
        stop: see there.
        checkpoint: see there.
        resume: see there.
        checkpoint_every: see there.
        overwrite: see there.
        options: see ``RefineOptions``.

    Returns:
        the result; ``before`` is the PSNR of the SVG itself, which is returned unchanged where nothing better
        was found.

    Raises:
        UsageError, ImageError, CheckpointError, OutputError, ResourceError, TypeError: as for
            ``vectorize``; an SVG that cannot be read, or held, is an ``ImageError``.
    """
    settings = settings or make_settings(iterations=iterations, max_memory=max_memory, **options)
    name = name or svg_name_of(svg)
    text, image_name = text_of(svg, name), source_name(image)
    pixels = held(image)
    check_refined(pixels, settings, image_name)
    target = load_target(pixels, image_name, settings.background)
    kept = checkpoint_file(checkpoint, checkpoint_every, (image, output), resume=resume, overwrite=overwrite)
    watch = Watch(callback, stop)
    with backend_on(device, threads) as backend:
        result = refine_scene(
            text,
            target,
            settings,
            backend,
            name=name,
            keep=keep,
            report=watch.report,
            stop=watch.stop,
            checkpoint=kept,
        )
    if output is not None:
        write_named(Path(output), result.svg)
    if kept and not result.stopped:
        kept.remove()
    return result
