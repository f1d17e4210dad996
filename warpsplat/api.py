"""The library: what ``import warpsplat`` offers, and what the commands are made of.

Nothing is printed and no file is written unless asked for. Functions may be called from several threads: on a
CPU they run side by side, on a GPU one after the other. Warp starts with the first call.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from warpsplat.errors import ImageError, UsageError
from warpsplat.files.output import write_result
from warpsplat.files.sources import ImageSource, Readable, image_of, source_bytes, source_name
from warpsplat.fit.export import export
from warpsplat.fit.place import grid_scene
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Painting, Quality, Renderer, Settings, Subject, make_settings
from warpsplat.fit.stages import INTERVAL
from warpsplat.fit.step import model_for
from warpsplat.fit.texts import parse_duration
from warpsplat.fit.work import Progress
from warpsplat.jobs.checkpoint import CheckpointFile
from warpsplat.jobs.formats import write_named
from warpsplat.jobs.memory import check_refined
from warpsplat.jobs.options import settings_from
from warpsplat.jobs.refine import refine as refine_scene
from warpsplat.jobs.render import RendererName, drawn
from warpsplat.jobs.reports.several import several_page, versions_of
from warpsplat.jobs.reports.single import Facts, report_page
from warpsplat.jobs.several import vectorize_several as make_several
from warpsplat.jobs.suggest import Suggestion, suggest_curves
from warpsplat.jobs.vectorize import Result, load_target, vectorize_image
from warpsplat.metrics import Score, score_svg
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.rendering.renderer import render_into
from warpsplat.rendering.turns import turn
from warpsplat.scene import FloatArray, Kind, Scene
from warpsplat.svg.inspect import inspect_svg, svg_size, svg_text
from warpsplat.svg.read import load_scene
from warpsplat.svg.read_kept import load_kept
from warpsplat.svg.write import minified

SvgSource = str | os.PathLike[str] | bytes | Readable
"""An SVG: its text (a string with a ``<`` in it), its file's path, its bytes, or a file open for reading;
gzipped or not."""

Callback = Callable[[Progress], bool | None]
"""Called with each report of a run; one that returns True ends it with the shapes as they are."""


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
    kept = _checkpoint(
        checkpoint, checkpoint_every, (image, importance, output), resume=resume, overwrite=overwrite
    )
    watch = _Watch(callback, stop)
    with _backend(device, threads) as backend:
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


def vectorize_several(
    image: ImageSource,
    curves: Sequence[int],
    *,
    settings: Settings | None = None,
    importance: ImageSource | None = None,
    outputs: Sequence[str | os.PathLike[str]] | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    ready: Callable[[Result], None] | None = None,
    name: str | None = None,
) -> tuple[Result, ...]:
    """Turn an image into SVGs of several numbers of shapes, which share what work they can.

    Args:
        image: as for ``vectorize``.
        curves: numbers of shapes; of a drawing, the most. They are made from few to many.
        settings: all that decides the results but their numbers, made by ``make_settings``; default: those
            of ``vectorize``.
        importance: as for ``vectorize``.
        outputs: a file for each number, written as soon as it is made.
        device: as for ``vectorize``.
        threads: see there.
        callback: see there; ``Progress.work`` is the share of all that is to be done. One that returns True
            ends the run.
        stop: see there.
        ready: called with each result as soon as there is one.
        name: see ``vectorize``.

    Returns:
        a result for each number, in the order of ``curves``; where the run was stopped, of the smallest ones
        alone, and that of most shapes may be ``stopped``.

    Raises:
        UsageError: a number that is out of range or there twice; settings that say how many shapes there
            are, as goals and levels do; line art and pixel art, which say so themselves.
        ImageError, OutputError, ResourceError, TypeError: as for ``vectorize``.
    """
    if outputs is not None and len(outputs) != len(curves):
        raise UsageError(f"{len(curves)} numbers of shapes and {len(outputs)} outputs")
    watch = _Watch(callback, stop)
    with _backend(device, threads) as backend:
        return make_several(
            image,
            tuple(curves),
            settings or make_settings(),
            backend,
            outputs=None if outputs is None else [Path(output) for output in outputs],
            name=name,
            importance=importance,
            report=watch.report,
            stop=watch.stop,
            ready=ready,
        )


def suggest(
    image: ImageSource,
    *,
    settings: Settings | None = None,
    importance: ImageSource | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    name: str | None = None,
) -> Suggestion | None:
    """How many shapes an image is worth: where its quality against shapes, and against bytes, has its knee.

    A short fit on a reduced image, whose shapes grow from few to many, says what each number is expected to
    give; it takes a fraction of what a run takes.

    Args:
        image: as for ``vectorize``.
        settings: of the runs that it is about, made by ``make_settings`` without ``curves`` or a goal.
        importance: as for ``vectorize``, as is all that follows.
        device: see there.
        threads: see there.
        callback: see there.
        stop: see there.
        name: see there.

    Returns:
        the number, the reason, and what it and others are expected to give at the default effort; None where
        it was stopped. Of images that are traced there is no number to choose, which the reason says.

    Raises:
        UsageError: settings that say how many shapes there are.
        ImageError, ResourceError, TypeError: as for ``vectorize``.
    """
    watch = _Watch(callback, stop)
    with _backend(device, threads) as backend:
        return suggest_curves(
            image,
            settings or make_settings(),
            backend,
            name=name,
            importance=importance,
            report=watch.report,
            stop=watch.stop,
        )


def refine(
    svg: SvgSource,
    image: ImageSource,
    *,
    iterations: int = 200,
    time_budget: float | str | None = None,
    max_memory: int | str | None = None,
    precision: int | None = None,
    title: str | None = None,
    ids: bool | None = None,
    minify: bool | None = None,
    background: str | None = None,
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
) -> Result:
    """Improve the paths of any SVG against an image by gradient descent; none is added.

    Args:
        svg: a string with a ``<`` in it is the SVG's text, any other its path; or bytes, or an open file.
        image: as for ``vectorize``.
        iterations: steps.
        keep: keep text, images, filters ... as they are, in their place, instead of refusing them.
        name: how messages call the SVG.
        time_budget: as for ``vectorize``, as is all that follows but for the memory.
        max_memory: bytes, or ``"4GB"``; without, what the machine has. An image that takes more is refused:
            whether a result is better is for all of its pixels to say.
        precision: see there.
        title: see there.
        ids: see there.
        minify: see there.
        background: see there.
        settings: in place of all of them.
        output: see there.
        device: see there.
        threads: see there.
        callback: see there.
        stop: see there.
        checkpoint: see there.
        resume: see there.
        checkpoint_every: see there.
        overwrite: see there.

    Returns:
        the result; ``before`` is the PSNR of the SVG itself, which is returned unchanged where nothing better
        was found.

    Raises:
        UsageError, ImageError, CheckpointError, OutputError, ResourceError, TypeError: as for
            ``vectorize``; an SVG that cannot be read, or held, is an ``ImageError``.
    """
    settings = settings or make_settings(
        iterations=iterations,
        time_budget=time_budget,
        max_memory=max_memory,
        precision=precision,
        title=title,
        ids=ids,
        minify=minify,
        background=background,
    )
    name = name or _svg_name(svg)
    text, image_name = _text(svg, name), source_name(image)
    pixels = source_bytes(image) if isinstance(image, (str, os.PathLike, bytes, Readable)) else image
    check_refined(pixels, settings, image_name)
    target = load_target(pixels, image_name, settings.background)
    kept = _checkpoint(checkpoint, checkpoint_every, (image, output), resume=resume, overwrite=overwrite)
    watch = _Watch(callback, stop)
    with _backend(device, threads) as backend:
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


def render(
    scene: Scene | SvgSource,
    width: int | None = None,
    height: int | None = None,
    *,
    scale: float | None = None,
    renderer: RendererName = "exact",
    device: str = "auto",
    threads: int | None = None,
) -> FloatArray:
    """Draw a scene or an SVG.

    Args:
        scene: what to draw.
        width: [px]; the canvas, or the SVG's own size, is scaled to it.
        height: [px]; without one of the two the other says the size.
        scale: magnification, in place of both.
        renderer: ``exact`` coverage, ``splat`` or (scenes only) ``gaussian``; ``viewer`` is resvg.
        device: where to compute, see ``vectorize``.
        threads: see there.

    Returns:
        sRGB in [0, 1] premultiplied by opacity, and opacity, shape (height, width, 4). ``to_pillow`` makes an
        image of 8 bits of it.

    Raises:
        UsageError: sizes of other proportions than the scene's, or of no pixel.
        ImageError: an SVG that cannot be read, or not by this renderer.
    """
    if not isinstance(scene, Scene):
        text = _text(scene, _svg_name(scene))
        own = svg_size(inspect_svg(text).root)
        if own is None:
            raise ImageError(f"{_svg_name(scene)}: says neither its size nor a viewBox")
        zoom = _zoom(own, width, height, scale)
        with _backend(device, threads) as backend:
            return _with_opacity(drawn(text, renderer, zoom, backend))
    size = (scene.canvas.width, scene.canvas.height)
    zoom = _zoom(size, width, height, scale)
    if renderer == "viewer":
        return render(save_svg(scene), scale=zoom, renderer="viewer")
    viewport = Viewport(width or max(1, round(size[0] * zoom)), height or max(1, round(size[1] * zoom)), zoom)
    with _backend(device, threads) as backend:
        model = model_for(Settings(renderer=renderer), 0)
        return _with_opacity(render_into(scene, viewport, model=model, backend=backend))


def load_image(image: ImageSource) -> FloatArray:
    """An image as it is fitted: upright, sRGB in [0, 1], shape (height, width, 3), float32; with opacity
    premultiplied by it, shape (height, width, 4).

    Args:
        image: as for ``vectorize``.

    Raises:
        ImageError: it cannot be read.
    """
    return image_of(image)


def starting_scene(
    image: ImageSource, curves: int = 128, *, open: bool = False, seed: int = 0, background: str = "auto"
) -> Scene:
    """Shapes to begin a fit of your own with: a loose grid over the canvas, in the colours of the image.

    Args:
        image: as for ``vectorize``.
        curves: number of shapes.
        open: strokes of three cubics in place of filled rings of quadratics.
        seed: of random numbers.
        background: as for ``vectorize``.

    Raises:
        UsageError: a value out of range.
        ImageError: the image cannot be read.
    """
    settings = make_settings(
        curves=curves, kind=_kind(closed=None, open=open), seed=seed, background=background
    )
    target = load_target(image, None, background)
    return grid_scene(settings, target, curves, np.random.default_rng(seed))


def load_svg(svg: SvgSource, *, keep: bool = False) -> Scene:
    """The paths of any SVG as a scene, at the SVG's own size.

    Args:
        svg: as for ``refine``.
        keep: hold text, images, filters ... as pictures, which are drawn and written as they are.

    Raises:
        ImageError: not an SVG, one without a size or without paths, or one with something that a scene
            cannot hold.
    """
    name = _svg_name(svg)
    text = _text(svg, name)
    try:
        size = svg_size(inspect_svg(text).root)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    if size is None:
        raise ImageError(f"{name}: says neither its size nor a viewBox")
    width, height = (max(1, math.floor(side + 0.5)) for side in size)
    if keep:
        kept = load_kept(text, width, height, name)
        scene, has_background = kept.scene, kept.has_background
    else:
        scene, has_background = load_scene(text, width, height, name)
    return scene if has_background else replace(scene, canvas=replace(scene.canvas, background=None))


def save_svg(
    scene: Scene,
    path: str | os.PathLike[str] | None = None,
    *,
    precision: int | None = None,
    title: str = "",
    ids: bool = False,
    minify: bool = False,
) -> str:
    """The SVG of a scene, written to ``path`` where one is given, which is replaced in one step.

    Args:
        scene: what to write.
        path: says by its ending what is written, see ``Result.save``.
        precision: decimals of a pixel in coordinates; default: two.
        title: as for ``vectorize``, as are ``ids`` and ``minify``.
        ids: see there.
        minify: see there.

    Raises:
        UsageError: a value out of range.
        OutputError: ``path`` cannot be written.
    """
    settings = make_settings(precision=precision, title=title, ids=ids)
    text = export(scene, settings, finest(settings))
    text = minified(text) if minify else text
    if path is not None:
        write_named(Path(path), text)
    return text


def score(svg: SvgSource, image: ImageSource) -> Score:
    """How well an SVG, as a viewer shows it at the image's size, shows the image, and what it is made of.

    Where the image has opacity, on black and on white, and the lower figures count.

    Raises:
        ImageError: either cannot be read, or their proportions differ.
    """
    name = _svg_name(svg)
    target, text = image_of(image), _text(svg, name)
    try:
        return score_svg(text, target)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error


def report(
    result: Result | SvgSource | list[Result] | tuple[Result, ...],
    image: ImageSource,
    output: str | os.PathLike[str] | None = None,
    *,
    command: str = "",
    name: str | None = None,
    svg_name: str | None = None,
    device: str = "auto",
    threads: int | None = None,
) -> str:
    """A page on a result, to look at in a browser: one file that needs nothing else and no network.

    It shows image and SVG under a slider, where they differ, the shapes with the decibels that each is worth,
    the figures and the course of the run. Of several results it compares these.

    Args:
        result: what ``vectorize`` or ``refine`` made; or any SVG, as for ``refine``, which is measured; or
            several results of one image, as ``vectorize_several`` makes them.
        image: that it shows, as for ``vectorize``.
        output: file to write the page to; an existing one is replaced in one step.
        command: what makes the result again, for people.
        name: of the image, for people; default: its file's name.
        svg_name: that the SVG is downloaded as; default: the image's name with ``.svg``. Those of several
            results have their numbers of shapes in their names.
        device: where to compute, see ``vectorize``.
        threads: see there.

    Returns:
        the page.

    Raises:
        ImageError: the image or the SVG cannot be read, or their proportions differ.
        OutputError: ``output`` cannot be written.
    """
    name = name or Path(source_name(image)).name
    svg_name = svg_name or Path(name).with_suffix(".svg").name
    if isinstance(result, (list, tuple)):
        versions = versions_of(result, svg_name)
        made = several_page(versions, image, name=name, command=command)
        if output is not None:
            write_result(Path(output), made.encode())
        return made
    if isinstance(result, Result):
        text, facts, own = result.svg, Facts.of(result, command), result.before is None
    else:
        text = _text(result, _svg_name(result))
        image = source_bytes(image) if isinstance(image, (str, os.PathLike, Readable)) else image
        facts, own = Facts(score(text, image).as_dict(), command=command), False
    with _backend(device, threads) as backend:
        made = report_page(
            text,
            image,
            backend,
            facts,
            name=name,
            svg_name=svg_name,
            own=own,
        ).text
    if output is not None:
        write_result(Path(output), made.encode())
    return made


def _kind(*, closed: bool | None, open: bool | None) -> Kind | None:
    if closed and open:
        raise UsageError("closed and open do not go together")
    if open or closed is False:
        return Kind.STROKE
    return Kind.FILL if closed else None


class _Watch:
    """What a run reports to, and what it asks whether to go on."""

    def __init__(self, callback: Callback | None, stop: Callable[[], bool] | None) -> None:
        self._callback, self._stop, self._enough = callback, stop, False

    def report(self, progress: Progress) -> None:
        if self._callback and self._callback(progress) is True:
            self._enough = True

    def stop(self) -> bool:
        return self._enough or bool(self._stop and self._stop())


def _checkpoint(
    path: str | os.PathLike[str] | None,
    every: float | str,
    others: tuple[object, ...],
    *,
    resume: bool,
    overwrite: bool,
) -> CheckpointFile | None:
    """Where a run keeps its state, which is none of the ``others`` that are paths."""
    if path is None:
        if resume:
            raise UsageError("to resume, a run needs a checkpoint")
        return None
    made = CheckpointFile(Path(path), resume, overwrite, parse_duration(every))
    made.check(*(Path(other) for other in others if isinstance(other, (str, os.PathLike))))
    return made


@contextmanager
def _backend(device: str, threads: int | None) -> Iterator[Backend]:
    """The backend of a piece of work, with the right to use it."""
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int) or threads < 1):
        raise UsageError(f"threads must be a whole number from 1, not {threads!r}")
    start_warp()
    backend = Backend.on(choose_device(device), threads)
    with turn(backend.device):
        yield backend


def _svg_name(svg: object) -> str:
    return "the SVG" if isinstance(svg, str) and "<" in svg else source_name(svg, "the SVG")


def _text(svg: SvgSource, name: str) -> str:
    if isinstance(svg, str) and "<" in svg:
        return svg
    if not isinstance(svg, (str, os.PathLike, bytes, bytearray, memoryview, Readable)):
        raise TypeError(f"an SVG is its text, a path, bytes or a file, not {type(svg).__name__}")
    return svg_text(source_bytes(svg, "an SVG"), name)


def _zoom(size: tuple[float, float], width: int | None, height: int | None, scale: float | None) -> float:
    """Pixels per unit of something of ``size`` that is drawn with this width, height or scale."""
    if scale is not None and (width is not None or height is not None):
        raise UsageError("a scale, and a width or height besides")
    for what, side in (("width", width), ("height", height)):
        if side is not None and (isinstance(side, bool) or int(side) != side or side < 1):
            raise UsageError(f"{what} must be a whole number from 1, not {side!r}")
    if scale is not None:
        if not (math.isfinite(scale) and scale > 0):
            raise UsageError(f"scale must be a positive number, not {scale}")
        return scale
    if width is None and height is None:
        return 1.0
    zoom = width / size[0] if width is not None else (height or 1) / size[1]
    if width is not None and height is not None and abs(size[1] * zoom - height) >= 1:
        raise UsageError(f"{width}x{height} px have not the proportions of {size[0]:g}x{size[1]:g}")
    return zoom


def _with_opacity(image: npt.NDArray[np.float32]) -> FloatArray:
    return image if image.shape[2] == 4 else np.concatenate([image, np.ones_like(image[..., :1])], axis=2)
