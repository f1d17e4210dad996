"""The manifest of a batch: which results were made, their figures, and which process makes what.

A file of JSON lines, each an event, appended in one write. A crash can damage only the last line; damaged
lines are ignored, as are those of later versions. Entries are found by the result's name and its key
(``job_key``: content of the image, settings), so that a changed image or setting finds none.

A job is claimed by locking one byte of the same file, far behind its end, whose position is a hash of name
and key. Such a lock ends with its process, however that ends, and machines that share the folder see it.
"""

from __future__ import annotations

import datetime
import errno
import hashlib
import json
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from warpsplat.errors import OutputError, UsageError, cause_of
from warpsplat.files.remote import is_remote

try:
    import fcntl
except ImportError:  # Windows: two batches at once may both make an image
    fcntl = None  # type: ignore[assignment]

LOCK, TRY_LOCK, UNLOCK = (fcntl.LOCK_EX, fcntl.LOCK_EX | fcntl.LOCK_NB, fcntl.LOCK_UN) if fcntl else (0, 0, 0)

NAME = "warpsplat-manifest.jsonl"
"""Default name, in the folder of the results."""

FIRST_LOCK = 1 << 40
"""First of the bytes that stand for claims; there are as many. It is itself the lock of the file's end."""

Event = Literal["made", "failed", "writing"]
"""``writing``: the result is about to be written; by this, one without a mark is known to be ours."""


@dataclass(frozen=True)
class Entry:
    """An event in the life of a result."""

    output: str
    """The result, relative to the manifest's folder, with slashes; or its URL."""
    key: str
    event: Event
    digest: str = ""
    """SHA-256 of the result's bytes."""
    image: str = ""
    error: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)

    def line(self) -> bytes:
        """Return the entry as a line of the file."""
        now = datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")
        values = {"v": 1, "time": now, **vars(self)}
        text = json.dumps({key: value for key, value in values.items() if value not in ("", {})})
        return text.encode() + b"\n"


def entry_of(line: bytes) -> Entry | None:
    """Parse a line; return None if it is damaged or of a later version."""
    try:
        values = json.loads(line)
        if values.pop("v") != 1:
            return None
        del values["time"]
        return Entry(**values)
    except (ValueError, TypeError, LookupError, AttributeError):
        return None


def digest(data: bytes) -> str:
    """Return the SHA-256 of a result, hexadecimal."""
    return hashlib.sha256(data).hexdigest()


class Manifest:
    """A manifest file. Nothing else in this process may open it meanwhile: closing it ends all claims."""

    def __init__(self, path: Path) -> None:
        """Nothing is read or created yet."""
        self.path = path
        self.damaged = 0
        """Lines that were ignored."""
        self._folder = Path(os.path.abspath(path)).parent
        self._handle: int | None = None
        self._position = 0
        """Bytes that were read."""
        self._lines: dict[str, list[bytes]] = {}

    def open(self, *, write: bool = True) -> None:
        """Read the file if it exists; with ``write``, create it. May be called again, to write as well.

        Raises ``UsageError`` if it is no file, or cannot be read or created.
        """
        flags = (os.O_RDWR | os.O_CREAT | os.O_APPEND) if write else os.O_RDONLY
        try:
            if write:
                self._folder.mkdir(parents=True, exist_ok=True)
            # Opening a pipe would block.
            handle = os.open(
                self.path, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0), 0o666
            )
        except FileNotFoundError:
            return
        except (OSError, ValueError) as error:
            cause = f"cannot be opened: {cause_of(error)}; --manifest FILE names another place"
            raise UsageError(f"manifest {self.path}: {cause}") from error
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            os.close(handle)
            raise UsageError(f"manifest {self.path}: is not a file; --manifest FILE names another one")
        self.close()
        self._handle = handle
        self.refresh()

    def close(self) -> None:
        """Close the file and release all claims."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def refresh(self) -> None:
        """Read the lines that any process added; an incomplete one is left for the next time."""
        if self._handle is None:
            return
        size = os.fstat(self._handle).st_size
        if size <= self._position:
            return
        os.lseek(self._handle, self._position, os.SEEK_SET)
        with open(self._handle, "rb", closefd=False) as file:
            for line in file:
                if not line.endswith(b"\n"):
                    break
                self._position += len(line)
                entry = entry_of(line)
                if entry:
                    self._lines.setdefault(entry.output, []).append(line)
                elif line.strip():
                    self.damaged += 1

    def name(self, output: Path) -> str:
        """Return the name of a result in entries."""
        if is_remote(output):
            return str(output)
        relative = os.path.relpath(os.path.abspath(output), self._folder)
        return Path(relative).as_posix().encode("utf-8", "backslashreplace").decode()

    def entries(self, output: Path) -> list[Entry]:
        """Return the entries of a result, the latest last."""
        return [entry for line in self._lines.get(self.name(output), ()) if (entry := entry_of(line))]

    def append(self, entry: Entry) -> None:
        """Add a line in one write; raise ``OutputError`` if it cannot be written."""
        assert self._handle is not None, "open"
        try:
            self._lock(LOCK)
            try:
                line = (b"" if self._ends_whole() else b"\n") + entry.line()
                if os.write(self._handle, line) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            finally:
                self._lock(UNLOCK)
        except OSError as error:
            raise OutputError(f"manifest {self.path}: could not be written: {error.strerror}") from error

    def _ends_whole(self) -> bool:
        """Return whether the file is empty or ends with a complete line, which a crash may have prevented."""
        assert self._handle is not None
        size = os.fstat(self._handle).st_size
        if size == 0:
            return True
        os.lseek(self._handle, size - 1, os.SEEK_SET)
        return os.read(self._handle, 1) == b"\n"

    def _lock(self, operation: int, byte: int = FIRST_LOCK) -> None:
        """Lock or unlock a byte: ``LOCK``, ``TRY_LOCK`` or ``UNLOCK``."""
        if fcntl is not None and self._handle is not None:
            fcntl.lockf(self._handle, operation, 1, byte)

    def claim(self, output: Path, key: str) -> bool:
        """Claim a result; return False if another process has. Without locks, raise ``OutputError``."""
        try:
            self._lock(TRY_LOCK, self._byte(output, key))
        except (BlockingIOError, PermissionError):
            return False
        except OSError as error:
            cause = f"cannot be locked: {error.strerror}; --manifest FILE names another place"
            raise OutputError(f"manifest {self.path}: {cause}") from error
        return True

    def release(self, output: Path, key: str) -> None:
        """Release a claim."""
        self._lock(UNLOCK, self._byte(output, key))

    def _byte(self, output: Path, key: str) -> int:
        place = int(digest(f"{self.name(output)}\0{key}".encode())[:16], 16)
        return FIRST_LOCK + 1 + place % FIRST_LOCK
