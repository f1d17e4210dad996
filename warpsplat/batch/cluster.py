"""Options of a batch on other machines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import click

from warpsplat.errors import UsageError

if TYPE_CHECKING:
    from warpsplat.batch.executors.tasks import Executor

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Cluster:
    """A Ray cluster, and the GPUs that each task takes of it."""

    address: str
    gpus: float

    def executor(self, workers: int | None) -> Executor:
        """Return the executor; it is not connected yet.

        Raises:
            UsageError: Ray is not installed.
        """
        from warpsplat.batch.executors.ray import RayCluster

        return RayCluster(self.address, workers=workers, gpus=self.gpus)


def cluster_options(function: Function) -> Function:
    """Add ``--executor`` and ``--gpus``."""
    options = [
        click.option(
            "--executor",
            metavar="WHO",
            help='ray, or ray=ADDRESS, has a Ray cluster do the images (the extra "ray").  '
            "[default: processes of this machine]",
        ),
        click.option(
            "--gpus",
            type=click.FloatRange(min=0, min_open=True, max=64),
            metavar="G",
            help="What an image takes of a cluster's GPUs: 0.25 for four that share one.  [default: 1]",
        ),
    ]
    for option in reversed(options):
        function = option(function)
    return function


def cluster_of(executor: str | None, gpus: float | None) -> Cluster | None:
    """Return the cluster of the options, or None for this machine.

    Raises:
        UsageError: an unknown executor, or an invalid number of GPUs.
    """
    name, _, address = (executor or "").partition("=")
    if executor is not None and name != "ray":
        raise UsageError(f"--executor {executor}: must be ray or ray=ADDRESS")
    if gpus is not None and not name:
        raise UsageError("--gpus is for --executor ray; here --device chooses a GPU")
    if gpus is not None and gpus > 1 and not gpus.is_integer():
        raise UsageError(f"--gpus {gpus:g}: must be a part of one GPU, as 0.25, or a whole number")
    return Cluster(address, gpus or 1.0) if name else None
