"""Batch files: YAML -> jobs, checked before anything starts.

::

    defaults:            # of every job; keys are the long flags of `warpsplat vectorize`, and jobs.research's
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

import errno
import os
import stat
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from warpsplat.errors import UsageError
from warpsplat.files.inputs import read_input
from warpsplat.files.output import HEAD, check_folder, check_target, may_replace
from warpsplat.fit.settings import Settings
from warpsplat.jobs.batch_file import BatchFile
from warpsplat.jobs.options import BY_NAME, KINDS, settings_from
from warpsplat.jobs.research import NESTED, RESEARCH_KEYS
from warpsplat.jobs.vectorize import job_key
from warpsplat.svg.write import read_metadata

TEXT_KEYS = ("output", "device", "importance")
KEYS = (*BY_NAME, *TEXT_KEYS, *RESEARCH_KEYS, *NESTED)


@dataclass(frozen=True)
class Job:
    """One image to vectorize."""

    image: Path
    output: Path
    settings: Settings
    device: str
    importance: Path | None = None
    """Mask of how much the error of a pixel counts."""

    def done(self, data: bytes) -> bool:
        """Whether ``output`` is there, whole, and was made from an image of the bytes ``data`` so.

        Raises:
            ImageError: the mask cannot be read.
        """
        mask = read_input(self.importance) if self.importance else None
        try:
            if not stat.S_ISREG(os.stat(self.output).st_mode):
                return False  # opening a pipe would wait for whoever fills it
            with self.output.open("rb") as file:
                head = file.read(HEAD).decode("utf-8", "replace")
                file.seek(max(0, file.seek(0, os.SEEK_END) - len(TAIL)))
                whole = file.read() == TAIL
            return whole and read_metadata(head) == job_key(self.settings, data, mask)
        except OSError:
            return False


TAIL = b"</svg>\n"
"""How every SVG that was written here ends; one that was cut short does not."""


@dataclass(frozen=True)
class _Value:
    """A YAML value and where it stands."""

    value: Any
    line: int


def _options(file: BatchFile, entries: dict[str, tuple[int, yaml.Node]]) -> dict[str, _Value]:
    """The values of KEYS, each checked by itself, so that an error can name its line."""
    options: dict[str, _Value] = {}
    for key, (line, node) in entries.items():
        if key not in KEYS:
            continue
        if key in NESTED:
            options[key] = _Value(_nested(file, key, node), line)
            continue
        value = file.value(node)
        if not isinstance(node, yaml.ScalarNode):
            raise file.error(line, f"{key}: must be one value, not a list or mapping")
        if key in TEXT_KEYS or (key in BY_NAME and BY_NAME[key].choices):
            file.text(line, key, value)
        if key in KINDS:
            if value is not True:
                cause = f"must be true, not {value!r}; leave it out or give the other kind"
                raise file.error(line, f"{key}: {cause}")
        elif key not in TEXT_KEYS:
            _check_setting(file, line, key, value, {key.replace("-", "_"): value})
        options[key] = _Value(value, line)
    if "closed" in options and "open" in options:
        raise file.error(options["open"].line, "open: closed is there as well; give one of them")
    return options


def _nested(file: BatchFile, key: str, node: yaml.Node) -> dict[str, Any]:
    """The mapping of a key of NESTED, each value checked by itself."""
    values = {}
    for name, (line, inner) in file.mapping(node, key, NESTED[key]).items():
        value = file.value(inner)
        _check_setting(file, line, f"{key}: {name}", value, {key: {name: value}})
        values[name] = value
    return values


def _check_setting(file: BatchFile, line: int, key: str, value: Any, settings: dict[str, Any]) -> None:
    """Whether a setting can have a value: whether there are such ``settings``.

    Raises:
        UsageError: it cannot; the message names line and key.
    """
    try:
        if value is None:
            raise UsageError(f"{key} has no value")
        settings_from(settings)
    except (UsageError, TypeError) as error:
        raise file.error(line, f"{key}: {error}") from error


def _merge(defaults: dict[str, _Value], own: dict[str, _Value]) -> dict[str, Any]:
    """A job's options over the defaults, within mappings as well; a job's kind replaces the default kind."""
    merged = dict(defaults)
    own = {
        key: _Value({**defaults[key].value, **item.value}, item.line)
        if key in NESTED and key in defaults
        else item
        for key, item in own.items()
    }
    if any(kind in own for kind in KINDS):
        for kind in KINDS:
            merged.pop(kind, None)
    merged.update(own)
    values = {key.replace("-", "_"): item.value for key, item in merged.items() if key not in KINDS}
    for key in merged.keys() & KINDS.keys():
        values["kind"] = KINDS[key]
    return values


def _images(file: BatchFile, line: int, node: yaml.Node) -> list[Path]:
    """Files that the patterns match, each once, in the order of the patterns and sorted within one."""
    patterns = file.value(node)
    if isinstance(patterns, str):
        patterns = [patterns]
    if not isinstance(patterns, list) or not patterns or not all(isinstance(p, str) and p for p in patterns):
        raise file.error(line, "images: must be a path or pattern, or a list of them")
    patterns = [file.text(line, "images", pattern) for pattern in patterns]
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


def _path(file: BatchFile, line: int, key: str, value: str | None) -> Path | None:
    """A path of a batch file, which is relative to that."""
    try:
        return None if value is None else file.path.parent / Path(value).expanduser()
    except RuntimeError as error:
        raise file.error(line, f"{key}: {value!r}: {error}") from error


def load_jobs(path: Path) -> list[Job]:
    """Read and check a batch file.

    Raises:
        UsageError: anything wrong with the file; the message names its line and key.
    """
    file = BatchFile(path)
    top = file.mapping(file.root, "a batch file", ("defaults", "jobs"))
    defaults = {}
    if "defaults" in top:
        defaults = _options(file, file.mapping(top["defaults"][1], "defaults", KEYS))
    if "jobs" not in top:
        raise file.error(1, "key 'jobs' is missing")
    line, node = top["jobs"]
    if not isinstance(node, yaml.SequenceNode) or not node.value:
        raise file.error(line, "jobs: must be a list with at least one job")
    planned: list[_Planned] = []
    for item in node.value:
        entries = file.mapping(item, "a job", ("images", *KEYS))
        start = item.start_mark.line + 1
        if "images" not in entries:
            raise file.error(start, "key 'images' is missing in a job")
        own = _options(file, entries)
        options = _merge(defaults, own)
        device = options.pop("device", "auto")
        folder_given, mask = (
            _path(file, start, key, options.pop(key, None)) for key in ("output", "importance")
        )
        try:
            settings = settings_from(options)
        except UsageError as error:  # values that do not go together
            raise file.error(start, str(error)) from error
        given = own.get("output") or defaults.get("output")
        at = given.line if given else entries["images"][0]
        for image in _images(file, *entries["images"]):
            planned.append(_Planned(image, folder_given or image.parent, settings, device, mask, at))
    jobs = _named(file, line, planned)
    _check_outputs(file, [plan.line for plan in planned], jobs)
    return jobs


@dataclass(frozen=True)
class _Planned:
    """An image and where its result goes, before that has a name."""

    image: Path
    folder: Path
    settings: Settings
    device: str
    importance: Path | None
    line: int


def _named(file: BatchFile, line: int, planned: list[_Planned]) -> list[Job]:
    """Give each result a name; no two may have one, and none that of its image.

    Of a.png and a.jpg in one folder the results keep the endings; an image in two jobs cannot have one
    result.
    """
    distinct = {(plan.folder, plan.image) for plan in planned}
    stems = Counter((folder, image.stem) for folder, image in distinct)
    jobs = []
    for plan in planned:
        image, folder = plan.image, plan.folder
        name = image.stem if stems[folder, image.stem] == 1 else image.name
        job = Job(image, folder / f"{name}.svg", plan.settings, plan.device, plan.importance)
        if os.path.realpath(job.output) == os.path.realpath(image):
            raise file.error(line, f"jobs: {image} would be overwritten by its own result; give an output")
        jobs.append(job)
    for output, count in Counter(job.output for job in jobs).items():
        if count > 1:
            raise file.error(line, f"jobs: {count} images would be written to {output}; give other outputs")
    return jobs


def _check_outputs(file: BatchFile, lines: list[int], jobs: list[Job]) -> None:
    """Find out before the work whether every result can be written.

    Raises:
        UsageError: a folder that is none, cannot be written or cannot be made, a name that is too long, or a
            result that is a folder, a pipe, a device or a loop of links.
    """
    usable: set[Path] = set()
    for line, job in zip(lines, jobs, strict=True):
        folder = job.output.parent
        try:
            if folder not in usable:
                _check_folder(folder)
                usable.add(folder)
            if folder.is_dir():
                check_target(job.output)
            else:
                _check_names(folder, job.output.name)
        except OSError as error:
            cause = error.strerror or str(error)
            raise file.error(line, f"output: {job.output} cannot be written: {cause}") from error
        except UsageError as error:
            raise file.error(line, f"output: {error}") from error


def _check_folder(folder: Path) -> None:
    """Check that ``folder`` can be written, or made."""
    if folder.is_dir():
        check_folder(folder)
        return
    above = folder
    while not os.path.lexists(above):
        above = above.parent
    if not above.is_dir():
        raise UsageError(f"{above} is a file, not a folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise UsageError(f"{folder} cannot be made: no permission to write to {above}")
    _check_names(folder)


def _check_names(folder: Path, name: str = "") -> None:
    """Check the lengths of names in a folder that is yet to be made."""
    above = folder
    while not above.is_dir():
        above = above.parent
    longest = os.pathconf(above, "PC_NAME_MAX") if hasattr(os, "pathconf") else 255
    for part in (*folder.relative_to(above).parts, name):
        if len(os.fsencode(part)) > longest:
            raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG))


def not_ours(jobs: list[Job]) -> list[Path]:
    """The results that are there already and that warpsplat did not write."""
    found = []
    for job in jobs:
        try:
            free = may_replace(job.output)
        except OSError:
            free = False
        if not free:
            found.append(job.output)
    return found
