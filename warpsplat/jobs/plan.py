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

import errno
import os
import stat
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from warpsplat.errors import ImageError, UsageError
from warpsplat.files.inputs import read_input
from warpsplat.files.output import HEAD, check_folder, check_target, may_replace
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.jobs.vectorize import job_key
from warpsplat.scene import Kind
from warpsplat.svg.write import read_metadata

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

    def done(self, data: bytes) -> bool:
        """Whether ``output`` is there, whole, and was made from an image of the bytes ``data`` so."""
        try:
            if not stat.S_ISREG(os.stat(self.output).st_mode):
                return False  # opening a pipe would wait for whoever fills it
            with self.output.open("rb") as file:
                head = file.read(HEAD).decode("utf-8", "replace")
                file.seek(max(0, file.seek(0, os.SEEK_END) - len(TAIL)))
                whole = file.read() == TAIL
            return whole and read_metadata(head).endswith(f"key={job_key(self.settings, data)}")
        except OSError:
            return False


TAIL = b"</svg>\n"
"""How every SVG that was written here ends; one that was cut short does not."""

MAX_FILE = 1 << 20
"""Largest batch file [bytes]: reading a mebibyte of YAML takes some seconds."""

MAX_DEPTH = 16
"""Deepest nesting of a batch file; four is what one needs."""

MAX_SCALAR = 4096
"""Longest single value [characters]: that of the longest path."""


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
            text = read_input(path, "a YAML file", limit=MAX_FILE).decode("utf-8-sig")
        except ImageError as error:
            raise UsageError(str(error)) from error
        except UnicodeDecodeError as error:
            raise UsageError(f"{path}: cannot be read: not UTF-8, at byte {error.start}") from error
        self.loader: Any = None
        try:
            self.loader = yaml.SafeLoader(text)
            self._check()
            self.root = yaml.compose(text, yaml.SafeLoader)
            self.loader = yaml.SafeLoader("")
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            raise self.error(mark.line + 1 if mark else 1, f"not valid YAML: {error.problem}") from None
        except yaml.reader.ReaderError as error:
            line = text.count("\n", 0, error.position) + 1
            raise self.error(line, f"not valid YAML: character {error.character!r} is not allowed") from None
        except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
            # An escape beyond Unicode, say: the scanner lets chr() raise.
            cause = str(error).splitlines()[0]
            raise self.error(self.loader.line + 1 if self.loader else 1, f"not valid YAML: {cause}") from None

    def _check(self) -> None:
        """Refuse what is too deep or too long for a batch file before it is built."""
        depth = 0
        while self.loader.check_event():
            event = self.loader.get_event()
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            line = event.start_mark.line + 1 if event.start_mark else 1
            if depth > MAX_DEPTH:
                raise self.error(line, f"nested deeper than {MAX_DEPTH} levels")
            if isinstance(event, yaml.ScalarEvent) and len(event.value) > MAX_SCALAR:
                raise self.error(line, f"a value of more than {MAX_SCALAR} characters")

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
            key = key_node.value if isinstance(key_node, yaml.ScalarNode) else "[...]"
            if key not in allowed:
                raise self.error(
                    line, f"unknown key {key[:100]!r} in {where}; known are: {', '.join(allowed)}"
                )
            if key in result:
                raise self.error(line, f"key {key!r} is there twice in {where}")
            result[key] = (line, value_node)
        return result

    def value(self, node: yaml.Node) -> Any:
        try:
            return self.loader.construct_object(node, deep=True)
        except Exception as error:  # tags and scalars of YAML's own types raise what their constructors raise
            line = node.start_mark.line + 1
            cause = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise self.error(line, f"not a plain value: {cause}") from error

    def text(self, line: int, key: str, value: Any) -> str:
        """``value`` as a path or name.

        Raises:
            UsageError: it is no text, or holds what no name can.
        """
        if not isinstance(value, str):
            raise self.error(line, f"{key}: must be text, not {value!r}")
        if "\0" in value or any("\ud800" <= c <= "\udfff" for c in value):
            raise self.error(line, f"{key}: {value!r} holds a character that no name can have")
        return value


def _options(file: _File, entries: dict[str, tuple[int, yaml.Node]]) -> dict[str, _Value]:
    """The values of KEYS, each checked by itself, so that an error can name its line."""
    options: dict[str, _Value] = {}
    for key, (line, node) in entries.items():
        if key not in KEYS:
            continue
        value = file.value(node)
        if not isinstance(node, yaml.ScalarNode):
            raise file.error(line, f"{key}: must be one value, not a list or mapping")
        if key in (*TEXT_KEYS, "quality"):
            file.text(line, key, value)
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
    planned: list[_Planned] = []
    for item in node.value:
        entries = file.mapping(item, "a job", ("images", *KEYS))
        start = item.start_mark.line + 1
        if "images" not in entries:
            raise file.error(start, "key 'images' is missing in a job")
        own = _options(file, entries)
        options = _merge(defaults, own)
        stroke, fill = options.pop("open", False), options.pop("closed", False)
        kind = Kind.STROKE if stroke else Kind.FILL if fill else None
        output, device = options.pop("output", None), options.pop("device", "auto")
        settings = make_settings(options.pop("quality", "balanced"), kind=kind, **options)
        try:
            folder_given = None if output is None else path.parent / Path(output).expanduser()
        except RuntimeError as error:
            raise file.error(start, f"output: {output!r}: {error}") from error
        given = own.get("output") or defaults.get("output")
        at = given.line if given else entries["images"][0]
        for image in _images(file, *entries["images"]):
            planned.append(_Planned(image, folder_given or image.parent, settings, device, at))
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
    line: int


def _named(file: _File, line: int, planned: list[_Planned]) -> list[Job]:
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
        job = Job(image, folder / f"{name}.svg", plan.settings, plan.device)
        if os.path.realpath(job.output) == os.path.realpath(image):
            raise file.error(line, f"jobs: {image} would be overwritten by its own result; give an output")
        jobs.append(job)
    for output, count in Counter(job.output for job in jobs).items():
        if count > 1:
            raise file.error(line, f"jobs: {count} images would be written to {output}; give other outputs")
    return jobs


def _check_outputs(file: _File, lines: list[int], jobs: list[Job]) -> None:
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
