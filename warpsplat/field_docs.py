"""Descriptions of dataclasses' fields in their docstrings, for ``help``."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import textwrap
from typing import TypeVar

Class = TypeVar("Class", bound=type)


def described(cls: Class) -> Class:
    """Add the fields of a dataclass to its docstring, each with the text below it or its option's help.

    The source is read when the docstring is: imports take no longer.
    """
    cls.__doc__ = _Docstring(cls.__doc__ or "")  # type: ignore[assignment]  # Python asks it for the text
    return cls


class _Docstring:
    """The docstring of a class, and of its instances."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __get__(self, instance: object, owner: type) -> str:
        """Return the docstring of ``owner``."""
        texts = _texts(owner)
        lines = []
        for field in dataclasses.fields(owner):
            option = field.metadata.get("option")
            if option:
                texts[field.name] = option.help or " ".join(each.help for each in option.shorthands)
            if text := texts.get(field.name):
                lines.append(f"    {field.name}: {' '.join(text.split())}")
        return "\n\n".join((inspect.cleandoc(self._text), "\n".join(["Attributes:", *lines])))


def _texts(cls: type) -> dict[str, str]:
    """Return the strings below the fields of a class, by name; none where there is no source."""
    try:
        body = ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0]
    except (OSError, TypeError, SyntaxError):
        return {}
    assert isinstance(body, ast.ClassDef)
    return {
        one.target.id: next_one.value.value
        for one, next_one in zip(body.body, body.body[1:], strict=False)
        if isinstance(one, ast.AnnAssign)
        and isinstance(one.target, ast.Name)
        and isinstance(next_one, ast.Expr)
        and isinstance(next_one.value, ast.Constant)
        and isinstance(next_one.value.value, str)
    }
