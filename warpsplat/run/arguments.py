"""Arguments that the API's functions share: options as keywords, and the device."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from inspect import Parameter
from typing import TYPE_CHECKING, Any, TypeVar, get_type_hints

from warpsplat.errors import UsageError, shown
from warpsplat.fit.custom_loss import CustomLoss
from warpsplat.fit.options import nearest
from warpsplat.fit.settings import Settings
from warpsplat.run.options import settings_from, with_preset

if TYPE_CHECKING:
    from warpsplat.rendering.backend import Backend

ALWAYS_THERE = ("auto", "cpu")
"""Names of devices that every machine has. Finding out takes as long as tracing a logo."""

Function = TypeVar("Function", bound=Callable[..., Any])


def takes(options: type) -> Callable[[Function], Function]:
    """Return a decorator that lists the keys of a ``TypedDict`` in a signature, in place of ``**options``."""

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        own = [each for each in signature.parameters.values() if each.kind != Parameter.VAR_KEYWORD]
        listed = [
            Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
            for name, annotation in get_type_hints(options).items()
        ]
        function.__signature__ = signature.replace(parameters=[*own, *listed])  # type: ignore[attr-defined]
        return function

    return decorate


def check_keywords(function: Callable[..., Any], options: Mapping[str, object]) -> None:
    """Raise ``TypeError`` for keywords that a function decorated by ``takes`` does not have."""
    known = inspect.signature(function).parameters
    for name in options:
        if name not in known:
            raise TypeError(f"{function.__name__}() has no keyword {name!r}{nearest(name, known)}")


def settings_given(function: Callable[..., Any], settings: Settings | None, **options: Any) -> Settings:
    """Return the settings, or those that the options of ``function``, over a preset, make.

    Raises ``TypeError`` for unknown options, and ``UsageError`` if both are given or an option is not valid.
    """
    check_keywords(function, options)
    if settings is None:
        return settings_from(with_preset(options.pop("preset", None), options))
    if others := [name for name, value in options.items() if value is not None]:
        raise UsageError(f"settings are given, and {others[0]} as well")
    return settings


def custom_loss(options: Mapping[str, Any]) -> tuple[CustomLoss | None, dict[str, Any]]:
    """Return the loss among options if it is a function, and the other options."""
    given = options.get("loss")
    if not callable(given) and not isinstance(given, CustomLoss):
        return None, {**options}
    made = given if isinstance(given, CustomLoss) else CustomLoss(given)
    return made, {**options, "loss": None}


@contextmanager
def backend_on(device: str, threads: int | None) -> Iterator[Callable[[], Backend]]:
    """Yield a function that starts the device, which is then held, and returns its backend.

    Raises ``UsageError`` or ``DeviceError`` at once for a device that is unknown or cannot be used.
    """
    check_threads(threads)
    with ExitStack() as held:

        @functools.cache
        def started() -> Backend:
            from warpsplat.rendering.backend import Backend
            from warpsplat.rendering.device import choose_device, start_warp
            from warpsplat.rendering.device_lock import device_lock
            from warpsplat.rendering.failures import failures_of

            start_warp()
            backend = Backend.on(choose_device(device), threads)
            held.enter_context(device_lock(backend.device))
            held.enter_context(failures_of(backend.device))
            return backend

        if device not in ALWAYS_THERE:
            started()
        yield started


def check_threads(threads: int | None) -> None:
    """Raise ``UsageError`` unless a number of threads is a whole number from 1, or None."""
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int) or threads < 1):
        raise UsageError(f"threads must be a whole number from 1, not {shown(threads)}")
