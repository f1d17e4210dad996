"""A parsed YAML file that can name the line of each of its keys."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from warpsplat.batch.run_options import BatchOptions
from warpsplat.errors import ImageError, UsageError, shown
from warpsplat.files.inputs import read_input
from warpsplat.fit.options import nearest
from warpsplat.run.names import ErrorAt
from warpsplat.run.options import BY_NAME, RESEARCH_KEYS

MAX_FILE = 1 << 20
"""Largest batch file [bytes]: a mebibyte of YAML takes seconds to read."""

ELSEWHERE = {field.name.replace("_", "-") for field in fields(BatchOptions)} - {"as-json"}
"""Options that are of the command line alone."""


class BatchFile:
    """A parsed YAML file that can name the line of each of its keys."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            text = read_input(path, "a YAML file", limit=MAX_FILE).decode("utf-8-sig")
        except ImageError as error:
            raise UsageError(str(error)) from error
        except UnicodeDecodeError as error:
            raise UsageError(f"{path}: cannot be read: not UTF-8, at byte {error.start}") from error
        try:
            self.loader = loader = yaml.SafeLoader(text)
        except yaml.reader.ReaderError as error:
            line = text.count("\n", 0, error.position) + 1
            raise self.error(line, f"not valid YAML: character {error.character!r} is not allowed") from None
        try:
            self.root = loader.get_single_node()
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            raise self.error(mark.line + 1 if mark else 1, f"not valid YAML: {error.problem}") from None
        except RecursionError:
            raise self.error(loader.line + 1, "not valid YAML: nested too deeply") from None
        except (ValueError, OverflowError) as error:  # of chr(): an escape beyond Unicode
            raise self.error(loader.line + 1, f"not valid YAML: {str(error).splitlines()[0]}") from None

    def error(self, line: int, message: str) -> UsageError:
        """Return an error that names the file and the line."""
        return UsageError(f"{self.path}:{line}: {message}")

    def error_at(self, line: int) -> ErrorAt:
        """Return ``error`` for a line."""
        return partial(self.error, line)

    def mapping(
        self, node: yaml.Node | None, where: str, allowed: tuple[str, ...]
    ) -> dict[str, tuple[int, yaml.Node]]:
        """Return key -> (line, value node); unknown and repeated keys are errors."""
        if not isinstance(node, yaml.MappingNode):
            line = node.start_mark.line + 1 if node else 1
            raise self.error(line, f"{where} must be a mapping, whose keys may be {_listed(allowed)}")
        result: dict[str, tuple[int, yaml.Node]] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            key = key_node.value if isinstance(key_node, yaml.ScalarNode) else "[...]"
            if key not in allowed:
                hint = f"; it is an option of the command line, --{key}" if key in ELSEWHERE else ""
                hint = hint or nearest(key, allowed) or f"; known are {_listed(allowed)}"
                raise self.error(line, f"unknown key {shown(key)} in {where}{hint}")
            if key in result:
                raise self.error(line, f"key {shown(key)} is there twice in {where}")
            result[key] = (line, value_node)
        return result

    def value(self, node: yaml.Node) -> Any:
        """Return the value of a node; raise ``UsageError`` if it is no plain value."""
        try:
            return self.loader.construct_object(node, deep=True)
        except Exception as error:  # tags and scalars of YAML's own types raise what their constructors raise
            line = node.start_mark.line + 1
            cause = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise self.error(line, f"not a plain value: {cause}") from error

    def text(self, line: int, key: str, value: Any) -> str:
        """Return ``value`` as a path or name; raise ``UsageError`` if it is no text, or cannot be a name."""
        if not isinstance(value, str):
            raise self.error(line, f"{key}: must be text, not {shown(value)}")
        if "\0" in value or any("\ud800" <= c <= "\udfff" for c in value):
            raise self.error(line, f"{key}: {shown(value)} holds a character that no name can have")
        return value


def _listed(keys: Iterable[str]) -> str:
    """Return keys in words; those of options are too many to be listed."""
    words = ", ".join(key for key in keys if key not in BY_NAME and key not in RESEARCH_KEYS)
    options = "the options of vectorize (see warpsplat vectorize --help-all)"
    return " and ".join(filter(None, (words, options if BY_NAME.keys() & {*keys} else "")))
