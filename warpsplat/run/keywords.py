"""Options as keywords of the API's functions."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from inspect import Parameter
from typing import Any, TypeVar, cast, get_type_hints

from warpsplat.errors import UsageError
from warpsplat.fit.options import nearest
from warpsplat.fit.settings import Settings
from warpsplat.run.options import settings_from

Function = TypeVar("Function", bound=Callable[..., Any])


def takes(options: Any) -> Callable[[Function], Function]:
    """Decorate a function of ``**options`` of a ``TypedDict``: its signature lists them, and it refuses other
    keywords with a ``TypeError`` that names the nearest.
    """

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        own = [each for each in signature.parameters.values() if each.kind != Parameter.VAR_KEYWORD]
        listed = [
            Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
            for name, annotation in get_type_hints(options).items()
        ]
        signature = signature.replace(parameters=[*own, *listed])

        @functools.wraps(function)
        def checked(*arguments: Any, **keywords: Any) -> Any:
            for name in keywords:
                if name not in signature.parameters:
                    hint = nearest(name, signature.parameters)
                    raise TypeError(f"{function.__name__}() has no keyword {name!r}{hint}")
            return function(*arguments, **keywords)

        checked.__signature__ = signature  # type: ignore[attr-defined]
        return cast(Function, checked)

    return decorate


def settings_given(settings: Settings | None, **options: Any) -> Settings:
    """Return the settings, or those that the options make.

    Raises:
        UsageError: both are given, or an option cannot be used as given.
    """
    if settings is None:
        return settings_from(options)
    if others := [name for name, value in options.items() if value is not None]:
        raise UsageError(f"settings are given, and {others[0]} besides")
    return settings
