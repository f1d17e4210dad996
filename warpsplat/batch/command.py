"""``warpsplat batch``, and ``warpsplat vectorize`` with several images."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpsplat.batch.options import batch_options
from warpsplat.batch.run_options import BatchOptions
from warpsplat.cli.echo import echo
from warpsplat.cli.help import GroupedCommand
from warpsplat.errors import ExitCode, UsageError
from warpsplat.files.inputs import STANDARD
from warpsplat.run.options import with_preset

if TYPE_CHECKING:
    from warpsplat.batch.executors.tasks import Executor
    from warpsplat.batch.plan import BatchJob
    from warpsplat.batch.run import JobOutcome
    from warpsplat.cli.options import Request
    from warpsplat.cli.signals import Interrupt


@click.command("batch", cls=GroupedCommand)
@click.argument("inputs", type=click.Path(readable=False), nargs=-1, required=True, metavar="INPUT...")
@batch_options
def command(inputs: tuple[str, ...], sets: tuple[str, ...], verbose: int, **given: Any) -> None:
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

    Its paths are relative to it. Options on the command line override the file.
    """  # noqa: D301
    options = {each.name: given.pop(each.name) for each in fields(BatchOptions) if each.name in given}
    given = with_preset(given.pop("preset"), given)
    perform(inputs, flags_of(given), sets, BatchOptions(**options))


def vectorize_images(
    images: Sequence[Path], request: Request, given: Mapping[str, Any], hooked: Mapping[str, Any]
) -> None:
    """Make an SVG of each image, in the folder that ``request`` has as its output, or here.

    ``given``: settings; ``hooked``: options of hooks. Raises ``UsageError`` for what takes one image only.
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
    flags = flags_of(
        {**given, "device": device, "importance": request.importance, "output": output or Path()}
    )
    options = BatchOptions(
        overwrite=request.overwrite,
        threads=request.threads,
        report=hooked.get("report"),
        quiet=request.quiet,
        as_json=request.as_json,
    )
    perform(list(map(str, images)), flags, (), options)


def flags_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return flags of settings as keys of batch files."""
    return {
        key.replace("_", "-"): str(value) if isinstance(value, Path) else value
        for key, value in given.items()
    }


def perform(
    inputs: Sequence[str], flags: Mapping[str, Any], sets: Sequence[str], options: BatchOptions
) -> None:
    """Do a batch, and exit with the code for failures or missed goals, if there are any."""
    from warpsplat.batch.display import BatchDisplay
    from warpsplat.batch.index import write_index
    from warpsplat.batch.layers import command_layer
    from warpsplat.batch.manifest import NAME, Manifest
    from warpsplat.batch.plan import home_of, in_shard, plan_jobs
    from warpsplat.batch.reports import Reports
    from warpsplat.batch.results import check_replaceable
    from warpsplat.batch.run import Batch
    from warpsplat.cli import signals

    planned = plan_jobs(inputs, command_layer(flags, sets))
    home = home_of(planned, inputs)
    jobs = [job for job in planned if in_shard(job, home, *options.shard)]
    display = BatchDisplay(len(jobs), quiet=options.quiet, as_json=options.as_json)
    interrupt, begun = signals.Interrupt(), time.monotonic()
    with contextlib.closing(Manifest(options.manifest or home / NAME)) as manifest:
        manifest.open(write=False)
        if manifest.damaged:
            echo(f"warpsplat: {manifest.path}: damaged lines are ignored: {manifest.damaged}", err=True)
        if not options.overwrite:
            check_replaceable(jobs, manifest)
        executor, threads = executor_for(jobs, options, interrupt)
        reports = None
        if options.report and not options.dry_run:
            taken = [manifest.path, *(path for job in jobs for path in (job.output, job.image))]
            reports = Reports.at(options.report, home, taken=taken, overwrite=options.overwrite)
        outcomes: dict[Path, JobOutcome] = {}

        def on_outcome(outcome: JobOutcome) -> None:
            outcomes[outcome.job.output] = outcome
            display.add(outcome)

        batch = Batch(
            jobs,
            manifest,
            on_outcome=on_outcome,
            retry=options.retry_failed,
            threads=threads,
            reports=reports,
        )
        with interrupt.watching():
            if options.dry_run:
                batch.dry_run(interrupt)
            else:
                manifest.open()
                with contextlib.suppress(KeyboardInterrupt), executor:
                    batch.run(executor, interrupt, display.on_progress)
                if reports:
                    write_index(reports, planned, outcomes, manifest)
    display.finish(time.monotonic() - begun, executor.workers, manifest.path)
    if display.failures or display.missed:
        sys.exit(ExitCode.SOME_FAILED if display.failures else ExitCode.GOAL_MISSED)


def executor_for(
    jobs: Sequence[BatchJob], options: BatchOptions, interrupt: Interrupt
) -> tuple[Executor, int | None]:
    """Return the executor of the jobs, and the threads of each; raise ``UsageError`` if there can be none."""
    executor, gpus = options.executor, options.gpus
    name, _, address = (executor or "").partition("=")
    if executor is not None and name != "ray":
        raise UsageError(f"--executor {executor}: must be ray or ray=ADDRESS")
    if gpus is not None and not name:
        raise UsageError("--gpus is for --executor ray; here --device chooses a GPU")
    if gpus is not None and gpus > 1 and not gpus.is_integer():
        raise UsageError(f"--gpus {gpus:g}: must be a fraction of one GPU, such as 0.25, or a whole number")
    if name:
        from warpsplat.batch.executors.ray import RayCluster

        return RayCluster(address, workers=options.workers, gpus=gpus or 1.0), options.threads or 1
    from warpsplat.batch.executors.local import Serial, split_cores
    from warpsplat.batch.executors.pool import Pool
    from warpsplat.rendering.device import choose_device, start_warp

    start_warp()
    on_cpu = all(choose_device(device).is_cpu for device in {job.device for job in jobs})
    settings = [job.settings for job in jobs]
    workers, threads = split_cores(settings, options.workers, options.threads, on_cpu=on_cpu)
    return Serial(interrupt.watching) if workers == 1 else Pool(workers), threads
