"""Settings of a run: the one home of every default, checked when made."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Literal, get_args

import numpy as np

from warpsplat.errors import UsageError, shown
from warpsplat.extensions import load_renderer, renderer_names
from warpsplat.fit.texts import parse_bytes, parse_duration, parse_levels, parse_palette
from warpsplat.scene import ATTRIBUTES, Basis, FloatArray, Kind

Quality = Literal["draft", "balanced", "high"]
Order = Literal["age", "area"]
Subject = Literal["auto", "photo", "drawing", "line", "pixel"]
Renderer = str
Painting = Literal["flat", "linear", "radial", "auto"]


FRACTION = (0.0, 1.0)
WEIGHT = (0.0, 1e6)
RANGES: dict[str, tuple[float, float]] = {
    **dict.fromkeys(("coarse", "final_rate", "texture", "opacity"), FRACTION),
    **dict.fromkeys(("ssim", "xing", "bending", "level_weight"), WEIGHT),
    **dict.fromkeys(("fold_start", "fold_end"), (1e-6, 1e6)),
    "softness": (0.0, 100.0),
    "gaussian_density": (0.05, 20.0),
}
"""Least and largest values of the settings that are numbers."""
DENSITY_RANGES: dict[str, tuple[float, float]] = {
    **dict.fromkeys(("grown", "thin", "stop", "opacity_start", "opacity_end", "replace"), FRACTION),
    **dict.fromkeys(("duplicate_color", "duplicate_overlap"), (0.0, 2.0)),
    "start": (1e-3, 1.0),
    "surplus": (1.0, 10.0),
    "mean_points": (3.0, 100.0),
    "area": (0.0, 1e9),
}


def check_whole(name: str, value: object, low: int, high: int) -> None:
    """Whether a setting is a whole number in its range.

    Raises:
        UsageError: it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise UsageError(f"{name} must be a whole number from {low} to {high}, not {shown(value)}")


def check_number(name: str, value: object, low: float, high: float) -> None:
    """Whether a setting is a number in its range.

    Raises:
        UsageError: it is not.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise UsageError(f"{name} must be a number from {low:g} to {high:g}, not {shown(value)}")


def default_rates() -> dict[str, float]:
    """Learning rates by attribute, in the units of the table (``ATTRIBUTES``)."""
    return {attribute.name: attribute.rate for attribute in ATTRIBUTES}


@dataclass(frozen=True)
class Density:
    """Pruning and densification (paper section 3.4), and growth from few shapes to all."""

    start: float = 1 / 3
    """Fraction of the shapes at the start: the first ones settle as large ones."""
    grown: float = 0.5
    """Fraction of the run at which all shapes are there; until then their number grows geometrically."""
    surplus: float = 1.5
    """Shapes at the most, over those that are left in the end."""
    thin: float = 0.65
    """Fraction of the run from which on the surplus is removed, until ``stop``."""
    mean_points: float = 10.4
    """Points that splines have in the mean in the end: those that their outlines need least are removed."""
    interval: int = 25
    """Steps between two turns."""
    stop: float = 0.85
    """Fraction of the run after which the set of shapes stays as it is."""
    opacity_start: float = 0.2
    """Prune below this opacity at the start; the threshold falls linearly to ``opacity_end`` at ``stop``."""
    opacity_end: float = 0.05
    area: float = 6.0
    """Prune below this area [px of the canvas, squared]."""
    duplicate_color: float = 0.03
    """Two shapes are alike below this distance of colours ..."""
    duplicate_overlap: float = 0.9
    """... and above this overlap (intersection over union) of their boxes."""
    replace: float = 0.1
    """Replace at least this fraction of the shapes each turn: those without which the error grows least."""

    def __post_init__(self) -> None:
        """Check ranges.

        Raises:
            UsageError: a value is out of its range.
        """
        check_whole("density interval", self.interval, 0, 1_000_000)
        for name, (low, high) in DENSITY_RANGES.items():
            check_number(f"density {name.replace('_', '-')}", getattr(self, name), low, high)


@dataclass(frozen=True)
class Settings:
    """All that decides the result, besides the image."""

    subject: Subject = "auto"
    """What the image shows: ``photo`` is fitted, the others are traced (``drawing.subjects``)."""
    kind: Kind = Kind.FILL
    """Of new shapes."""
    mixed: bool = False
    """Whether new shapes are strokes where these remove more error than fills: where it is a bar."""
    basis: Basis = Basis.SPLINE
    """Of new shapes; splats need cubics."""
    spline_points: int = 12
    """Control points of a new spline."""
    curves: int = 512
    simplify: bool = False
    """Whether an image that is simple gets fewer shapes (``place.simple_curves``)."""
    iterations: int = 1000
    coarse: float = 0.82
    """Fraction of the iterations on a reduced image."""
    coarse_pixels: int = 100_000
    """Size of that image [pixels]; a smaller image is not reduced."""
    fine_pixels: int = 1_600_000
    """Largest size of the image that the last iterations see [pixels]."""
    seed: int = 0
    opacity: float = 0.98
    """Of a new shape: it hides what it should replace, and may still become translucent."""
    chain_cubics: int = 2
    """Cubics in each of the two chains of a fill."""
    renderer: Renderer = "exact"
    """Model of coverage in training: that of the exported paths, the paper's Gaussians placed so that they
    look like the paths, or the paper's own soft ones."""
    paint: Painting = "flat"
    """Of each shape: a colour, a gradient of one kind, or a gradient where it is worth its bytes."""
    softness: float = 0.6
    """Standard deviation that soft Gaussians have at least [px of the canvas]."""
    gaussian_density: float = 0.5
    """Soft Gaussians along and across a shape over their usual number."""
    order: Order = "age"
    """Newest in front, or smallest in front as in the paper."""
    ssim: float = 0.0
    """Weight of 1 - SSIM of small windows beside the mean squared error. It raises the SSIM, and lowers PSNR
    and SSIMULACRA2."""
    texture: float = 0.1
    """Power of the local variance by which the error of a pixel counts less: what is busy hides errors. 0.3
    raises SSIMULACRA2 by some more points and lowers PSNR (docs/experiments.md)."""
    xing: float = 0.0
    """Weight of the Xing loss (paper: 0.01), which forbids shapes that do no harm here."""
    bending: float = 5e-4
    """Weight of the bending of the cubics [squared error of a pixel, summed over channels, per pixel]: burrs
    and loops that do not lower the error straighten."""
    fold_start: float = 0.2
    """Weight of the fold loss (the area where a fill's strip folds over itself) at the start; it
    grows geometrically: folds are a way round obstacles at first and a fault in the file at the end."""
    fold_end: float = 3.0
    through_scales: bool = True
    """Whether gradients flow through the Gaussians' scales and angles."""
    viewer: bool = True
    """Whether the last steps take what a viewer shows, its rounding included, for the render."""
    background: str = "auto"
    """``auto``: that of the image, transparent where it has opacity; ``none``: transparent in any case; or a
    colour, ``#rrggbb``, that shows through as well."""
    title: str = ""
    """Of the picture, in the file; empty: none."""
    size: str = ""
    """How large a sheet the picture fills, as ``200x150mm``; empty: its own size."""
    page: str = ""
    """Format of the sheet in whose middle the picture lies, as ``a4``; empty: none."""
    units: str = ""
    """In which the file says its size; empty: pixels, millimetres of a sheet."""
    ids: bool = False
    """Whether paths have identifiers, by their colours, and those of one colour groups, in the file: they are
    brought together where nothing lies between."""
    minify: bool = False
    """Whether the file has neither line breaks nor the mark that it was written here."""
    precision: int | None = None
    """Most decimals of a pixel that coordinates have in the file; None: as many as are needed to lose little
    (``fit.rounding``)."""
    target_psnr: float | None = None
    """The smallest file that has this PSNR, as a viewer shows it [dB]; ``curves`` are the most that it may
    have, unless ``simplify``."""
    time_budget: float | None = None
    """Size the run to end within this time [s], start of the program not included."""
    max_bytes: int | None = None
    """The best file that has no more [bytes]; ``curves`` as for ``target_psnr``."""
    max_memory: int | None = None
    """Memory that the run may take [bytes]: a larger image is worked on at a smaller size. None: what the
    machine has (``run.memory``)."""
    colors: int | None = None
    """Most different colours that the file may have; its fills are opaque then."""
    palette: tuple[str, ...] = ()
    """The only colours that the file may have, ``#rrggbb``; its fills are opaque then."""
    opaque: bool = False
    """Whether no shape is translucent."""
    tidy: bool = True
    """Whether drawings lose nodes that are worth less than their bytes, which takes most of their time."""
    levels: tuple[int, ...] = ()
    """Numbers of shapes, ascending: the first so many are a picture of their own (``fit.layered``)."""
    level_weight: float = 0.3
    """What the squared error of each earlier level's picture counts beside that of the whole."""
    rates: dict[str, float] = field(default_factory=default_rates)
    """Adam's learning rates at the start, by attribute; they decay along a cosine."""
    final_rate: float = 0.2
    """Fraction of each rate that is left at the end."""
    density: Density = field(default_factory=Density)

    def __post_init__(self) -> None:
        """Check ranges.

        Raises:
            UsageError: a value is out of its range.
        """
        checks = (
            ("curves", self.curves, 1, 100_000),
            ("iterations", self.iterations, 1, 1_000_000),
            ("precision", 0 if self.precision is None else self.precision, 0, 6),
            ("seed", self.seed, 0, 2**32 - 1),
            ("chain-cubics", self.chain_cubics, 1, 8),
            ("spline-points", self.spline_points, 3, 64),
            ("coarse-pixels", self.coarse_pixels, 1, 10**9),
            ("fine-pixels", self.fine_pixels, 1, 10**9),
        )
        for name, value, low, high in checks:
            check_whole(name, value, low, high)
        for name, (least, most) in RANGES.items():
            check_number(name.replace("_", "-"), getattr(self, name), least, most)
        for name, rate in self.rates.items():
            check_number(f"rates {name}", rate, 0.0, 1e6)
        goals = (
            ("target-psnr", self.target_psnr),
            ("time-budget", self.time_budget),
            ("max-bytes", self.max_bytes),
            ("max-memory", self.max_memory),
        )
        for name, goal in goals:
            if goal is not None and (
                isinstance(goal, bool) or not isinstance(goal, (int, float)) or not 0 < goal < math.inf
            ):
                raise UsageError(f"{name} must be a positive number, not {shown(goal)}")
        for name, value, kind in (("kind", self.kind, Kind), ("basis", self.basis, Basis)):
            if not isinstance(value, kind):
                raise UsageError(f"{name} must be a {kind.__name__}, not {shown(value)}")
        if not isinstance(self.title, str) or len(self.title) > MAX_TITLE:
            raise UsageError(f"title must be a text of at most {MAX_TITLE} characters")
        switches = ("through_scales", "viewer", "mixed", "ids", "minify", "opaque")
        for name, given in ((name.replace("_", "-"), getattr(self, name)) for name in switches):
            if not isinstance(given, bool):
                raise UsageError(f"{name} must be true or false, not {shown(given)}")
        self._check_levels()
        if self.colors is not None:
            check_whole("colors", self.colors, 1, MOST_COLORS)
        if len(self.palette) > MOST_COLORS:
            raise UsageError(f"palette has {len(self.palette)} colours, more than {MOST_COLORS}")
        fitted = self.fitted_options()
        if self.subject == "line":
            fitted = [name for name in fitted if name != "mixed"]
        if self.subject not in {"auto", "photo"} and fitted:
            raise UsageError(f"subject {self.subject} and {fitted[0]} do not go together")
        choices = (
            ("subject", self.subject, get_args(Subject)),
            ("order", self.order, get_args(Order)),
            ("renderer", self.renderer, renderer_names()),
            ("paint", self.paint, get_args(Painting)),
        )
        if self.background not in {"auto", "none"} and not COLOR.fullmatch(self.background):
            given = shown(self.background)
            raise UsageError(f"background must be auto, none or a colour as #ffffff, not {given}")
        if self.mixed and self.kind != Kind.FILL:
            raise UsageError("mixed and open do not go together")
        for name, choice, allowed in choices:
            if choice not in allowed:
                raise UsageError(f"{name} must be one of {', '.join(allowed)}, not {shown(choice)}")

    @property
    def is_limited(self) -> bool:
        """Whether the file may have some colours only."""
        return self.colors is not None or bool(self.palette)

    def fitted_options(self) -> list[str]:
        """Options that say something of fitted shapes only, as they are given."""
        given = {
            "open": self.kind == Kind.STROKE,
            "mixed": self.mixed,
            "levels": bool(self.levels),
            f"paint {self.paint}": self.paint != "flat",
            f"renderer {self.renderer}": self.renderer != "exact",
            "target-psnr": self.target_psnr is not None,
            "max-bytes": self.max_bytes is not None and self.subject != "drawing",
        }
        return [name for name, is_given in given.items() if is_given]

    def _check_levels(self) -> None:
        levels = self.levels
        for count in levels:
            check_whole("levels", count, 1, 100_000)
        if any(later <= earlier for earlier, later in itertools.pairwise(levels)):
            raise UsageError(f"levels must ascend, not {','.join(map(str, levels))}")
        if levels and levels[-1] != self.curves:
            raise UsageError(f"curves {self.curves} and levels, whose last is {levels[-1]}, differ")
        goals = {
            "target-psnr": self.target_psnr,
            "max-bytes": self.max_bytes,
            "time-budget": self.time_budget,
        }
        for name, goal in goals.items():
            if levels and goal is not None:
                raise UsageError(f"levels and {name} do not go together")

    def fingerprint(self) -> str:
        """A short hash of all that decides the result."""
        values = asdict(self)
        if self.max_memory is None:  # which few runs depend on
            del values["max_memory"]
        text = json.dumps(values, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


MOST_COLORS = 256
"""Of a palette."""

MAX_TITLE = 1000
"""Characters: a title is a line."""

COLOR = re.compile(r"#[0-9a-fA-F]{6}")


def solid_color(background: str) -> FloatArray | None:
    """The colour that ``Settings.background`` names, sRGB in [0, 1], shape (3,); None if it names none."""
    if not COLOR.fullmatch(background):
        return None
    return np.frombuffer(bytes.fromhex(background[1:]), np.uint8).astype(np.float32) / np.float32(255)


LEVEL_FACTOR = 4
"""Shapes of a level over those of the one before, where only ``layered`` is asked for."""

LEAST_LEVEL = 8
"""Shapes of the first of these levels, at the least."""


def levels_of(curves: int) -> tuple[int, ...]:
    """Up to three levels, the last with all the ``curves``."""
    levels = [curves // LEVEL_FACTOR**2, curves // LEVEL_FACTOR, curves]
    return tuple(count for count in levels if count >= LEAST_LEVEL or count == curves)


PRESETS: dict[Quality, dict[str, Any]] = {
    "draft": {
        "iterations": 200,
        "coarse": 0.9,
        "coarse_pixels": 65_000,
        "fine_pixels": 400_000,
        "tidy": False,
    },
    "balanced": {},
    "high": {"iterations": 4000, "coarse_pixels": 200_000, "fine_pixels": 3_000_000},
}
"""What each preset changes in the defaults."""

FILL_POINT_RATE = 6.0
"""Learning rate of the points of splined fills [px]: each has only a share in the outline that is near it."""

QUALITIES: tuple[Quality, ...] = tuple(PRESETS)

DEFAULT_QUALITY: Quality = "balanced"


def make_settings(quality: Quality = DEFAULT_QUALITY, **overrides: Any) -> Settings:
    """The preset ``quality`` with ``overrides`` on top; overrides that are None are left out.

    Without ``curves`` among them, a simple image gets fewer than the default (``Settings.simplify``).

    Raises:
        UsageError: an unknown name or a value out of range.
    """
    if quality not in PRESETS:
        raise UsageError(f"quality must be one of {', '.join(PRESETS)}, not {shown(quality)}")
    known = {f.name for f in fields(Settings)}
    given = {name: value for name, value in overrides.items() if value is not None}
    layered = given.pop("layered", False)
    if not isinstance(layered, bool):
        raise UsageError(f"layered must be true or false, not {shown(layered)}")
    if "levels" in given or layered:
        curves = given.get("curves", Settings.curves)
        given["levels"] = parse_levels(given["levels"]) if "levels" in given else levels_of(curves)
        given.setdefault("curves", given["levels"][-1])
    for name in given:
        if name not in known:
            raise UsageError(f"unknown setting {shown(name)}")
    if "time_budget" in given:
        given["time_budget"] = parse_duration(given["time_budget"])
    if "max_bytes" in given:
        given["max_bytes"] = parse_bytes(given["max_bytes"])
    if "max_memory" in given:
        given["max_memory"] = parse_bytes(given["max_memory"])
    if "palette" in given:
        given["palette"] = parse_palette(given["palette"])
    if given.get("paint", "flat") != "flat" and (given.get("colors") or given.get("palette")):
        raise UsageError(f"paint {given['paint']} and a palette do not go together")
    if given.get("colors") or given.get("palette"):
        given["opaque"] = True
    preset = Settings(simplify="curves" not in given, **PRESETS[quality])
    if given.get("renderer", "exact") != "exact":
        preset = load_renderer(given["renderer"]).preset(preset)
    elif given.get("kind", Kind.FILL) == Kind.FILL:
        preset = replace(preset, rates={**preset.rates, "points": FILL_POINT_RATE})
    if given.get("opaque"):
        preset = replace(preset, rates={**preset.rates, "opacities": 0.0})
    if given.get("paint", "flat") != "flat":
        # They have bytes for what colours and frames can say as well.
        preset = replace(preset, rates={**preset.rates, "stop_opacities": 0.0, "stop_offsets": 0.0})
    if "rates" in given:
        given["rates"] = {**preset.rates, **_known("rates", given["rates"], tuple(preset.rates))}
    if given.get("colors") or given.get("palette"):  # colours are chosen, not trained
        given["rates"] = {**given.get("rates", preset.rates), "colors": 0.0}
    if isinstance(given.get("density"), Mapping):
        names = tuple(f.name for f in fields(Density))
        given["density"] = replace(preset.density, **_known("density", given["density"], names))
    if isinstance(given.get("basis"), str):
        if given["basis"].upper() not in Basis.__members__:
            choices = ", ".join(Basis.__members__).lower()
            raise UsageError(f"basis must be one of {choices}, not {shown(given['basis'])}")
        given["basis"] = Basis[given["basis"].upper()]
    settings = replace(preset, **given)
    if settings.renderer != "exact":
        load_renderer(settings.renderer).check(settings)
    if settings.size or settings.page or settings.units:
        from warpsplat.svg.page import check_placing  # brings what writes files

        check_placing(settings.size, settings.page, settings.units)
    return settings


def _known(name: str, given: Mapping[str, Any], known: tuple[str, ...]) -> dict[str, Any]:
    """``given`` with underscores in its keys.

    Raises:
        UsageError: one is not ``known``.
    """
    values = {key.replace("-", "_"): value for key, value in given.items()}
    for key in values:
        if key not in known:
            raise UsageError(f"unknown setting {shown(key)} in {name}")
    return values
