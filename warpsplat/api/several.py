"""``warpsplat.vectorize_several``."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from warpsplat.api.run import Callback, Watch, backend_on
from warpsplat.errors import UsageError
from warpsplat.files.sources import ImageSource
from warpsplat.fit.settings import Settings
from warpsplat.run.keywords import settings_given, takes
from warpsplat.run.result import Result
from warpsplat.run.several import vectorize_several as make_several
from warpsplat.run.typed import Options

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(Options)
def vectorize_several(
    image: ImageSource,
    curves: Sequence[int],
    *,
    settings: Settings | None = None,
    importance: ImageSource | None = None,
    outputs: Sequence[str | os.PathLike[str]] | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    ready: Callable[[Result], None] | None = None,
    name: str | None = None,
    **options: Unpack[Options],
) -> tuple[Result, ...]:
    """Turn an image into SVGs of several numbers of shapes, which share what work they can.

    Args:
        image: as for ``vectorize``.
        curves: numbers of shapes; of a drawing, the most. They are made from few to many.
        settings: all that decides the results but their numbers, made by ``make_settings``; in place of
            ``options``.
        importance: as for ``vectorize``.
        outputs: a file for each number, written as soon as it is made; missing folders are made.
        device: as for ``vectorize``.
        threads: see there.
        callback: see there; ``Progress.work`` is the share of all that is to be done. One that returns True
            ends the run.
        stop: see there.
        ready: called with each result as soon as there is one.
        name: see ``vectorize``.
        options: see there.

    Returns:
        a result for each number, in the order of ``curves``; where the run was stopped, of the smallest ones
        alone, and that of most shapes may be ``stopped``.

    Raises:
        UsageError: a number that is out of range or there twice; settings that say how many shapes there
            are, as goals and levels do; line art and pixel art, which say so themselves.
        ImageError, OutputError, ResourceError, TypeError: as for ``vectorize``.
    """
    if outputs is not None and len(outputs) != len(curves):
        raise UsageError(f"{len(curves)} numbers of shapes and {len(outputs)} outputs")
    watch = Watch(callback, stop)
    with backend_on(device, threads) as backend:
        return make_several(
            image,
            tuple(curves),
            settings_given(settings, **options),
            backend,
            outputs=None if outputs is None else [Path(output) for output in outputs],
            name=name,
            importance=importance,
            report=watch.report,
            stop=watch.stop,
            ready=ready,
        )
