"""``warpsplat.suggest``."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from warpsplat.api.run import Callback, Watch, backend_on
from warpsplat.files.sources import ImageSource
from warpsplat.fit.settings import Settings
from warpsplat.run.keywords import settings_given, takes
from warpsplat.run.suggest import Suggestion, suggest_curves
from warpsplat.run.typed import Options

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(Options)
def suggest(
    image: ImageSource,
    *,
    settings: Settings | None = None,
    importance: ImageSource | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    name: str | None = None,
    **options: Unpack[Options],
) -> Suggestion | None:
    """How many shapes an image is worth: where its quality against shapes, and against bytes, has its knee.

    A short fit on a reduced image, whose shapes grow from few to many, says what each number is expected to
    give; it takes a fraction of what a run takes.

    Args:
        image: as for ``vectorize``.
        settings: of the runs that it is about, made by ``make_settings`` without ``curves`` or a goal; in
            place of ``options``.
        importance: as for ``vectorize``, as is all that follows.
        device: see there.
        threads: see there.
        callback: see there.
        stop: see there.
        name: see there.
        options: see there.

    Returns:
        the number, the reason, and what it and others are expected to give at the default effort; None where
        it was stopped. Of images that are traced there is no number to choose, which the reason says.

    Raises:
        UsageError: settings that say how many shapes there are.
        ImageError, ResourceError, TypeError: as for ``vectorize``.
    """
    watch = Watch(callback, stop)
    with backend_on(device, threads) as backend:
        return suggest_curves(
            image,
            settings_given(settings, **options),
            backend,
            name=name,
            importance=importance,
            report=watch.report,
            stop=watch.stop,
        )
