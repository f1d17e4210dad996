"""The options of ``warpsplat batch``."""

from __future__ import annotations

import re
from typing import Any

import click

from warpsplat.cli.help import option_in
from warpsplat.cli.options import (
    OUTPUT,
    device_option,
    importance_option,
    overwrite_option,
    preset_option,
    quality_options,
    threads_option,
    together,
    verbosity_options,
)
from warpsplat.errors import shown
from warpsplat.extensions import extensions


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
            self.fail(f"{shown(value)} is not of the form I/N, such as 1/4: the first of four", param, ctx)
        return int(found[1]), int(found[2])


def _assignments() -> list[str]:
    """Return how values of ``--set`` begin, for shells to complete."""
    from warpsplat.batch.layers import SINGLE_KEYS

    return [f"{key}=" for key in SINGLE_KEYS]


batch_options = together(
    option_in(
        "Files",
        "-o",
        "--output",
        metavar="OUT",
        files=True,
        common=True,
        help="Folder for the results, or their names: out/{stem}-{curves}.svg.  [default: beside each image]",
    ),
    overwrite_option,
    option_in(
        "Batch",
        "--set",
        "sets",
        multiple=True,
        metavar="KEY=VALUE",
        values=_assignments,
        common=True,
        help="Any key of batch files, such as curves=64; may be repeated.",
    ),
    option_in(
        "Batch", "-n", "--dry-run", is_flag=True, common=True, help="Say what would be done, and do nothing."
    ),
    option_in("Batch", "--retry-failed", is_flag=True, help="Try again what failed in an earlier run."),
    option_in(
        "Batch",
        "--workers",
        type=click.IntRange(min=1, max=1024),
        metavar="N",
        common=True,
        help="Images at the same time, each in a process.  [default: one a core, if that pays]",
    ),
    option_in(
        "Batch",
        "--executor",
        metavar="WHO",
        values=("ray", "ray="),
        help='ray, or ray=ADDRESS, has a Ray cluster do the images (the extra "ray").  '
        "[default: processes of this machine]",
    ),
    option_in(
        "Batch",
        "--gpus",
        type=click.FloatRange(min=0, min_open=True, max=64),
        metavar="G",
        help="GPUs of the cluster per image: with 0.25, four share one.  [default: 1]",
    ),
    option_in("Batch", "--shard", type=Shard(), default=(1, 1), help="Do part I of N of the images: 1/4."),
    option_in(
        "Batch",
        "--manifest",
        type=OUTPUT,
        metavar="FILE",
        help="Notes of what was made, as JSON lines.  [default: warpsplat-manifest.jsonl, with the results]",
    ),
    option_in(
        "Files",
        "--report",
        type=OUTPUT,
        metavar="DIR",
        help="Pages on the results, and DIR/index.html, which lists them; or a name that ends with .html.",
    )
    if "pages" in extensions()
    else lambda function: function,
    preset_option,
    quality_options(),
    importance_option,
    device_option(),
    threads_option,
    verbosity_options,
    option_in(
        "Run",
        "--json",
        "as_json",
        is_flag=True,
        help="Print a JSON object for each image, and one at the end.",
    ),
)
"""All options of the command."""
