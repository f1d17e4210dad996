"""What a user may set for a run: the one home of flags, keys of batch files and their words.

The command line makes its flags of this table, batch files take their keys from it, and a test compares the
table in the README with it. Defaults are those of ``fit.settings``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from warpsplat.errors import UsageError, printable
from warpsplat.extensions import renderer_names
from warpsplat.fit.settings import (
    DEFAULT_QUALITY,
    QUALITIES,
    Painting,
    Settings,
    Subject,
    make_settings,
)
from warpsplat.scene import Kind

_defaults = Settings()

PALETTE_BYTES = 10_000
"""Most that is read of a file with colours."""


@dataclass(frozen=True)
class Option:
    """One setting, as users know it."""

    name: str
    """The flag without its dashes, and the key of batch files."""
    type: type
    """``str`` for what ``make_settings`` reads itself: times and sizes."""
    help: str
    default: str = ""
    """As it is shown; empty where there is none."""
    metavar: str = ""
    choices: tuple[str, ...] = ()
    kind: Kind | None = None
    """Of a flag that says a kind of shapes."""

    @property
    def setting(self) -> str:
        """The keyword of ``make_settings``."""
        return "kind" if self.kind is not None else self.name.replace("-", "_")


OPTIONS = (
    Option(
        "curves",
        int,
        "Number of shapes; with a goal the most.",
        f"{_defaults.curves}; fewer for a simple image",
        "N",
    ),
    Option(
        "subject",
        str,
        "What the image shows: to a photo shapes are fitted, the others are traced.",
        _defaults.subject,
        choices=get_args(Subject),
    ),
    Option("closed", bool, "Filled shapes.", "yes", kind=Kind.FILL),
    Option("open", bool, "Strokes.", kind=Kind.STROKE),
    Option(
        "mixed",
        bool,
        "Fills, and strokes where they remove more error; of line art, fills where it is filled.",
    ),
    Option("quality", str, "Effort: how many steps.", DEFAULT_QUALITY, choices=QUALITIES),
    Option(
        "renderer",
        str,
        "How the fit sees shapes: as viewers do, as Gaussians much like that, or as the paper's soft ones.",
        _defaults.renderer,
        choices=renderer_names(),
    ),
    Option(
        "paint",
        str,
        "A colour for each shape, a gradient for each, or whichever is worth its bytes.",
        _defaults.paint,
        choices=get_args(Painting),
    ),
    Option("layered", bool, "Groups from coarse to fine, each with those before it a picture of its own."),
    Option(
        "levels",
        str,
        "Numbers of shapes up to the end of each group of --layered, as 64,256,1024.",
        metavar="N,N",
    ),
    Option("colors", int, "No more than N colours; the fills are opaque then.", metavar="N"),
    Option("palette", str, "The only colours, #ff8800,#fff ... or a file with them.", metavar="COLORS"),
    Option("opaque", bool, "No translucent shapes."),
    Option("iterations", int, "Steps; overrides the effort's number.", metavar="N"),
    Option("target-psnr", float, "The smallest file with a PSNR of at least DB.", metavar="DB"),
    Option("time-budget", str, "As many steps as end within 60s, 2m ...", metavar="TIME"),
    Option("max-bytes", str, "The best file of no more than 100KB, 1MB ...", metavar="SIZE"),
    Option(
        "max-memory",
        str,
        "Memory to stay below, as 4GB: a larger image is worked on at a smaller size.",
        metavar="SIZE",
    ),
    Option("seed", int, "Random seed.", str(_defaults.seed), "N"),
    Option(
        "background",
        str,
        "auto: transparent where the image is; none; or a colour (#rrggbb).",
        _defaults.background,
        "COLOR",
    ),
    Option("title", str, "Title of the picture, in the file.", metavar="TEXT"),
    Option("size", str, "For plotters: size that the picture fills, as 200x150mm.", metavar="WxH"),
    Option(
        "page", str, "For plotters: sheet that it fills but for margins: a3, a4, a5, letter.", metavar="NAME"
    ),
    Option("units", str, "Units in which the file says its size: mm, cm, in, pt, px.", metavar="UNIT"),
    Option("ids", bool, "Name paths by their colours, and group neighbours of one, for editors."),
    Option("minify", bool, "Smallest text: no line breaks, no mark that warpsplat wrote it."),
    Option("precision", int, "Most decimals of a pixel in coordinates.", "auto", "N"),
)

BY_NAME: Mapping[str, Option] = {option.name: option for option in OPTIONS}

KINDS: Mapping[str, Kind] = {o.name: o.kind for o in OPTIONS if o.kind is not None}
"""What flags and keys call the kinds of shapes."""


def read_palette(path: Path) -> str:
    """The colours in a text file.

    Raises:
        UsageError: it cannot be read, or has no end, as some devices.
    """
    try:
        with path.open("rb") as file:
            found = file.read(PALETTE_BYTES + 1)
        if len(found) > PALETTE_BYTES:
            raise UsageError(f"palette {printable(str(path))}: has more than {PALETTE_BYTES} bytes")
        return found.decode("ascii")
    except (OSError, ValueError) as error:
        cause = error.strerror if isinstance(error, OSError) else "no text"
        if isinstance(error, UnicodeEncodeError) or "\0" in str(path):
            cause = "holds a character that no name can have"
        raise UsageError(f"palette {printable(str(path))}: {cause}; colours begin with #") from error


def settings_from(given: Mapping[str, Any]) -> Settings:
    """Settings from keywords of ``make_settings``; those that are None come from the preset.

    Raises:
        UsageError: a value is out of range.
    """
    values = dict(given)
    palette = values.get("palette")
    if isinstance(palette, str) and "#" not in palette:
        values["palette"] = read_palette(Path(palette))
    return make_settings(values.pop("quality", None) or DEFAULT_QUALITY, **values)
