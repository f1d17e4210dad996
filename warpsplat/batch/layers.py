"""Settings of jobs, in layers: a batch file's defaults, a preset of it, the job's own, the command line's.

Each value is checked by itself where it is given, so that an error names its place.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from warpsplat.batch.file import BatchFile, plain
from warpsplat.errors import UsageError, cut, shown
from warpsplat.run.names import Place
from warpsplat.run.options import BY_NAME, KINDS, NESTED, RESEARCH_KEYS, settings_from

TEXT_KEYS = ("output", "device", "importance")
KEYS = (*BY_NAME, *TEXT_KEYS, *RESEARCH_KEYS, *NESTED)

MATRIX = "matrix"
"""Key of lists of values: the job is done with each combination of them."""

MOST_COMBINATIONS = 1000
"""Maximum number of combinations of a matrix."""


@dataclass(frozen=True)
class Value:
    """Value of a key."""

    value: Any
    place: Place
    base: Path
    """Folder that paths are relative to."""


Layer = Mapping[str, Value]


def layer_of(file: BatchFile, entries: dict[str, tuple[int, yaml.Node]]) -> dict[str, Value]:
    """Return the values of KEYS and of a matrix in a mapping of a batch file."""
    layer: dict[str, Value] = {}
    for key, (line, node) in entries.items():
        if key == MATRIX:
            layer[key] = Value(_axes(file, node), file.place(line), file.path.parent)
        elif key in NESTED:
            layer[key] = Value(_nested(file, key, node), file.place(line), file.path.parent)
        elif key in KEYS:
            layer[key] = _single(file, key, line, node)
    _check_kinds(layer)
    return layer


def _single(file: BatchFile, key: str, line: int, node: yaml.Node) -> Value:
    value = file.value(node)
    if not isinstance(node, yaml.ScalarNode):
        hint = f"; for one job with each, {MATRIX}: {{{key}: [...]}}" if key in BY_NAME else ""
        raise file.error(line, f"{key}: must be one value, not a list or mapping{hint}")
    if key in TEXT_KEYS or (key in BY_NAME and BY_NAME[key].choices):
        file.text(line, key, value)
    checked(key, value, file.place(line))
    return Value(value, file.place(line), file.path.parent)


def _nested(file: BatchFile, key: str, node: yaml.Node) -> dict[str, Any]:
    """Return the mapping of a key of NESTED, each value checked on its own."""
    values = {}
    for name, (line, inner) in file.mapping(node, key, NESTED[key]).items():
        values[name] = file.value(inner)
        checked(key, {name: values[name]}, file.place(line))
    return values


def _axes(file: BatchFile, node: yaml.Node) -> dict[str, list[Value]]:
    axes: dict[str, list[Value]] = {}
    for key, (line, inner) in file.mapping(node, MATRIX, (*BY_NAME, *RESEARCH_KEYS)).items():
        if not isinstance(inner, yaml.SequenceNode) or not inner.value:
            raise file.error(line, f"{MATRIX}: {key}: must be a list of values")
        if math.prod(map(len, axes.values())) * len(inner.value) > MOST_COMBINATIONS:
            raise file.error(line, f"{MATRIX}: more than {MOST_COMBINATIONS} combinations")
        axes[key] = [_single(file, key, item.start_mark.line + 1, item) for item in inner.value]
    return axes


def checked(key: str, value: Any, place: Place) -> None:
    """Check the value of one key on its own.

    Raises:
        UsageError: ``key`` cannot have it; the message names the place and the key.
    """
    name = f"{key}: {next(iter(value))}" if key in NESTED else key
    inner = next(iter(value.values())) if key in NESTED else value
    try:
        if inner is None:
            raise UsageError(f"{name} has no value")
        if key in KINDS:
            if value is not True:
                raise UsageError(f"must be true, not {shown(value)}; leave it out or give the other kind")
        elif key == "curves" and isinstance(value, str) and "," in value:
            numbers = ", ".join(word.strip() for word in value.split(","))
            raise UsageError(f"takes one number; for one job with each, {MATRIX}: {{{key}: [{numbers}]}}")
        elif key not in TEXT_KEYS:  # which are texts already
            settings_from({key.replace("-", "_"): value})
    except (UsageError, TypeError) as error:
        raise place(f"{name}: {error}") from error


def _check_kinds(layer: Layer) -> None:
    if "closed" in layer and "open" in layer:
        raise layer["open"].place("open: closed is there as well; give one of them")


def assigned(text: str) -> tuple[str, Any]:
    """Parse ``--set``: ``key=value``, or ``rates.points=0.5`` for a key within a mapping; the value is YAML.

    Raises:
        UsageError: neither, or an unknown key.
    """
    name, found, written = text.partition("=")
    key, dot, inner = name.partition(".")
    if not found:
        raise UsageError(f"--set {cut(text)}: must be KEY=VALUE")
    if key not in KEYS or bool(dot) != (key in NESTED) or (dot and inner not in NESTED[key]):
        raise UsageError(f"--set {cut(text)}: unknown key {shown(name)}; the keys are those of batch files")
    try:
        value = written if key in TEXT_KEYS else plain(written)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise UsageError(f"--set {cut(text)}: no plain value") from error
    return key, {inner: value} if dot else value


def command_layer(flags: Mapping[str, Any], sets: Sequence[str]) -> dict[str, Value]:
    """Return the layer of the command line.

    Args:
        flags: values by key; None: not given.
        sets: values of ``--set``.

    Raises:
        UsageError: a value is out of range, or one key has two.
    """
    layer: dict[str, Value] = {}
    for key, value in flags.items():
        if value is not None:
            layer[key] = _given(f"--{key}", key, value)
    for text in sets:
        key, value = assigned(text)
        if key in layer and not (key in NESTED and not layer[key].value.keys() & value.keys()):
            raise UsageError(f"--set {cut(text)}: {key} is given twice")
        one = _given(f"--set {cut(text)}", key, value)
        layer[key] = Value({**layer[key].value, **value}, one.place, one.base) if key in layer else one
    _check_kinds(layer)
    return layer


def _given(flag: str, key: str, value: Any) -> Value:
    def place(message: str) -> UsageError:
        return UsageError(f"{flag}: {message.removeprefix(f'{key}: ')}")

    checked(key, value, place)
    return Value(value, place, Path())


def merged(layers: Sequence[Layer]) -> dict[str, Value]:
    """Merge layers, later ones winning, also within mappings; a kind replaces the other kind."""
    whole: dict[str, Value] = {}
    for layer in layers:
        if layer.keys() & KINDS.keys():
            whole = {key: item for key, item in whole.items() if key not in KINDS}
        for key, item in layer.items():
            value = item.value
            if key in NESTED and key in whole:
                value = {**whole[key].value, **value}
            whole[key] = Value(value, item.place, item.base)
    return whole


def combinations(layers: Sequence[Layer]) -> Iterator[dict[str, Value]]:
    """Yield the settings of a job for each combination of the last matrix; keys of later layers are fixed."""
    whole = merged(layers)
    if MATRIX not in whole:
        yield whole
        return
    axes = whole.pop(MATRIX).value
    at = max(i for i, layer in enumerate(layers) if MATRIX in layer)
    later = merged(layers[at + 1 :])
    fixed = later.keys() | (KINDS.keys() if later.keys() & KINDS.keys() else ())
    axes = {key: values for key, values in axes.items() if key not in fixed}
    for values in itertools.product(*axes.values()):
        yield merged([whole, dict(zip(axes, values, strict=True))])
