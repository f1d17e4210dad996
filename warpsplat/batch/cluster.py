"""Options of a batch that is done by other machines."""

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
    """A Ray cluster, and what tasks take of it."""

    address: str
    gpus: float

    def executor(self, workers: int | None) -> Executor:
        """Who does the tasks; nothing is connected to yet.

        Raises:
            UsageError: Ray is not installed.
        """
        from warpsplat.batch.executors.ray import RayCluster

        return RayCluster(self.address, workers=workers, gpus=self.gpus)


def cluster_options(function: Function) -> Function:
    """``--executor`` and ``--gpus``."""
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
    """What the options say; None: this machine.

    Raises:
        UsageError: an executor that there is not, or GPUs that cannot be had so.
    """
    name, _, address = (executor or "").partition("=")
    if executor is not None and name != "ray":
        raise UsageError(f"--executor {executor}: must be ray or ray=ADDRESS")
    if gpus is not None and not name:
        raise UsageError("--gpus is for --executor ray; here --device chooses a GPU")
    if gpus is not None and gpus > 1 and not gpus.is_integer():
        raise UsageError(f"--gpus {gpus:g}: must be a part of one GPU, as 0.25, or a whole number")
    return Cluster(address, gpus or 1.0) if name else None
