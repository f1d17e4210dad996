"""Batch files: YAML -> jobs, checked before anything starts.

::

    defaults:            # of every job; keys are the long flags of `warpsplat vectorize`
      curves: 512
      quality: draft
      output: svg        # folder for the results; default: beside each image
    jobs:
      - images: photos/*.jpg
      - images: [logo.png, icons/**/*.png]
        curves: 64
        closed: true

Paths are relative to the YAML file.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from warpsplat.config import Settings, make_settings
from warpsplat.errors import UsageError
from warpsplat.pipeline import job_key
from warpsplat.svg import read_metadata

SETTING_KEYS = ("curves", "quality", "iterations", "seed", "precision", "renderer")
GOAL_KEYS = ("target-psnr", "time-budget", "max-bytes")
KIND_KEYS = ("closed", "open")
TEXT_KEYS = ("output", "device")
KEYS = (*SETTING_KEYS, *GOAL_KEYS, *KIND_KEYS, *TEXT_KEYS)


@dataclass(frozen=True)
class Job:
    """One image to vectorize."""

    image: Path
    output: Path
    settings: Settings
    device: str

    def done(self) -> bool:
        """Whether ``output`` is there and was made from this image with these settings."""
        try:
            with self.output.open("rb") as file:
                head = file.read(2000).decode("utf-8", "replace")
            return read_metadata(head).endswith(f"key={job_key(self.settings, self.image.read_bytes())}")
        except OSError:
            return False


@dataclass(frozen=True)
class _Value:
    """A YAML value and where it stands."""

    value: Any
    line: int


class _File:
    """A parsed YAML file that can name the line of each of its keys."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            text = path.read_text("utf-8")
        except FileNotFoundError:
            raise UsageError(f"{path}: no such file") from None
        except IsADirectoryError:
            raise UsageError(f"{path}: is a folder, not a YAML file") from None
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"{path}: cannot be read: {error}") from error
        try:
            self.root = yaml.compose(text, yaml.SafeLoader)
            self.loader = yaml.SafeLoader("")
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            raise self.error(mark.line + 1 if mark else 1, f"not valid YAML: {error.problem}") from None
        except yaml.YAMLError as error:
            raise UsageError(f"{path}: not valid YAML: {str(error).splitlines()[0]}") from None

    def error(self, line: int, message: str) -> UsageError:
        return UsageError(f"{self.path}:{line}: {message}")

    def mapping(
        self, node: yaml.Node | None, where: str, allowed: tuple[str, ...]
    ) -> dict[str, tuple[int, yaml.Node]]:
        """Key -> (line, value node); unknown and repeated keys are errors."""
        if not isinstance(node, yaml.MappingNode):
            line = node.start_mark.line + 1 if node else 1
            raise self.error(line, f"{where} must be a mapping with keys out of: {', '.join(allowed)}")
        result: dict[str, tuple[int, yaml.Node]] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            key = str(key_node.value)
            if key not in allowed:
                raise self.error(line, f"unknown key {key!r} in {where}; known are: {', '.join(allowed)}")
            if key in result:
                raise self.error(line, f"key {key!r} is there twice in {where}")
            result[key] = (line, value_node)
        return result

    def value(self, node: yaml.Node) -> Any:
        try:
            return self.loader.construct_object(node, deep=True)
        except Exception as error:  # tags and scalars of YAML's own types raise what their constructors raise
            line = node.start_mark.line + 1
            raise self.error(line, f"not a plain value: {str(error).splitlines()[0]}") from error


def _options(file: _File, entries: dict[str, tuple[int, yaml.Node]]) -> dict[str, _Value]:
    """The values of KEYS, each checked by itself, so that an error can name its line."""
    options: dict[str, _Value] = {}
    for key, (line, node) in entries.items():
        if key not in KEYS:
            continue
        value = file.value(node)
        if key in (*TEXT_KEYS, "quality") and (not isinstance(value, str) or "\0" in value):
            raise file.error(line, f"{key}: must be text, not {value!r}")
        if key in KIND_KEYS and value is not True:
            raise file.error(line, f"{key}: must be true, not {value!r}; leave it out or give the other kind")
        if key in (*SETTING_KEYS, *GOAL_KEYS):
            try:
                if key == "quality":
                    make_settings(value)
                else:
                    if value is None:
                        raise UsageError(f"{key} has no value")
                    make_settings(**{key.replace("-", "_"): value})
            except (UsageError, TypeError) as error:
                raise file.error(line, f"{key}: {error}") from error
        options[key] = _Value(value, line)
    if "closed" in options and "open" in options:
        raise file.error(options["open"].line, "open: closed is there as well; give one of them")
    return options


def _merge(defaults: dict[str, _Value], own: dict[str, _Value]) -> dict[str, Any]:
    """A job's options over the defaults; a job's kind replaces the default kind."""
    merged = dict(defaults)
    if any(kind in own for kind in KIND_KEYS):
        for kind in KIND_KEYS:
            merged.pop(kind, None)
    merged.update(own)
    return {key.replace("-", "_"): item.value for key, item in merged.items()}


def _images(file: _File, line: int, node: yaml.Node) -> list[Path]:
    """Files that the patterns match, each once, in the order of the patterns and sorted within one."""
    patterns = file.value(node)
    if isinstance(patterns, str):
        patterns = [patterns]
    if not isinstance(patterns, list) or not patterns or not all(isinstance(p, str) and p for p in patterns):
        raise file.error(line, "images: must be a path or pattern, or a list of them")
    found: dict[Path, None] = {}
    for pattern in patterns:
        try:
            matches = list(_glob(file.path.parent, pattern))
        except (ValueError, RuntimeError, OSError, NotImplementedError) as error:
            raise file.error(line, f"images: {pattern!r} is no usable pattern: {error}") from error
        if not matches:
            raise file.error(line, f"images: nothing matches {pattern!r}")
        found.update(dict.fromkeys(Path(os.path.normpath(m)) for m in matches))
    return list(found)


def _glob(folder: Path, pattern: str) -> Iterator[Path]:
    path = Path(pattern).expanduser()
    if not any(c in pattern for c in "*?["):
        whole = folder / path
        # A file that is named and missing is that image's failure, not the batch's.
        yield whole
        return
    base, parts = (Path(path.anchor), path.parts[1:]) if path.is_absolute() else (folder, path.parts)
    yield from sorted(
        p
        for p in base.glob(str(Path(*parts)))
        if p.is_file() and not p.name.startswith(".") and p.suffix != ".svg"
    )


def load_jobs(path: Path) -> list[Job]:
    """Read and check a batch file.

    Raises:
        UsageError: anything wrong with the file; the message names its line and key.
    """
    file = _File(path)
    top = file.mapping(file.root, "a batch file", ("defaults", "jobs"))
    defaults = {}
    if "defaults" in top:
        defaults = _options(file, file.mapping(top["defaults"][1], "defaults", KEYS))
    if "jobs" not in top:
        raise file.error(1, "key 'jobs' is missing")
    line, node = top["jobs"]
    if not isinstance(node, yaml.SequenceNode) or not node.value:
        raise file.error(line, "jobs: must be a list with at least one job")
    planned: list[tuple[Path, Path, Settings, str]] = []
    for item in node.value:
        entries = file.mapping(item, "a job", ("images", *KEYS))
        start = item.start_mark.line + 1
        if "images" not in entries:
            raise file.error(start, "key 'images' is missing in a job")
        options = _merge(defaults, _options(file, entries))
        kind = "open" if options.pop("open", False) else "closed" if options.pop("closed", False) else None
        output, device = options.pop("output", None), options.pop("device", "auto")
        settings = make_settings(options.pop("quality", "balanced"), kind=kind, **options)
        try:
            folder_given = None if output is None else path.parent / Path(output).expanduser()
        except RuntimeError as error:
            raise file.error(start, f"output: {output!r}: {error}") from error
        if folder_given and folder_given.exists() and not folder_given.is_dir():
            raise file.error(start, f"output: {output!r} is a file, not a folder")
        for image in _images(file, *entries["images"]):
            folder = folder_given or image.parent
            planned.append((image, folder, settings, device))
    # a.png and a.jpg in one folder keep their endings; an image in two jobs cannot have one result.
    distinct = {(folder, image) for image, folder, _, _ in planned}
    stems = Counter((folder, image.stem) for folder, image in distinct)
    jobs = []
    for image, folder, settings, device in planned:
        name = image.stem if stems[folder, image.stem] == 1 else image.name
        jobs.append(Job(image, folder / f"{name}.svg", settings, device))
        if jobs[-1].output.resolve() == image.resolve():
            raise file.error(line, f"jobs: {image} would be overwritten by its own result; give an output")
    for output_path, count in Counter(job.output for job in jobs).items():
        if count > 1:
            raise file.error(
                line, f"jobs: {count} images would be written to {output_path}; give other outputs"
            )
    return jobs
