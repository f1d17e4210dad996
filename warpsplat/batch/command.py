"""``warpsplat batch``."""

from __future__ import annotations

import contextlib
import re
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpsplat.batch.cluster import Cluster, cluster_of, cluster_options
from warpsplat.cli.echo import echo
from warpsplat.cli.options import (
    FILE,
    importance_option,
    overwrite_option,
    quality_options,
    threads_option,
    verbosity_options,
)
from warpsplat.errors import ExitCode, UsageError, shown
from warpsplat.extensions import extensions
from warpsplat.files.inputs import STANDARD
from warpsplat.run.options import KINDS

if TYPE_CHECKING:
    from warpsplat.batch.executors.tasks import Executor
    from warpsplat.batch.manifest import Manifest
    from warpsplat.batch.plan import Job
    from warpsplat.cli.options import Request
    from warpsplat.cli.signals import Interrupt


@dataclass(frozen=True)
class BatchOptions:
    """Options of a batch that do not change its results."""

    overwrite: bool = False
    retry_failed: bool = False
    dry_run: bool = False
    workers: int | None = None
    threads: int | None = None
    shard: tuple[int, int] = (1, 1)
    manifest: Path | None = None
    report: Path | None = None
    """Folder of pages on the results, or the page that lists them."""
    cluster: Cluster | None = None
    """Other machines; None: this one."""
    quiet: bool = False
    as_json: bool = False


def index_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--report`` if the extension pages is there."""
    if "pages" not in extensions():
        return function
    option = click.option(
        "--report",
        type=FILE,
        metavar="DIR",
        help="Pages on the results, and DIR/index.html, which lists them; or a name that ends with .html.",
    )
    return option(function)


class Shard(click.ParamType):
    """``i/n``."""

    name = "I/N"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Parse two numbers, the first from 1 to the second."""
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", value)
        if not found or not 1 <= int(found[1]) <= int(found[2]):
            self.fail(f"{shown(value)} is no I/N, as 1/4 for the first of four parts", param, ctx)
        return int(found[1]), int(found[2])


@click.command("batch", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("inputs", nargs=-1, required=True, metavar="INPUT...")
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    help="Folder for the results, or their names: out/{stem}-{curves}.svg.  [default: beside each image]",
)
@overwrite_option
@click.option(
    "--set",
    "sets",
    multiple=True,
    metavar="KEY=VALUE",
    help="Any key of batch files, as curves=64; may be there several times.",
)
@click.option("-n", "--dry-run", is_flag=True, help="Say what would be done, and do nothing.")
@click.option("--retry-failed", is_flag=True, help="Try again what failed in an earlier run.")
@click.option(
    "--workers",
    type=click.IntRange(min=1, max=1024),
    metavar="N",
    help="Images at the same time, each in a process.  [default: one a core, if that pays]",
)
@cluster_options
@click.option(
    "--shard",
    type=Shard(),
    default=(1, 1),
    help="Do part I of N of the images: 1/4.",
)
@click.option(
    "--manifest",
    type=FILE,
    metavar="FILE",
    help="Notes of what was made, as JSON lines.  [default: warpsplat-manifest.jsonl, with the results]",
)
@index_option
@quality_options
@importance_option
@click.option("--device", help="auto (a GPU if there is one), cpu, or cuda:N.")
@threads_option
@verbosity_options
@click.option(
    "--json", "as_json", is_flag=True, help="Print a JSON object for each image, and one at the end."
)
def command(
    inputs: tuple[str, ...],
    sets: tuple[str, ...],
    importance: Path | None,
    executor: str | None,
    gpus: float | None,
    verbose: int,
    **given: Any,
) -> None:
    """Vectorize many images: INPUT is an image, a folder, a pattern or a YAML file.

    An image that fails is reported and the rest are done (exit 5). A result
    that is there already, made by the same settings from the same image, is not
    made again. A YAML file says what is to be done with which images:

    \b
    defaults:
      curves: 512          # keys are the long flags of vectorize
      output: svg          # folder for the results
    jobs:
      - images: photos/*.jpg
      - images: [logo.png, icons/*.png]
        curves: 64

    Its paths are relative to it. What the command line says is stronger.
    """  # noqa: D301
    names = [field.name for field in fields(BatchOptions) if field.name in given]
    options = BatchOptions(cluster=cluster_of(executor, gpus), **{name: given.pop(name) for name in names})
    flags = flags_of({**given, "importance": None if importance is None else str(importance)})
    perform(inputs, flags, sets, options)


def vectorize_images(
    images: Sequence[Path], request: Request, given: Mapping[str, Any], hooked: Mapping[str, Any]
) -> None:
    """Make an SVG of each image, in the folder that ``request`` has as its output, or here.

    ``given``: settings; ``hooked``: the options of hooks, as the command line has them.

    Raises:
        UsageError: an option that takes one image only.
    """
    from warpsplat.run.names import is_pattern

    output = request.output
    if STANDARD in images or STANDARD in (output, request.importance):
        raise UsageError(
            "of several images none can come from the standard input, or go to the standard output"
        )
    if output is not None and is_pattern(str(output)) and "{stem}" not in str(output):
        raise UsageError(f"{output}: is not a folder, and of {len(images)} images each has a result")
    device = None if request.device == "auto" else request.device
    flags = flags_of({**given, "device": device, "importance": request.importance})
    options = BatchOptions(
        overwrite=request.overwrite,
        threads=request.threads,
        report=hooked.get("report"),
        quiet=request.quiet,
        as_json=request.as_json,
    )
    perform(list(map(str, images)), {**flags, "output": str(output or ".")}, (), options)


def flags_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return flags of settings as keys of batch files."""
    flags = {key.replace("_", "-"): value for key, value in given.items() if key != "kind"}
    return flags | {name: True for name, kind in KINDS.items() if given.get("kind") == kind}


def perform(
    inputs: Sequence[str], flags: Mapping[str, Any], sets: Sequence[str], options: BatchOptions
) -> None:
    """Do a batch, and exit with the code for failures or missed goals, if there are any.

    Raises:
        WarpsplatError: the batch as a whole cannot be done.
    """
    from warpsplat.batch.index import Index
    from warpsplat.batch.layers import command_layer
    from warpsplat.batch.manifest import NAME, Manifest
    from warpsplat.batch.plan import home_of, in_shard, plan_jobs
    from warpsplat.batch.reports import Reports
    from warpsplat.batch.run import Batch, JobReport
    from warpsplat.batch.show import Show
    from warpsplat.cli import signals

    planned = plan_jobs(inputs, command_layer(flags, sets))
    home = home_of(planned, inputs)
    jobs = [job for job in planned if in_shard(job, home, *options.shard)]
    show = Show(len(jobs), quiet=options.quiet, as_json=options.as_json)
    interrupt, begun = signals.Interrupt(), time.monotonic()
    with contextlib.closing(Manifest(options.manifest or home / NAME)) as notes:
        notes.open(write=False)
        if notes.damaged:
            echo(f"warpsplat: {notes.path}: damaged lines are ignored: {notes.damaged}", err=True)
        if not options.overwrite:
            check_ours(jobs, notes)
        executor, threads = executor_for(jobs, options, interrupt)
        reports = None
        if options.report and not options.dry_run:
            taken = [notes.path, *(path for job in jobs for path in (job.output, job.image))]
            reports = Reports.at(options.report, home, taken=taken, overwrite=options.overwrite)
        index = Index(planned, reports) if reports else None

        def on_report(report: JobReport) -> None:
            if index:
                index.add(report)
            show.add(report)

        batch = Batch(
            jobs, notes, on_report=on_report, retry=options.retry_failed, threads=threads, reports=reports
        )
        with interrupt.watching():
            if options.dry_run:
                batch.dry_run(interrupt)
            else:
                notes.open()
                with contextlib.suppress(KeyboardInterrupt), executor:
                    batch.run(executor, interrupt, show.advance)
                if index:
                    index.write(notes)
    show.finish(time.monotonic() - begun, executor.workers, notes.path)
    if options.dry_run:
        return
    if show.totals.failures:
        sys.exit(ExitCode.SOME_FAILED)
    if show.totals.missed:
        sys.exit(ExitCode.GOAL_MISSED)


def executor_for(
    jobs: Sequence[Job], options: BatchOptions, interrupt: Interrupt
) -> tuple[Executor, int | None]:
    """Return the executor of the jobs, and the threads of each.

    Raises:
        UsageError: an unknown device.
    """
    if options.cluster:
        return options.cluster.executor(options.workers), options.threads or 1
    from warpsplat.batch.executors.pool import Pool
    from warpsplat.batch.executors.serial import Serial
    from warpsplat.batch.executors.split import divided
    from warpsplat.rendering.device import choose_device, start_warp

    start_warp()
    on_cpu = all(choose_device(name).is_cpu for name in {job.device for job in jobs})
    workers, threads = divided(
        [job.settings for job in jobs], options.workers, options.threads, on_cpu=on_cpu
    )
    return Serial(interrupt.watching) if workers == 1 else Pool(workers), threads


def check_ours(jobs: list[Job], manifest: Manifest) -> None:
    """Check that no result replaces a file that warpsplat did not write.

    Raises:
        UsageError: there are such files; the message names them.
    """
    from warpsplat.batch.run import not_ours
    from warpsplat.batch.show import NAMED

    found = not_ours(jobs, manifest)
    if found:
        names = ", ".join(map(str, found[:NAMED])) + (", ..." if len(found) > NAMED else "")
        count = "a result exists and was" if len(found) == 1 else f"{len(found)} results exist and were"
        raise UsageError(f"{count} not written by warpsplat, --overwrite replaces them: {names}")
