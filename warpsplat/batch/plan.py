"""Plan the jobs of a command line and of batch files (docs/batch.md), and check them before any starts."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from warpsplat.batch.file import BatchFile
from warpsplat.batch.images import find_images
from warpsplat.batch.layers import KEYS, MATRIX, GivenValue, Layer, combinations, layer_of
from warpsplat.batch.presets import preset_layer, preset_names
from warpsplat.errors import UsageError, shown
from warpsplat.files.inputs import STANDARD
from warpsplat.files.remote import is_remote, is_url, remote
from warpsplat.fit.options import nearest
from warpsplat.fit.settings import Settings
from warpsplat.run.names import (
    ErrorAt,
    FoundImage,
    ResultRequest,
    check_outputs,
    fields_of,
    name_results,
    root_of,
)
from warpsplat.run.options import NESTED, settings_from

BATCH_ENDINGS = (".yaml", ".yml")
"""Endings of batch files."""

PRESET = "preset"
"""Key of a job: the name of its preset."""

JOB_KEYS = ("images", PRESET, MATRIX, *KEYS)


@dataclass(frozen=True)
class BatchJob:
    """One image to vectorize."""

    image: Path
    output: Path
    settings: Settings
    device: str
    importance: Path | None = None
    """Importance mask."""
    root: Path = Path()
    """Folder of all results of its output."""


PlannedJob = tuple[ResultRequest, BatchJob]
"""A job without its output, and what that is named by."""


def plan_jobs(inputs: Sequence[str], command: Layer | None = None) -> list[BatchJob]:
    """Return the jobs of batch files, images, folders and patterns, over which ``command`` has settings.

    Raises ``UsageError`` if anything is wrong with them; the message names the line and key of a batch file.
    """
    planned: list[PlannedJob] = []
    named: dict[Path, FoundImage] = {}
    for name in inputs:
        if name == str(STANDARD) or name.lower().endswith(BATCH_ENDINGS):
            planned += _jobs_of_file(Path(name), command or {})
        else:
            for image in find_images(name, Path()):
                named.setdefault(image.path, image)
    planned += _expanded(list(named.values()), [command or {}], UsageError)
    return _jobs(planned)


def _jobs_of_file(path: Path, command: Layer) -> Iterator[PlannedJob]:
    file = BatchFile(path)
    top = file.mapping(file.root, "a batch file", ("defaults", "presets", "jobs"))
    defaults: Layer = {}
    if "defaults" in top:
        defaults = layer_of(file, file.mapping(top["defaults"][1], "defaults", (MATRIX, *KEYS)))
    presets = _presets(file, *top["presets"]) if "presets" in top else {}
    if "jobs" not in top:
        raise file.error(1, "key 'jobs' is missing")
    line, node = top["jobs"]
    if not isinstance(node, yaml.SequenceNode) or not node.value:
        raise file.error(line, "jobs: must be a list with at least one job")
    for item in node.value:
        entries = file.mapping(item, "a job", JOB_KEYS)
        start = item.start_mark.line + 1
        if "images" not in entries:
            raise file.error(start, "key 'images' is missing in a job")
        layers = [defaults, _preset(file, entries, presets), layer_of(file, entries), command]
        yield from _expanded(_images(file, *entries["images"]), layers, file.error_at(start))


def _presets(file: BatchFile, line: int, node: yaml.Node) -> dict[str, Layer]:
    if not isinstance(node, yaml.MappingNode):
        raise file.error(line, "presets: must be a mapping of names to settings")
    names = tuple(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
    return {
        name: layer_of(file, file.mapping(inner, f"preset {shown(name)}", (MATRIX, *KEYS)))
        for name, (_, inner) in file.mapping(node, "presets", names).items()
    }


def _preset(file: BatchFile, entries: dict[str, tuple[int, yaml.Node]], presets: dict[str, Layer]) -> Layer:
    """Return the preset that a job names, with its name as a field for names of results."""
    if PRESET not in entries:
        return {}
    line, node = entries[PRESET]
    name = file.text(line, PRESET, file.value(node))
    if name not in presets and name not in preset_names():
        known = (*presets, *preset_names())
        hint = nearest(name, known) or f"; known are: {', '.join(known)}"
        raise file.error(line, f"{PRESET}: there is no {shown(name)}{hint}")
    values = presets[name] if name in presets else preset_layer(name)
    return {**values, PRESET: GivenValue(name, file.error_at(line), file.path.parent)}


def _images(file: BatchFile, line: int, node: yaml.Node) -> list[FoundImage]:
    """Return the files that match the patterns, each once, sorted within each pattern."""
    patterns = file.value(node)
    if isinstance(patterns, str):
        patterns = [patterns]
    if not isinstance(patterns, list) or not patterns or not all(isinstance(p, str) and p for p in patterns):
        raise file.error(line, "images: must be a path or pattern, or a list of them")
    found: dict[Path, FoundImage] = {}
    for pattern in [file.text(line, "images", pattern) for pattern in patterns]:
        try:
            for image in find_images(pattern, file.path.parent):
                found.setdefault(image.path, image)
        except UsageError as error:
            raise file.error(line, f"images: {error}") from error
    return list(found.values())


def _expanded(images: list[FoundImage], layers: Sequence[Layer], start: ErrorAt) -> Iterator[PlannedJob]:
    """Yield the jobs of one description: each combination of its settings for each image."""
    for values in combinations(layers):
        given: dict[str, Any] = {key: item.value for key, item in values.items()}
        output, mask = (
            _path(key, values[key]) if key in values else None for key in ("output", "importance")
        )
        options = {
            key.replace("-", "_"): value
            for key, value in given.items()
            if key not in ("output", "importance", "device", PRESET)
        }
        try:
            settings = settings_from(options)
        except UsageError as error:  # values that cannot be combined
            raise start(str(error)) from error
        error_at = values["output"].error if "output" in values else start
        fields = fields_of(settings, {key: value for key, value in given.items() if key not in NESTED})
        device = given.get("device", "auto")
        for image in images:
            root = root_of(output) if output else image.root
            job = BatchJob(image.path, Path(), settings, device, mask, root)
            yield ResultRequest(image, output, settings, fields, error_at), job


def _path(key: str, item: GivenValue) -> Path:
    """Return the path that a key gives, relative to where it was given."""
    try:
        return remote(item.value) if is_url(item.value) else item.base / Path(item.value).expanduser()
    except RuntimeError as error:
        raise item.error(f"{key}: {item.value!r}: {error}") from error


def _jobs(planned: list[PlannedJob]) -> list[BatchJob]:
    requests = [request for request, _ in planned]
    outputs = name_results(requests, {job.importance for _, job in planned if job.importance})
    check_outputs([request.error for request in requests], outputs)
    return [replace(job, output=output) for (_, job), output in zip(planned, outputs, strict=True)]


def home_of(jobs: Sequence[BatchJob], inputs: Sequence[str]) -> Path:
    """Return the folder of a batch's manifest: the one of its results that contains the others.

    If there is none, or results lie behind URLs, it is the folder of the batch file, or, unless there is
    exactly one input, the current folder.
    """
    away = any(is_remote(job.root) for job in jobs)
    roots = set() if away else {os.path.abspath(job.root) for job in jobs}
    with contextlib.suppress(ValueError):  # none, or on several drives
        common = os.path.commonpath(roots)
        if common in roots:
            return Path(common)
    is_file = len(inputs) == 1 and inputs[0].lower().endswith(BATCH_ENDINGS)
    return Path(inputs[0]).parent if is_file else Path()


def in_shard(job: BatchJob, root: Path, index: int, count: int) -> bool:
    """Return whether ``job`` is in part ``index`` (from 1) of ``count``, by its result's name below ``root``.

    This depends neither on other jobs nor on the content of the image.
    """
    away = is_remote(job.output)
    name = str(job.output) if away else Path(os.path.relpath(job.output, root)).as_posix()
    return int.from_bytes(hashlib.sha256(os.fsencode(name)).digest()[:8], "big") % count == index - 1
