"""``warpsplat batch``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpsplat.cli.options import FILE, overwrite_option, threads_option, voice_options
from warpsplat.cli.say import say
from warpsplat.errors import ExitCode, OutputError, UsageError, explain

if TYPE_CHECKING:
    from warpsplat.batch import Job

NAMED = 20
"""Most files that one message names."""


def check_ours(jobs: list[Job], path: Path) -> None:
    """Refuse to replace files of others.

    Raises:
        UsageError: there are some; the message names them.
    """
    from warpsplat.batch import not_ours

    found = not_ours(jobs)
    if found:
        names = ", ".join(map(str, found[:NAMED])) + (", ..." if len(found) > NAMED else "")
        raise UsageError(
            f"{path}: {len(found)} results exist and were not written by warpsplat, "
            f"--overwrite replaces them: {names}"
        )


def run_job(job: Job, count: str, *, quiet: bool, talk: bool, **options: Any) -> dict[str, Any]:
    """Do one job, say what became of it, and return that for JSON. Whatever it raises is its failure only."""
    from warpsplat.cli.run import run_file
    from warpsplat.cli.vectorize import summary
    from warpsplat.inputs import read_input

    values: dict[str, Any] = {"image": str(job.image), "output": str(job.output)}
    try:
        data = read_input(job.image)
        if job.done(data):
            if talk:
                say(f"{count} {job.output}: already made with these settings")
            return values | {"status": "skipped"}
        try:
            job.output.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{job.output.parent}: cannot be made: {error.strerror}") from error
        result = run_file(job.image, job.output, job.settings, data=data, quiet=quiet, **options)
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of Rust code derives from no Exception
        message, _ = explain(error)
        name = str(job.image)
        message = message if name in message or str(job.output) in message else f"{name}: {message}"
        say(f"{count} failed: {message}", err=True)
        return values | {"status": "failed", "error": message}
    values |= {"status": "stopped" if result.stopped else "made", **result.as_dict()}
    if talk:
        say(f"{count} {summary(job.output, values)}")
    for goal in result.missed:
        say(f"{count} goal missed: {goal}", err=True)
    return values


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
    from warpsplat.batch import load_jobs
    from warpsplat.cli import signals
    from warpsplat.device import choose_device, start_warp

    todo = load_jobs(jobs)
    if not overwrite:
        check_ours(todo, jobs)
    start_warp()
    devices = {name: choose_device(name) for name in {device or job.device for job in todo}}
    results: list[dict[str, Any]] = []
    talk = not quiet and not as_json
    for i, job in enumerate(todo):
        options = {"device": devices[device or job.device], "threads": threads, "verbose": verbose}
        try:
            results.append(run_job(job, f"[{i + 1}/{len(todo)}]", quiet=quiet, talk=talk, **options))
        except KeyboardInterrupt:  # with nothing of this image to save
            results.append({"image": str(job.image), "output": str(job.output), "status": "stopped"})
        if signals.received():
            break
    finish(results, len(todo), quiet=quiet, talk=talk, as_json=as_json)


def finish(results: list[dict[str, Any]], total: int, *, quiet: bool, talk: bool, as_json: bool) -> None:
    """Sum up, and end the program with the code for it, if there is one to give."""
    counts = {s: sum(r["status"] == s for r in results) for s in ("made", "skipped", "failed")}
    if as_json:
        say(json.dumps({**counts, "results": results}))
    if talk:
        say(f"{total} images: " + ", ".join(f"{n} {name}" for name, n in counts.items()))
    failed = [r for r in results if r["status"] == "failed"]
    if failed and not quiet:
        say("failed:", err=True)
        for r in failed:
            say(f"  {r['error']}", err=True)
    if failed:
        sys.exit(ExitCode.SOME_FAILED)
    if any(r.get("missed") for r in results):
        sys.exit(ExitCode.GOAL_MISSED)
