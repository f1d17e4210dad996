"""``warpsplat.vectorize``."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from warpsplat.api.run import Callback, Watch, backend_on, checkpoint_file
from warpsplat.errors import UsageError
from warpsplat.files.sources import ImageSource
from warpsplat.fit.settings import Painting, Quality, Renderer, Settings, Subject
from warpsplat.fit.stages import INTERVAL
from warpsplat.run.options import settings_from
from warpsplat.run.result import Result
from warpsplat.run.vectorize import vectorize_image
from warpsplat.scene import Kind


def vectorize(
    image: ImageSource,
    curves: int | None = None,
    *,
    subject: Subject | None = None,
    closed: bool | None = None,
    open: bool | None = None,
    mixed: bool | None = None,
    quality: Quality | None = None,
    renderer: Renderer | None = None,
    paint: Painting | None = None,
    layered: bool | None = None,
    levels: Sequence[int] | str | None = None,
    colors: int | None = None,
    palette: Sequence[str] | str | None = None,
    opaque: bool | None = None,
    iterations: int | None = None,
    target_psnr: float | None = None,
    time_budget: float | str | None = None,
    max_bytes: int | str | None = None,
    max_memory: int | str | None = None,
    seed: int | None = None,
    background: str | None = None,
    title: str | None = None,
    size: str | None = None,
    page: str | None = None,
    units: str | None = None,
    ids: bool | None = None,
    minify: bool | None = None,
    precision: int | None = None,
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
) -> Result:
    """Turn an image into an SVG, and measure how good it is.

    What is None is chosen as the command line chooses it; there and in the README's table of settings each is
    explained under the same name.

    Args:
        image: a path, the bytes of an image file, a file open for reading, a Pillow image, or an array of
            shape (height, width[, channels]) of uint8, uint16, bool, or floats in [0, 1].
        curves: number of shapes; of drawings and with a goal, the most.
        subject: what the image shows: ``auto``, ``photo``, ``drawing``, ``line`` or ``pixel``.
        closed: filled shapes, the default ...
        open: ... or strokes.
        mixed: fills, and strokes where they remove more error.
        quality: effort: ``draft``, ``balanced`` or ``high``.
        renderer: model of coverage while training: ``exact``, ``splat`` or ``gaussian``.
        paint: ``flat`` colours, ``linear`` or ``radial`` gradients, or ``auto``.
        layered: groups from coarse to fine, each with those before it a picture of its own.
        levels: shapes up to the end of each of these groups.
        colors: most different colours.
        palette: the only colours, ``#rrggbb``; or a file with them.
        opaque: no translucent shapes.
        iterations: steps, in place of the effort's.
        target_psnr: the smallest file that has this [dB].
        time_budget: seconds, or ``"2m"``.
        max_bytes: the best file within this size, or ``"100KB"``.
        max_memory: bytes, or ``"4GB"``: an image that takes more is worked on at a smaller size.
        seed: of random numbers.
        background: ``auto``, ``none`` or ``#rrggbb``.
        title: of the picture.
        size: that line art fills, ``"200x150mm"``.
        page: its sheet, ``"a4"``.
        units: of the file's size.
        ids: name paths by their colours.
        minify: smallest text.
        precision: most decimals of a pixel in coordinates.
        settings: all of these at once, made by ``make_settings``; none of the others may be given then.
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

    Returns:
        the SVG, its scene, its score and the run's history.

    Raises:
        UsageError: a setting or device that cannot be used as given.
        ImageError: an image or mask that cannot be read.
        CheckpointError: a checkpoint that cannot be read; one of another run is a ``UsageError``.
        OutputError: ``output`` cannot be written.
        ResourceError: memory, threads, or a place for compiled kernels are missing.
        TypeError: an image of none of these forms.
    """
    if isinstance(curves, (list, tuple)):
        raise UsageError(f"several numbers of shapes: vectorize_several(image, {list(curves)})")
    given = {
        "curves": curves,
        "subject": subject,
        "kind": _kind(closed=closed, open=open),
        "mixed": mixed,
        "quality": quality,
        "renderer": renderer,
        "paint": paint,
        "layered": layered,
        "levels": levels if levels is None or isinstance(levels, str) else ",".join(map(str, levels)),
        "colors": colors,
        "palette": palette if palette is None or isinstance(palette, str) else ",".join(palette),
        "opaque": opaque,
        "iterations": iterations,
        "target_psnr": target_psnr,
        "time_budget": time_budget,
        "max_bytes": max_bytes,
        "max_memory": max_memory,
        "seed": seed,
        "background": background,
        "title": title,
        "size": size,
        "page": page,
        "units": units,
        "ids": ids,
        "minify": minify,
        "precision": precision,
    }
    if settings is None:
        settings = settings_from(given)
    elif others := [key for key, value in given.items() if value is not None]:
        raise UsageError(f"settings are given, and {others[0]} besides")
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


def _kind(*, closed: bool | None, open: bool | None) -> Kind | None:
    if closed and open:
        raise UsageError("closed and open do not go together")
    if open or closed is False:
        return Kind.STROKE
    return Kind.FILL if closed else None
