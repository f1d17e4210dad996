"""Batch files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests import make_image
from warpsplat.batch.executors.tasks import Task
from warpsplat.batch.layers import Layer
from warpsplat.batch.plan import BatchJob, plan_jobs
from warpsplat.fit.settings import Settings


def write(folder: Path, text: str) -> Path:
    path = folder / "jobs.yaml"
    path.write_text(text)
    return path


Answers = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]
"""Runs a command with ``--json`` and returns its lines about images and the last one; see ``conftest``."""


def load_jobs(path: Path, command: Layer | None = None) -> list[BatchJob]:
    """Return the jobs of a batch file."""
    return plan_jobs([str(path)], command)


def answers(out: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return what ``batch --json`` printed: for each image, and for all."""
    values = [json.loads(line) for line in out.splitlines()]
    return values[:-1], values[-1]


def make_tasks(folder: Path, count: int, settings: Settings, threads: int | None = None) -> list[Task]:
    """Return tasks on small images in a folder."""
    tasks = []
    for i in range(count):
        path, output = folder / f"{i}.png", str(folder / f"{i}.svg")
        make_image(path, i)
        tasks.append(Task(i, "key", path.read_bytes(), path.name, output, settings, "cpu", threads))
    return tasks
