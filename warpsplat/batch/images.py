"""Find the images that a name means: a file, those in a folder, or those that match a pattern."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from warpsplat.errors import UsageError
from warpsplat.files.marks import HEAD, is_result
from warpsplat.files.remote import WILD, find_remote, is_remote, is_url, remote
from warpsplat.run.names import FoundImage

ENDINGS = (
    *(".png", ".jpg", ".jpeg", ".jfif", ".webp", ".avif", ".gif", ".bmp", ".tif", ".tiff"),
    *(".heic", ".heif", ".jxl", ".ppm", ".pgm", ".pbm", ".pnm", ".tga", ".jp2", ".ico"),
)
"""Endings of the files of a folder that are taken for images."""


def find_images(name: str, base: Path) -> list[FoundImage]:
    """Return the images that ``name`` means, relative to ``base``, sorted; ``UsageError`` if there are none.

    A single file is returned even if it is missing: then only that image fails.
    """
    try:
        found = list(_found(name, base))
    except (ValueError, RuntimeError, OSError, NotImplementedError) as error:
        raise UsageError(f"{name!r} is not a usable pattern: {error}") from error
    if not found:
        raise UsageError(f"nothing matches {name!r}")
    return found


def _found(name: str, base: Path) -> Iterator[FoundImage]:
    if is_url(name):
        if is_remote(remote(name)):
            images, root = find_remote(name, ENDINGS)
            yield from (FoundImage(image, root) for image in images)
            return
        name = str(remote(name))
    path = Path(name).expanduser()
    whole = base / path
    if whole.is_dir():
        inside = [p for p in whole.iterdir() if p.suffix.lower() in ENDINGS and _is_image(p)]
        if not inside:
            raise UsageError(f"{name}: no images in this folder")
        yield from (_normal(p, whole) for p in sorted(inside))
    elif any(c in name for c in WILD) and not os.path.lexists(whole):
        root, parts = (Path(path.anchor), path.parts[1:]) if path.is_absolute() else (base, path.parts)
        fixed = 0
        while not any(c in parts[fixed] for c in WILD):
            fixed += 1
        matches = sorted(p for p in root.glob(str(Path(*parts))) if _is_image(p))
        yield from (_normal(p, root.joinpath(*parts[:fixed])) for p in matches)
    else:
        yield _normal(whole, whole.parent)


def _is_image(path: Path) -> bool:
    """Return whether a pattern or folder may mean a file: one that is not hidden, nor a result."""
    if not path.is_file() or path.name.startswith("."):
        return False
    if path.suffix.lower() != ".png":
        return path.suffix.lower() not in RESULTS
    try:
        with path.open("rb") as file:
            return not is_result(file.read(HEAD))
    except OSError:  # the run will report it
        return True


RESULTS = (".svg", ".svgz", ".pdf", ".dxf", ".eps")
"""Endings of results that are no images; a PNG may be either."""


def _normal(path: Path, root: Path) -> FoundImage:
    return FoundImage(Path(os.path.normpath(path)), Path(os.path.normpath(root)))
