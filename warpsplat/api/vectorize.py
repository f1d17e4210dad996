"""``warpsplat.vectorize``."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from warpsplat.api.run import Callback, Watch, backend_on, checkpoint_file
from warpsplat.errors import UsageError
from warpsplat.files.sources import ImageSource
from warpsplat.fit.settings import Settings
from warpsplat.fit.stages import INTERVAL
from warpsplat.run.keywords import settings_given, takes
from warpsplat.run.result import Result
from warpsplat.run.typed import Options
from warpsplat.run.vectorize import vectorize_image

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(Options)
def vectorize(
    image: ImageSource,
    curves: int | None = None,
    *,
    settings: Settings | None = None,
    importance: ImageSource | None = None,
    output: str | os.PathLike[str] | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    name: str | None = None,
    keyed: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    checkpoint_every: float | str = INTERVAL,
    overwrite: bool = False,
    **options: Unpack[Options],
) -> Result:
    """Turn an image into an SVG, and measure how good it is.

    The options are those of the command line; one that is None is chosen as the command line chooses it.

    Args:
        image: a path, the bytes of an image file, a file open for reading, a Pillow image, or an array of
            shape (height, width[, channels]) of uint8, uint16, bool, or floats in [0, 1].
        curves: number of shapes; of drawings and with a goal, the most.
        settings: all options at once, made by ``make_settings``; none may be given besides.
        importance: mask of the image's proportions, in any of the image's forms: how much errors count.
        output: file to write the SVG to, before it is measured, or what its name ends with (``Result.save``);
            ``-`` is the standard output.
        device: ``auto``, ``cpu``, ``cuda`` or ``cuda:N``.
        threads: of a CPU, default one a core; they do not change the result.
        callback: see ``Callback``.
        stop: asked after every step; once true, the shapes as they are make the file.
        name: how messages call the image; default: its file's name.
        keyed: mark the file with what it was made of, by which batches know it.
        checkpoint: file in which the state of the run is kept until it is done, every ``checkpoint_every``
            and when it is stopped.
        resume: go on from the checkpoint, to the bytes of an uninterrupted run; where there is none, start.
        checkpoint_every: seconds, or ``"2m"``.
        overwrite: let a run that starts anew replace a checkpoint, or any other file, of that name.
        options: see ``Options`` and the documentation's table.

    Returns:
        the SVG, its scene, its score and the run's history.

    Raises:
        UsageError: a setting or device that cannot be used as given.
        ImageError: an image or mask that cannot be read.
        CheckpointError: a checkpoint that cannot be read; one of another run is a ``UsageError``.
        OutputError: ``output`` cannot be written.
        ResourceError: memory, threads, or a place for compiled kernels are missing.
        TypeError: an image of none of these forms, or an unknown keyword.
    """
    if isinstance(curves, (list, tuple)):
        raise UsageError(f"several numbers of shapes: vectorize_several(image, {list(curves)})")
    settings = settings_given(settings, curves=curves, **options)
    kept = checkpoint_file(
        checkpoint, checkpoint_every, (image, importance, output), resume=resume, overwrite=overwrite
    )
    watch = Watch(callback, stop)
    with backend_on(device, threads) as backend:
        return vectorize_image(
            image,
            settings,
            backend,
            output=None if output is None else Path(output),
            name=name,
            importance=importance,
            keyed=keyed,
            report=watch.report,
            stop=watch.stop,
            checkpoint=kept,
        )
