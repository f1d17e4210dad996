"""Name results, and check before the run that they can be written."""

from __future__ import annotations

import errno
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from warpsplat.errors import UsageError, shown
from warpsplat.files.output import check_folder, check_target
from warpsplat.files.remote import check_remote, is_remote, is_url, remote
from warpsplat.fit.settings import DEFAULT_QUALITY, Settings
from warpsplat.run.formats import ENDINGS, check_format
from warpsplat.run.options import KINDS

FIELD = re.compile(r"\{\{|\}\}|\{([^{}]*)\}|[{}]")
"""Braces in the name of a result: doubled, around a field, or unbalanced."""

EXAMPLE = "out/{stem}-{curves}.svg"
"""Example for messages."""

ErrorAt = Callable[[str], UsageError]
"""Returns an error whose message names where something was given: a line of a file, or the command line."""


class FoundImage(NamedTuple):
    """An image, and the folder in which it was searched."""

    path: Path
    root: Path


@dataclass(frozen=True)
class ResultRequest:
    """An image, its settings, and the requested name of its result."""

    image: FoundImage
    output: Path | None
    """A folder, a name or a pattern of names (``is_pattern``); None: beside the image."""
    settings: Settings
    fields: Mapping[str, Any]
    """Fields that names may contain, besides the image's."""
    error: ErrorAt
    """Returns errors that name where the output was given."""


def is_pattern(output: str) -> bool:
    """Return whether an output is a file name or pattern, not a folder."""
    return "{" in output or "}" in output or output.lower().endswith(ENDINGS)


def root_of(output: Path) -> Path:
    """Return the folder of all results of an output: the part before the first field."""
    if not is_pattern(str(output)):
        return output
    root = output.parent
    while "{" in str(root) or "}" in str(root):
        root = root.parent
    return root


def fields_of(settings: Settings, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that names may contain: settings as given, or their values."""
    own = {key.replace("_", "-"): value for key, value in vars(settings).items()}
    own["kind"] = next(name for name, kind in KINDS.items() if kind == settings.kind)
    return {**own, "quality": DEFAULT_QUALITY, **given}


def name_results(wanted: Sequence[ResultRequest], masks: Iterable[Path] = ()) -> list[Path]:
    """Return the path of each result; raise ``UsageError`` for an unknown field, and where paths collide.

    All are different, and none is an image or one of the ``masks``. In an output folder, a result keeps the
    folders below the fixed part of its pattern, see ``_in_folders``.
    """
    inside = [not item.output or not is_pattern(str(item.output)) for item in wanted]
    named = _in_folders([item for item, is_inside in zip(wanted, inside, strict=True) if is_inside])
    outputs = [
        named[_folder(item), item.image.path] if is_inside else filled_in(item)
        for item, is_inside in zip(wanted, inside, strict=True)
    ]
    inputs = {_real(path) for path in (*(item.image.path for item in wanted), *masks)}
    counts = Counter(outputs)
    for item, output in zip(wanted, outputs, strict=True):
        if (real := _real(output)) in inputs:
            path = item.image.path
            by = "its own result" if real == _real(path) else f"the result of {path}"
            raise item.error(f"output: {output} would be overwritten by {by}; give another one")
        if counts[output] > 1:
            images = dict.fromkeys(
                o.image.path for o, name in zip(wanted, outputs, strict=True) if name == output
            )
            raise item.error(f"output: {counts[output]} results would be {output}{_way_out([*images])}")
    return outputs


def _way_out(images: Sequence[Path]) -> str:
    """Return the rest of a message about results of one name: their images, if several, and advice."""
    if len(images) == 1:
        return f"; give other outputs, as {EXAMPLE}"
    more = f" and {len(images) - 2} more" if len(images) > 2 else ""
    joined = ", ".join(map(str, images[:2])) if more else " and ".join(map(str, images))
    return f", of {joined}{more}; give a folder as the output, or each its own"


def _in_folders(items: Iterable[ResultRequest]) -> dict[tuple[Path, Path], Path]:
    """Return the results, by folder and image, of requests without a name.

    A result has the image's name, including its ending if there are both a.png and a.jpg. Results
    that would still share a name keep the folders below the common parent of their images.
    """
    places = dict.fromkeys((_folder(item), item.image.path) for item in items)
    names: dict[tuple[Path, str], set[str]] = {}
    for folder, path in places:
        names.setdefault((folder, path.stem), set()).add(path.name)
    groups: dict[Path, list[tuple[Path, Path]]] = {}
    for folder, path in places:
        name = path.stem if len(names[folder, path.stem]) == 1 else path.name
        groups.setdefault(folder / f"{name}.svg", []).append((folder, path))
    outputs: dict[tuple[Path, Path], Path] = {}
    for output, group in groups.items():
        parents = [str(path.parent) for _, path in group]
        local = len(group) > 1 and not any(is_remote(path) for _, path in group)
        common = os.path.commonpath(map(os.path.abspath, parents)) if local else ""
        for place, parent in zip(group, parents, strict=True):
            below = os.path.relpath(parent, common) if local else "."
            outputs[place] = output if below == "." else output.parent / below / output.name
    return outputs


def _folder(item: ResultRequest) -> Path:
    """Return the folder of a result that is given no name."""
    if not item.output:
        return item.image.path.parent
    below = _below_root(item.image)
    return item.output if below == "." else item.output / below  # a URL keeps the dot


def _below_root(image: FoundImage) -> str:
    """Return the folder of an image below the one in which it was searched."""
    path, root = image
    return path.parent.relative_to(root).as_posix() if is_remote(path) else os.path.relpath(path.parent, root)


def filled_in(item: ResultRequest) -> Path:
    """Return the name of a result by its pattern; raise ``UsageError`` for an unknown field."""
    path = item.image.path
    fields = {**item.fields, "stem": path.stem, "name": path.name, "folder": _below_root(item.image)}

    def value(found: re.Match[str]) -> str:
        if found[0] in ("{{", "}}"):
            return found[0][0]
        if found[1] not in fields:
            named = shown(found[0])
            raise item.error(
                f"output: {named} is not a field; fields are stem, name, folder and all option names"
            )
        text = _text(fields[found[1]])
        return text if found[1] == "folder" else text.replace("/", "_").replace(os.sep, "_")

    name = FIELD.sub(value, str(item.output))
    if not name.lower().endswith(ENDINGS):
        known = f"{', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}"
        raise item.error(f"output: {name}: names of results end with {known}")
    return remote(name.replace("/./", "/")) if is_url(name) else Path(os.path.normpath(name))


def _real(path: Path) -> str:
    """Return the path without symbolic links."""
    return str(path) if is_remote(path) else os.path.realpath(path)


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    return "-".join(map(_text, value)) if isinstance(value, (tuple, list)) else str(value)


def check_outputs(errors: Sequence[ErrorAt], outputs: Sequence[Path]) -> None:
    """Raise one of ``errors`` before the run unless every result can be written, in its folder and format."""
    usable: set[Path] = set()
    for error_at, output in zip(errors, outputs, strict=True):
        folder = output.parent
        try:
            check_format(output)
            if is_remote(folder):
                check_remote(folder)
                continue
            if not folder.is_dir():
                _check_missing(folder, output.name)
                continue
            if folder not in usable:
                check_folder(folder)
                usable.add(folder)
            check_target(output)
        except OSError as error:
            raise error_at(f"output: {output} cannot be written: {error.strerror or error}") from error
        except UsageError as error:
            raise error_at(f"output: {error}") from error


def _check_missing(folder: Path, name: str) -> None:
    """Check that a folder that does not exist can be made, for a file of that name."""
    above = folder
    while not os.path.lexists(above):
        above = above.parent
    if not above.is_dir():
        raise UsageError(f"{above} is a file, not a folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise UsageError(f"{folder} cannot be made: no permission to write to {above}")
    longest = os.pathconf(above, "PC_NAME_MAX") if hasattr(os, "pathconf") else 255
    for part in (*folder.relative_to(above).parts, name):
        if len(os.fsencode(part)) > longest:
            raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG))
