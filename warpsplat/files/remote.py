"""Files behind URLs (``s3://``, ``gs://``, ``https://`` ...); an extra, ``pip install "warpsplat[remote]"``.

Such a file is a path of universal_pathlib, which is pathlib's interface over fsspec: names, parents and ``/``
are those of a path of this machine, so that both have one type here. What the system does with names
(``os.path``) cannot be done with them; who asks it looks at ``is_remote`` first.
"""

from __future__ import annotations

import re
import secrets
import time
from collections.abc import Callable, Iterator
from pathlib import Path, PurePath
from typing import Any, TypeVar

from warpsplat.errors import ImageError, OutputError, UsageError, WarpsplatError, printable

URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
"""How URLs begin; the letter of a drive is no protocol."""

WILD = "*?["
"""Characters that make a name a pattern."""

READ_ONLY = ("http", "https", "data", "github")
"""Protocols that nothing is written through."""

WHOLE = ("s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oci", "memory")
"""Protocols of stores that show an object when all of it is there, and that know no renaming."""

FRESH = 300.0
"""Seconds for which the names in a folder are remembered: one request lists a thousand, or asks for one."""

Value = TypeVar("Value")

_listed: dict[str, tuple[float, frozenset[str]]] = {}
"""Folder -> when it was listed, and the names in it."""


def is_url(name: str) -> bool:
    """Whether a user's name of a file is a URL."""
    return URL.match(name) is not None


def is_remote(path: PurePath) -> bool:
    """Whether a path is behind a URL."""
    return not isinstance(path, PurePath)


def remote(url: str) -> Path:
    """The path that a URL means; ``file://`` is one of this machine.

    Raises:
        UsageError: a package is missing, or nobody knows the protocol.
    """
    try:
        from upath import UPath
    except ImportError as error:
        raise UsageError(f'{printable(url)}: {error}; pip install "warpsplat[remote]" installs it') from error
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
    """The images that a URL means, sorted, and the folder that they were looked for in.

    Args:
        url: of one image, a folder, or with ``*``, ``?``, ``[`` a pattern; a query belongs to the name.
        endings: of names that are taken for images in a folder.

    Raises:
        UsageError: the store does not answer, or does not know the pattern.
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
    """At most ``limit + 1`` bytes of a file.

    Raises:
        ImageError: it is not there, or its store does not give it.
    """

    def read() -> bytes:
        with path.open("rb") as file:
            return file.read(limit + 1)

    return _asked(read, path, ImageError, "cannot be read")


def write_remote(path: Path, data: bytes) -> None:
    """Write a file: stores show it once it is whole; elsewhere it is written beside, then renamed.

    Raises:
        OutputError: the store does not take it.
    """
    there: Any = path

    def write() -> None:
        if there.protocol in WHOLE:
            there.fs.pipe_file(there.path, data)
            return
        beside = there.with_name(f".warpsplat-{secrets.token_hex(4)}.tmp")
        there.fs.makedirs(there.parent.path, exist_ok=True)
        try:
            there.fs.pipe_file(beside.path, data)
            there.fs.mv(beside.path, there.path)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise

    _asked(write, path, OutputError, "could not be written")


def listed(path: Path) -> bool:
    """Whether a file was there when its folder was listed, in the last minutes.

    Raises:
        OutputError: its store does not say.
    """
    there: Any = path
    folder = str(path.parent)
    when, names = _listed.get(folder, (-FRESH, frozenset()))
    if time.monotonic() - when > FRESH:

        def look() -> Iterator[str]:
            try:
                there.fs.invalidate_cache()
                for entry in there.fs.ls(there.parent.path, detail=False):
                    yield entry.rstrip("/").rpartition("/")[2]
            except FileNotFoundError:
                return

        names = _asked(lambda: frozenset(look()), path.parent, OutputError, "cannot be listed")
        _listed[folder] = (time.monotonic(), names)
    return path.name in names


def exists(path: Path) -> bool:
    """Whether a file is there, which it is said to be.

    Raises:
        OutputError: its store does not say.
    """
    return listed(path) or _asked(path.exists, path, OutputError, "cannot be looked for")


def check_remote(path: Path) -> None:
    """Find out whether results can be written there, as far as the name tells.

    Raises:
        UsageError: they cannot.
    """
    there: Any = path
    if there.protocol in READ_ONLY:
        raise UsageError(f"{printable(str(path))}: nothing can be written to {there.protocol}://")


def _asked(
    question: Callable[[], Value], path: Path, kind: Callable[[str], WarpsplatError], verb: str
) -> Value:
    name = printable(str(path))
    try:
        return question()
    except FileNotFoundError:
        raise kind(f"{name}: no such file") from None
    except Exception as error:  # each store has errors of its own
        raise kind(f"{name}: {verb}: {_cause(error)}") from error


def _cause(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return printable(lines[0]) if lines else type(error).__name__
