"""Formats that Pillow reads with further packages: HEIC, the photographs of phones, and JPEG XL."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import NamedTuple

from warpsplat.errors import ImageError

HEAD = 12
"""Bytes by which a format is known."""

HEIC_BRANDS = {b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1"}


class Plugin(NamedTuple):
    """A package that reads a format."""

    name: str
    """The format's name in messages."""
    format: str
    """Pillow's name for it."""
    begins: Callable[[bytes], bool]
    """Whether a file has it, by its first bytes."""
    package: str
    module: str
    register: str
    """Function of the module that tells Pillow of it; empty: its import does."""
    extra: str
    """This project's extra that installs it."""


PLUGINS = (
    Plugin(
        "HEIC",
        "HEIF",
        lambda head: head[4:8] == b"ftyp" and head[8:12] in HEIC_BRANDS,
        "pillow-heif",
        "pillow_heif",
        "register_heif_opener",
        "heic",
    ),
    Plugin(
        "JPEG XL",
        "JXL",
        lambda head: head.startswith((b"\xff\x0a", b"\0\0\0\x0cJXL \r\n\x87\n")),
        "pillow-jxl-plugin",
        "pillow_jxl",
        "",
        "jxl",
    ),
)


def plugin_formats(data: bytes) -> tuple[str, ...]:
    """Return Pillow's names of further formats that an image file may have, which Pillow then can read.

    Raises ``ImageError``, which names the package, if the one that reads it is not installed.
    """
    for plugin in PLUGINS:
        if plugin.begins(data[:HEAD]):
            try:
                module = importlib.import_module(plugin.module)
            except ImportError:
                raise ImageError(
                    f"{plugin.name} needs a package that is not installed: pip install {plugin.package}, "
                    f"or warpsplat with its extra: '.[{plugin.extra}]'"
                ) from None
            if plugin.register:
                getattr(module, plugin.register)()
            return (plugin.format,)
    return ()
