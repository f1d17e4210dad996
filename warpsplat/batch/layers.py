"""Layers of a job's settings: a batch file's defaults, its preset, the job's own, those of the command line.

Each value is checked where it is given, so that an error names its line or flag.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from warpsplat.batch.file import BatchFile
from warpsplat.errors import UsageError, cut, shown
from warpsplat.fit.options import nearest
from warpsplat.run.names import ErrorAt
from warpsplat.run.options import BY_NAME, KINDS, NESTED, RESEARCH_KEYS, settings_from

TEXT_KEYS = ("output", "device", "importance")
KEYS = (*BY_NAME, *TEXT_KEYS, *RESEARCH_KEYS, *NESTED)
SINGLE_KEYS = (
    *(key for key in KEYS if key not in NESTED),
    *(f"{outer}.{k}" for outer in NESTED for k in NESTED[outer]),
)
"""Keys of single values, as ``--set`` has them."""

MATRIX = "matrix"
"""Key of lists of values: a job is done with each combination of them."""


@dataclass(frozen=True)
class GivenValue:
    """A value, and where it was given."""

    value: Any
    error: ErrorAt
    base: Path
    """Folder that paths are relative to."""


Layer = Mapping[str, GivenValue]


def layer_of(file: BatchFile, entries: dict[str, tuple[int, yaml.Node]]) -> dict[str, GivenValue]:
    """Return the values of KEYS and of a matrix in a mapping of a batch file."""
    layer: dict[str, GivenValue] = {}
    for key, (line, node) in entries.items():
        if key == MATRIX or key in NESTED:
            value = _axes(file, node) if key == MATRIX else _nested(file, key, node)
            layer[key] = GivenValue(value, file.error_at(line), file.path.parent)
        elif key in KEYS:
            layer[key] = _single(file, key, line, node)
    return layer


def _single(file: BatchFile, key: str, line: int, node: yaml.Node) -> GivenValue:
    value = file.value(node)
    if not isinstance(node, yaml.ScalarNode):
        hint = f"; for one job with each, {MATRIX}: {{{key}: [...]}}" if key in BY_NAME else ""
        raise file.error(line, f"{key}: must be one value, not a list or mapping{hint}")
    if key in TEXT_KEYS or (key in BY_NAME and BY_NAME[key].choices):
        file.text(line, key, value)
    check_value(key, value, file.error_at(line))
    return GivenValue(value, file.error_at(line), file.path.parent)


def _nested(file: BatchFile, key: str, node: yaml.Node) -> dict[str, Any]:
    """Return the mapping of a key of NESTED, after checking each value."""
    values = {}
    for name, (line, inner) in file.mapping(node, key, NESTED[key]).items():
        values[name] = file.value(inner)
        check_value(key, {name: values[name]}, file.error_at(line))
    return values


def _axes(file: BatchFile, node: yaml.Node) -> dict[str, list[GivenValue]]:
    axes: dict[str, list[GivenValue]] = {}
    most_combinations = 1000  # maximum number of combinations of a matrix
    for key, (line, inner) in file.mapping(node, MATRIX, (*BY_NAME, *RESEARCH_KEYS)).items():
        if not isinstance(inner, yaml.SequenceNode) or not inner.value:
            raise file.error(line, f"{MATRIX}: {key}: must be a list of values")
        if math.prod(map(len, axes.values())) * len(inner.value) > most_combinations:
            raise file.error(line, f"{MATRIX}: more than {most_combinations} combinations")
        axes[key] = [_single(file, key, item.start_mark.line + 1, item) for item in inner.value]
    return axes


def check_value(key: str, value: Any, error_at: ErrorAt) -> None:
    """Check a value by itself; raise ``UsageError`` from ``error_at`` if ``key`` cannot have it."""
    name = f"{key}: {next(iter(value))}" if key in NESTED else key
    inner = next(iter(value.values())) if key in NESTED else value
    try:
        if inner is None:
            hint = BY_NAME[key].hint if key in BY_NAME else ""
            raise UsageError(f"{name} has no value{hint}")
        if key == "curves" and isinstance(value, str) and "," in value:
            numbers = ", ".join(word.strip() for word in value.split(","))
            raise UsageError(f"takes one number; for one job with each, {MATRIX}: {{{key}: [{numbers}]}}")
        elif key not in TEXT_KEYS:  # they are texts already
            settings_from({key.replace("-", "_"): value})
    except (UsageError, TypeError) as error:
        said = str(error)
        raise error_at(said if said.startswith(f"{name} ") else f"{name}: {said}") from error


def assigned(text: str) -> tuple[str, Any]:
    """Parse ``--set``: ``key=value``, or ``rates.points=0.5`` for a key in a mapping, with a YAML value.

    Raises ``UsageError`` for another form, or an unknown key.
    """
    name, found, written = text.partition("=")
    key, dot, inner = name.partition(".")
    if not found:
        raise UsageError(f"--set {cut(text)}: must be KEY=VALUE")
    if name not in SINGLE_KEYS:
        hint = nearest(name, SINGLE_KEYS) or "; the keys are those of batch files"
        raise UsageError(f"--set {cut(text)}: unknown key {shown(name)}{hint}")
    try:
        value = written if key in TEXT_KEYS else yaml.safe_load(written)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise UsageError(f"--set {cut(text)}: the value is not plain YAML") from error
    return key, {inner: value} if dot else value


def command_layer(flags: Mapping[str, Any], sets: Sequence[str]) -> dict[str, GivenValue]:
    """Return the layer of the command line: values by key, None for not given, and those of ``--set``.

    Raises ``UsageError`` if a value is out of range, or a key has two values.
    """
    layer: dict[str, GivenValue] = {}
    for key, value in flags.items():
        if value is not None:
            layer[key] = _given(f"--{key}", key, value)
    for text in sets:
        key, value = assigned(text)
        if key in layer and not (key in NESTED and not layer[key].value.keys() & value.keys()):
            raise UsageError(f"--set {cut(text)}: {key} is given twice")
        one = _given(f"--set {cut(text)}", key, value)
        layer[key] = GivenValue({**layer[key].value, **value}, one.error, one.base) if key in layer else one
    return layer


def _given(flag: str, key: str, value: Any) -> GivenValue:
    def error_at(message: str) -> UsageError:
        return UsageError(f"{flag}: {message.removeprefix(f'{key}: ')}")

    check_value(key, value, error_at)
    return GivenValue(value, error_at, Path())


def merged(layers: Sequence[Layer]) -> dict[str, GivenValue]:
    """Merge layers, also within mappings; later ones override earlier ones, and a kind the other kind."""
    whole: dict[str, GivenValue] = {}
    for layer in layers:
        if any(kind in layer for kind in KINDS):
            for kind in KINDS:
                whole.pop(kind, None)
        for key, item in layer.items():
            value = item.value
            if key in NESTED and key in whole:
                value = {**whole[key].value, **value}
            whole[key] = GivenValue(value, item.error, item.base)
    return whole


def combinations(layers: Sequence[Layer]) -> Iterator[dict[str, GivenValue]]:
    """Yield a job's settings: one mapping for each combination of the last matrix.

    A key that a later layer gives is no axis any more.
    """
    whole = merged(layers)
    if MATRIX not in whole:
        yield whole
        return
    axes = whole.pop(MATRIX).value
    at = max(i for i, layer in enumerate(layers) if MATRIX in layer)
    later = merged(layers[at + 1 :])
    fixed = {*later} | (set(KINDS) if later.keys() & KINDS.keys() else set())
    axes = {key: values for key, values in axes.items() if key not in fixed}
    for values in itertools.product(*axes.values()):
        yield merged([whole, dict(zip(axes, values, strict=True))])
