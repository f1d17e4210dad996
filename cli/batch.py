"""``warpsplat batch``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.options import threads_option
from warpsplat.errors import ExitCode, OutputError, WarpsplatError


@click.command("batch", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("jobs", type=click.Path(path_type=Path))
@click.option("--device", help="Overrides the file's device.")
@threads_option
@click.option("-v", "--verbose", count=True, help="Say more, on stderr.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object at the end.")
def command(
    jobs: Path, device: str | None, threads: int | None, verbose: int, quiet: bool, as_json: bool
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
    from warpsplat.cli.run import Interrupt, run_file
    from warpsplat.cli.vectorize import summary
    from warpsplat.device import choose_device, start_warp

    todo = load_jobs(jobs)
    start_warp()
    devices = {name: choose_device(name) for name in {device or job.device for job in todo}}
    results: list[dict[str, Any]] = []
    interrupt = Interrupt()
    say = click.echo if not quiet and not as_json else lambda *_, **__: None
    for i, job in enumerate(todo):
        count = f"[{i + 1}/{len(todo)}]"
        values: dict[str, Any] = {"image": str(job.image), "output": str(job.output)}
        try:
            if job.done():
                values["status"] = "skipped"
                say(f"{count} {job.output}: already made with these settings")
            else:
                try:
                    job.output.parent.mkdir(parents=True, exist_ok=True)
                except OSError as error:
                    raise OutputError(f"{job.output.parent}: cannot be made: {error.strerror}") from error
                chosen = devices[device or job.device]
                result = run_file(
                    job.image,
                    job.output,
                    job.settings,
                    chosen,
                    threads=threads,
                    verbose=verbose,
                    quiet=quiet,
                    interrupt=interrupt,
                )
                values |= {"status": "stopped" if result.stopped else "made", **result.as_dict()}
                say(f"{count} {summary(job.output, values)}")
                for goal in result.missed:
                    click.echo(f"{count} goal missed: {goal}", err=True)
        except WarpsplatError as error:
            values |= {"status": "failed", "error": str(error)}
            click.echo(f"{count} failed: {error}", err=True)
        results.append(values)
        if interrupt.requested:
            break
    counts = {s: sum(r["status"] == s for r in results) for s in ("made", "skipped", "failed")}
    if as_json:
        click.echo(json.dumps({**counts, "results": results}))
    say(f"{len(todo)} images: " + ", ".join(f"{n} {name}" for name, n in counts.items()))
    failed = [r for r in results if r["status"] == "failed"]
    if failed and not quiet:
        click.echo("failed:", err=True)
        for r in failed:
            click.echo(f"  {r['error']}", err=True)
    if interrupt.requested:
        sys.exit(ExitCode.INTERRUPTED)
    if failed:
        sys.exit(ExitCode.SOME_FAILED)
    if any(r.get("missed") for r in results):
        sys.exit(ExitCode.GOAL_MISSED)
