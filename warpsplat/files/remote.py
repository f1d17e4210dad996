"""Files behind URLs (``s3://``, ``gs://``, ``https://`` ...); an extra, ``pip install "warpsplat[remote]"``.

Such a file is a path of universal_pathlib, which has pathlib's interface over fsspec, so that local and
remote files have one type here. ``os.path`` cannot be used with it: check ``is_remote`` first.
"""

from __future__ import annotations

import contextlib
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import Any, Protocol, runtime_checkable

from warpsplat.errors import ImageError, OutputError, UsageError, WarpsplatError, cause_of, printable

URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
"""The beginning of URLs; the letter of a drive is no protocol."""

WILD = "*?["
"""Characters that make a name a pattern."""

READ_ONLY = ("http", "https", "data", "github")
"""Protocols without writing."""

WHOLE = ("s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oci", "memory")
"""Protocols of stores that write objects atomically and cannot rename them."""

FRESH = 300.0
"""Seconds for which the names in a folder are cached: one request lists a thousand, or asks for one."""

_listed: dict[str, tuple[float, frozenset[str]]] = {}
"""Folder -> when it was listed, and the names in it."""


@runtime_checkable
class ReadablePath(Protocol):
    """A path of pathlib, or one behind a URL."""

    def read_bytes(self) -> bytes:
        """Return the content of the file."""


def is_url(name: str) -> bool:
    """Return whether the name of a file is a URL."""
    return URL.match(name) is not None


def is_remote(path: PurePath) -> bool:
    """Return whether a path is behind a URL."""
    return not isinstance(path, PurePath)


def path_of(name: str | os.PathLike[str] | ReadablePath) -> Path:
    """Return the path of a file, by its name or URL; errors are those of ``remote``."""
    if isinstance(name, str):
        return remote(name) if is_url(name) else Path(name)
    found: Any = Path(name) if isinstance(name, os.PathLike) else name
    return found


def remote(url: str) -> Path:
    """Return the path of a URL; that of a ``file://`` URL is local.

    Raises:
        UsageError: A package is missing, or the protocol is unknown.
    """
    try:
        from upath import UPath
    except ImportError as error:
        raise UsageError(f"{printable(url)}: URLs need: pip install 'warpsplat[remote]'") from error
    try:
        path: Any = UPath(url)
        if path.protocol in ("file", "local"):
            return Path(path.path)
        _ = path.fs  # imports the protocol's own package
    except (ImportError, ValueError) as error:
        raise UsageError(f"{printable(url)}: {_cause(error)}") from error
    found: Path = path
    return found


def find_remote(url: str, endings: tuple[str, ...]) -> tuple[list[Path], Path]:
    """Return the images behind a URL, sorted, and the folder that they were searched in.

    The URL is that of one image, a folder, or with ``*``, ``?``, ``[`` a pattern; a query belongs to the
    name. ``endings``: of images in a folder.

    Raises:
        UsageError: The store does not answer, or the pattern is invalid.
    """
    path: Any = remote(url)
    if path.protocol in READ_ONLY:
        return [path], path.parent
    fixed = path
    while any(c in str(fixed) for c in WILD):
        fixed = fixed.parent
    try:
        if fixed != path:
            found = path.fs.glob(path.path, detail=True)
        elif path.fs.isdir(path.path):
            entries = path.fs.ls(path.path, detail=True)
            found = {entry["name"]: entry for entry in entries if entry["name"].lower().endswith(endings)}
        else:
            return [path], path.parent
    except Exception as error:  # each store has errors of its own
        raise UsageError(f"{printable(url)}: cannot be listed: {_cause(error)}") from error
    files = sorted(name for name, entry in found.items() if entry["type"] == "file")
    images = [remote(path.fs.unstrip_protocol(name)) for name in files]
    hidden = (".svg", ".svgz")
    return [p for p in images if not p.name.startswith(".") and p.suffix not in hidden], fixed


def read_remote(path: Path, limit: int) -> bytes:
    """Return at most ``limit + 1`` bytes of a file; raise ``ImageError`` if it cannot be read."""
    with _errors_as(ImageError, path, "cannot be read"), path.open("rb") as file:
        return file.read(limit + 1)


def write_remote(path: Path, data: bytes) -> None:
    """Write a file atomically: if the store does not, to a temporary file that is renamed.

    Raises:
        OutputError: It could not be written.
    """
    there: Any = path
    with _errors_as(OutputError, path, "could not be written"):
        if there.protocol in WHOLE:
            there.fs.pipe_file(there.path, data)
            return
        beside = there.with_name(f".warpsplat-{os.urandom(4).hex()}.tmp")
        there.fs.makedirs(there.parent.path, exist_ok=True)
        try:
            there.fs.pipe_file(beside.path, data)
            there.fs.mv(beside.path, there.path)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise


def listed(path: Path) -> bool:
    """Return whether a file was there when its folder was last listed, up to ``FRESH`` seconds ago.

    Raises:
        OutputError: The folder cannot be listed.
    """
    there: Any = path
    folder = str(path.parent)
    when, names = _listed.get(folder, (-FRESH, frozenset()))
    if time.monotonic() - when > FRESH:
        names = frozenset()
        with _errors_as(OutputError, path.parent, "cannot be listed"):
            there.fs.invalidate_cache()
            with contextlib.suppress(FileNotFoundError):
                entries = there.fs.ls(there.parent.path, detail=False)
                names = frozenset(entry.rstrip("/").rpartition("/")[2] for entry in entries)
        _listed[folder] = (time.monotonic(), names)
    return path.name in names


def exists(path: Path) -> bool:
    """Return whether a file is there, by its folder's cached list or by asking; raises ``OutputError``."""
    if listed(path):
        return True
    with _errors_as(OutputError, path, "cannot be looked for"):
        return path.exists()


def check_remote(path: Path) -> None:
    """Raise ``UsageError`` if the protocol does not allow writing."""
    there: Any = path
    if there.protocol in READ_ONLY:
        raise UsageError(f"{printable(str(path))}: nothing can be written to {there.protocol}://")


@contextlib.contextmanager
def _errors_as(kind: type[WarpsplatError], path: Path, verb: str) -> Iterator[None]:
    """Raise errors in the block, each store has its own, as errors of ``kind`` about ``path``."""
    name = printable(str(path))
    try:
        yield
    except FileNotFoundError as error:
        if isinstance(error.__cause__, OSError):  # that no server answers is no such file to fsspec
            raise kind(f"{name}: {verb}: {_cause(error.__cause__)}") from error
        raise kind(f"{name}: no such file") from None
    except Exception as error:
        raise kind(f"{name}: {verb}: {_cause(error)}") from error


def _cause(error: BaseException) -> str:
    return printable(cause_of(error))
