"""``warpsplat batch``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from warpsplat.cli.options import FILE, overwrite_option, threads_option, voice_options
from warpsplat.cli.say import say
from warpsplat.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from warpsplat.jobs.execute import Outcome
    from warpsplat.jobs.plan import Job
    from warpsplat.jobs.vectorize import Result

NAMED = 20
"""Most files that one message names."""


def check_ours(jobs: list[Job], path: Path) -> None:
    """Refuse to replace files of others.

    Raises:
        UsageError: there are some; the message names them.
    """
    from warpsplat.jobs.plan import not_ours

    found = not_ours(jobs)
    if found:
        names = ", ".join(map(str, found[:NAMED])) + (", ..." if len(found) > NAMED else "")
        raise UsageError(
            f"{path}: {len(found)} results exist and were not written by warpsplat, "
            f"--overwrite replaces them: {names}"
        )


def tell(outcome: Outcome, count: str, *, talk: bool) -> None:
    """Say what became of a job; ``count`` is its number among all."""
    from warpsplat.cli.vectorize import summary

    output, result = outcome.job.output, outcome.result
    if outcome.status == "failed":
        say(f"{count} failed: {outcome.error}", err=True)
    elif talk and outcome.status == "skipped":
        say(f"{count} {output}: already made with these settings")
    elif result:
        if talk:
            say(f"{count} {summary(output, outcome.as_dict())}")
        for goal in result.missed:
            say(f"{count} goal missed: {goal}", err=True)


@click.command("batch", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("jobs", type=FILE)
@click.option("--device", help="Overrides the file's device.")
@overwrite_option
@threads_option
@voice_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object at the end.")
def command(
    jobs: Path,
    device: str | None,
    overwrite: bool,
    threads: int | None,
    verbose: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Vectorize the images that the YAML file JOBS lists.

    \b
    defaults:
      curves: 512          # keys are the long flags of vectorize
      output: svg          # folder for the results
    jobs:
      - images: photos/*.jpg
      - images: [logo.png, icons/*.png]
        curves: 64

    Paths are relative to the file. An image that fails is reported and the
    rest are done (exit 5). A result that is there already, made by the same
    settings from the same image, is not made again.
    """  # noqa: D301
    from warpsplat.cli import signals
    from warpsplat.cli.run import run_file
    from warpsplat.jobs.execute import Outcome, execute
    from warpsplat.jobs.plan import load_jobs
    from warpsplat.rendering.device import choose_device, start_warp

    todo = load_jobs(jobs)
    if not overwrite:
        check_ours(todo, jobs)
    start_warp()
    for name in {device or job.device for job in todo}:
        choose_device(name)  # an unknown one is found before the first image
    outcomes: list[Outcome] = []
    talk = not quiet and not as_json

    def run(job: Job, data: bytes) -> Result:
        return run_file(
            job.image,
            job.output,
            job.settings,
            data=data,
            device=device or job.device,
            threads=threads,
            importance=job.importance,
            keyed=True,
            quiet=quiet,
            verbose=verbose,
        )

    for i, job in enumerate(todo):
        try:
            outcomes.append(execute(job, run))
        except KeyboardInterrupt:
            outcomes.append(Outcome(job, "stopped"))
        tell(outcomes[-1], f"[{i + 1}/{len(todo)}]", talk=talk)
        if signals.received():
            break
    finish(outcomes, len(todo), quiet=quiet, talk=talk, as_json=as_json)


def finish(outcomes: list[Outcome], total: int, *, quiet: bool, talk: bool, as_json: bool) -> None:
    """Sum up, and end the program with the code for it, if there is one to give."""
    from warpsplat.jobs.execute import counts

    numbers = counts(outcomes)
    if as_json:
        say(json.dumps({**numbers, "results": [outcome.as_dict() for outcome in outcomes]}))
    if talk:
        say(f"{total} images: " + ", ".join(f"{n} {name}" for name, n in numbers.items()))
    failed = [outcome.error for outcome in outcomes if outcome.status == "failed"]
    if failed and not quiet:
        say("failed:", err=True)
        for error in failed:
            say(f"  {error}", err=True)
    if failed:
        sys.exit(ExitCode.SOME_FAILED)
    if any(outcome.result and outcome.result.missed for outcome in outcomes):
        sys.exit(ExitCode.GOAL_MISSED)
