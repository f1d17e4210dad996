"""``warpsplat compare``."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.options import (
    INPUT,
    Numbers,
    Request,
    flag,
    json_option,
    overwrite_option,
    run_options,
)
from warpsplat.compare.tracer import TRACERS
from warpsplat.errors import Stopped, UsageError, printable
from warpsplat.run.options import BY_NAME, settings_from

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from warpsplat.compare.comparison import Comparison, ComparisonRow
    from warpsplat.compare.tracer import Tracer
    from warpsplat.fit.settings import Settings
    from warpsplat.run.result import Result
    from warpsplat.scene import FloatArray

TABLES, FIGURES = "comparison.md", "comparison.json"
"""Files in the folder besides the SVGs."""


def svg_name(image: Path, program: str, setting: str) -> str:
    """Return the name of the file that ``program`` makes of ``image`` at ``setting``."""
    return f"{image.stem}.{program.lower()}-{setting}.svg"


def prepare_folder(
    folder: Path, images: Sequence[Path], settings: Sequence[Settings], tracer: Tracer, *, overwrite: bool
) -> None:
    """Make the folder of the results; raise ``UsageError`` if they exist or cannot be written."""
    from warpsplat.compare.comparison import OURS
    from warpsplat.files.output import check_output

    made = [(OURS, str(ours.curves)) for ours in settings]
    made += [(tracer.name, setting) for setting in tracer.settings]
    names = [*(svg_name(image, *one) for image in images for one in made), TABLES, FIGURES]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be made: {error.strerror}") from error
    for name in names:
        check_output(folder / name, *images, overwrite=overwrite)


def read_images(images: Sequence[Path]) -> dict[Path, bytes]:
    """Read all images, before the run; raise ``UsageError`` if two have the same name."""
    from warpsplat.files.inputs import input_name, read_input
    from warpsplat.files.sources import image_of

    found: dict[Path, bytes] = {}
    for path in images:
        if path.stem in {other.stem for other in found}:
            raise UsageError(f"{path}: another image has the name {path.stem} as well")
        found[path] = read_input(path)
        image_of(found[path], input_name(path))
    return found


@click.command("compare")
@click.argument("images", nargs=-1, required=True, type=INPUT)
@click.option("--against", type=click.Choice(list(TRACERS)), required=True, help="The other program.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help=f"Write all SVGs, {TABLES} and {FIGURES} there.",
)
@overwrite_option
@click.option(
    "--curves",
    type=Numbers(several=True),
    default="64,256,512",
    show_default=True,
    metavar="N,N...",
    help="Numbers of shapes.",
)
@flag(BY_NAME["closed"])
@flag(BY_NAME["open"])
@flag(BY_NAME["quality"])
@flag(BY_NAME["iterations"])
@flag(BY_NAME["seed"])
@run_options
@json_option
def command(images: tuple[Path, ...], against: str, curves: int | tuple[int, ...], **given: Any) -> None:
    """Compare our files of IMAGES with those of another program.

    Each image is vectorized by us with several numbers of shapes (for
    drawings, upper limits), and by the other program at several of its
    settings. All files are measured as by eval: PSNR, SSIM, size, paths,
    nodes; and the time they took. Both get the same pixels, with
    transparency on white.

    VTracer must be installed.
    """
    request = Request.taken(images[0], given)
    numbers = curves if isinstance(curves, tuple) else (curves,)
    settings = [settings_from({**given, "curves": n}) for n in sorted({*numbers})]
    tracer, output = TRACERS[against](), request.output
    sources = read_images(images)
    if output:
        prepare_folder(output, images, settings, tracer, overwrite=request.overwrite)
    from warpsplat.cli.run import watched
    from warpsplat.compare.comparison import Comparison, compare, warm_up
    from warpsplat.files.output import write_result
    from warpsplat.files.sources import image_of
    from warpsplat.fit.problem import Problem, Run
    from warpsplat.rendering.backend import Backend
    from warpsplat.rendering.device import choose_device, start_warp
    from warpsplat.run.prepare import PreparedImage, choose_subject
    from warpsplat.run.vectorize import make_result

    start_warp()
    backend = Backend.on(choose_device(request.device), request.threads)

    def run(path: Path, target: FloatArray, ours: Settings, write: Callable[[str], None]) -> Result:
        with watched(request, path) as (report, stop):
            chosen, *_ = choose_subject(target, ours)
            return make_result(PreparedImage(Problem(target, chosen)), Run(backend, report, stop), write)

    rows: list[ComparisonRow] = []
    try:
        warm_up(settings[0], backend)
        for path, data in sources.items():
            target, name = image_of(data, paper=1.0), printable(path.name)
            for row in compare(name, target, settings, tracer, partial(run, path)):
                rows.append(row)
                if output and row.svg:
                    write_result(output / svg_name(path, row.program, row.setting), row.svg.encode())
                if request.verbose:
                    echo(f"{row.image}: {row.program}, {row.setting}: {row.seconds:.1f} s", err=True)
    except Stopped as error:
        raise KeyboardInterrupt from error
    finally:
        if rows:  # also after a failure
            publish(Comparison(rows, settings[0], tracer), request)


def publish(found: Comparison, request: Request) -> None:
    """Write tables and figures into the folder, and print one of them."""
    from warpsplat.compare.tables import markdown
    from warpsplat.files.output import write_result

    tables, figures = markdown(found), json.dumps(found.as_dict())
    if request.output:
        write_result(request.output / TABLES, f"{tables}\n".encode())
        write_result(request.output / FIGURES, f"{figures}\n".encode())
    if request.as_json:
        echo(figures)
    elif not request.quiet:
        echo(tables)
