"""How a batch is run, which is told on the command line alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class BatchOptions:
    """Options of a batch that do not change its results."""

    overwrite: bool = False
    retry_failed: bool = False
    dry_run: bool = False
    workers: int | None = None
    threads: int | None = None
    executor: str | None = None
    """``ray`` or ``ray=ADDRESS``; None: this machine."""
    gpus: float | None = None
    """GPUs of a cluster that each image takes."""
    shard: tuple[int, int] = (1, 1)
    manifest: Path | None = None
    report: Path | None = None
    """Folder of pages on the results, or the page that lists them."""
    quiet: bool = False
    as_json: bool = False
