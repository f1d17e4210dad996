"""Settings of a run: every option with its default, range and words, what contradicts what, and presets."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from warpsplat.errors import UsageError, shown
from warpsplat.extensions import load_renderer, renderer_names
from warpsplat.field_docs import described
from warpsplat.fit import optics as how
from warpsplat.fit.options import (
    COLOR,
    COLOR_NAMES,
    QUOTED,
    Option,
    color_of,
    nearest,
    option,
    options_of,
    parse_background,
    parse_bytes,
    parse_duration,
    parse_levels,
    parse_palette,
    research,
)
from warpsplat.scene import ATTRIBUTES, Basis, FloatArray, Kind

Quality = Literal["draft", "balanced", "high"]
Order = Literal["age", "area"]
Subject = Literal["auto", "photo", "drawing", "line", "pixel", "silhouette"]
Painting = Literal["flat", "linear", "radial", "auto"]
Stack = Literal["overlap", "cutout"]
Removal = Literal["outside", "everywhere"]
LossName = Literal["l2", "ssim", "edges"]
DxfCurves = Literal["arcs", "splines", "lines", "r12"]

SUBJECTS = {
    "photo": "photograph",
    "drawing": "drawing",
    "line": "line drawing",
    "pixel": "piece of pixel art",
    "silhouette": "silhouette",
}
"""Subjects as messages call them."""

LOSS_WEIGHTS: dict[LossName, float] = {"l2": 0.0, "ssim": 0.005, "edges": 3.0}
"""Weights of what joins the squared error."""

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
"""Changes of the defaults by quality."""

OF_PRESETS = {name for preset in PRESETS.values() for name in preset} - {"iterations"}
"""Settings that only these change: the number of steps may be given besides."""

QUALITIES: tuple[Quality, ...] = tuple(PRESETS)

DEFAULT_QUALITY: Quality = "balanced"

MOST_COLOR_COUNT = 256

FRACTION = (0.0, 1.0)

WEIGHT = (0.0, 1e6)

MOMENT = (0.0, 0.9999)

FITTED: dict[str, Any] = {"subjects": ("photo",), "elsewhere": "fitted"}
"""Arguments of options that ask for fitted shapes."""

TUNING: dict[str, Any] = {"subjects": ("photo",), "elsewhere": "ignored"}
"""Arguments of options that change how well shapes are fitted."""

DRAWN: dict[str, Any] = {"subjects": ("drawing",), "elsewhere": "ignored"}
"""Arguments of options that change how drawings are traced."""

main_option = functools.partial(option, group="What to make")
shape_option = functools.partial(option, group="Shapes")
color_option = functools.partial(option, group="Colours")
limit_option = functools.partial(option, group="Goals and limits")
fit_option = functools.partial(option, group="Fitting")
drawing_option = functools.partial(option, group="Drawings")
size_option = functools.partial(option, group="Size on paper")
machine_option = functools.partial(option, group="Cutters and plotters")
svg_option = functools.partial(option, group="Contents of the SVG")
"""Declare a field whose option is in a group of the help."""

LEVEL_FACTOR, LEAST_LEVEL_SHAPES = 4, 8
"""Shapes of a level over those of the one before if only ``layered`` is asked for, and least of the first."""

CURVE, LINE = "curve", "line"
"""Names of shapes that are curves, and of straight strokes."""

FORMS = {
    **{basis.name.lower(): (basis, 0) for basis in Basis if basis.is_form and basis != Basis.POLYGON},
    **{LINE: (Basis.POLYGON, 2), "triangle": (Basis.POLYGON, 3)},
}
"""Forms of shapes by name: the basis, and the number of vertices if it has vertices."""

POLYGON_CORNERS = "[3-9]|[1-5][0-9]|6[0-4]"

FORM_POINT_RATE, FORM_SURPLUS = 6.0, 2.0
"""Learning rate of the values of forms [px], and their ``Density.surplus``."""

FILL_POINT_RATE = 6.0
"""Learning rate of the points of splined fills [px]: each has only a share in the outline that is near it."""


def default_rates() -> dict[str, float]:
    """Return the learning rates by attribute, in the units of the table (``ATTRIBUTES``)."""
    return {attribute.name: attribute.rate for attribute in ATTRIBUTES}


def known_keys(name: str, known: Iterable[str], value: object) -> object:
    """Return a mapping with underscores in its keys; anything else as it is, for ``Option.check`` to refuse.

    Raises ``UsageError`` if a key is not ``known``.
    """
    if not isinstance(value, Mapping):
        return value
    values = {str(key).replace("-", "_"): inner for key, inner in value.items()}
    for key in values:
        if key not in known:
            raise UsageError(f"unknown setting {shown(key)} in {name}{nearest(key, known)}")
    return values


parse_rates = functools.partial(known_keys, "rates", default_rates())


def parse_density(value: object) -> object:
    """Return the default density with the values of a mapping; see ``known_keys``."""
    values = known_keys("density", [each.field for each in options_of(Density)], value)
    return Density(**values) if isinstance(values, dict) else values


def parse_basis(value: object) -> object:
    """Return the basis of a name; anything else is left to be checked."""
    found = Basis.__members__.get(value.upper()) if isinstance(value, str) else None
    return value if found is None or found.is_form else found


def check_fields(settings: Any, prefix: str = "") -> None:
    """Check types and ranges; raise ``UsageError``, which names ``prefix`` and the option."""
    for each in options_of(settings.__class__):
        each.check(getattr(settings, each.field), prefix)


@dataclass(frozen=True)
class Density:
    """Pruning and densification (paper section 3.4), and growth from few shapes to all."""

    start: float = research(1 / 3, "Fraction of the shapes to start with, as large ones.", (1e-3, 1.0))
    grown: float = research(0.5, "Fraction of the run in which the number of shapes grows.", FRACTION)
    surplus: float = research(1.5, "Most shapes at any time, over those that are left in the end.", (1, 10))
    thin: float = research(0.65, "Fraction of the run at which removal of the surplus begins.", FRACTION)
    mean_points: float = research(10.4, "Mean number of points of splines in the end.", (3, 100))
    interval: int = research(25, "Steps between two densification steps; 0: none.", (0, 1_000_000))
    stop: float = research(0.85, "Fraction of the run after which the set of shapes is fixed.", FRACTION)
    opacity_start: float = research(0.2, "Opacity below which shapes are pruned at the start.", FRACTION)
    opacity_end: float = research(0.05, "The same at `stop`; in between it falls linearly.", FRACTION)
    area: float = research(6.0, "Area below which shapes are pruned [px² of the canvas].", (0, 1e9))
    duplicate_color: float = research(0.03, "Distance of colours below which two shapes are alike.", (0, 2))
    duplicate_overlap: float = research(0.9, "Overlap (IoU) of boxes above which they are.", (0, 2))
    replace: float = research(0.1, "Least fraction replaced in each densification step.", FRACTION)

    def __post_init__(self) -> None:
        """Check ranges, see ``check_fields``."""
        check_fields(self, "density ")


@described
@dataclass(frozen=True)
class Settings:
    """Everything but the image that decides the result. Fields without help are set by other options."""

    curves: int = shape_option(
        512,
        "Number of shapes; with a goal, the maximum.",
        (1, 100_000),
        shown_default="512; fewer for a simple image",
        subjects=("photo", "drawing"),
        elsewhere="ignored",
        common=True,
    )
    subject: Subject = main_option(
        "auto",
        "Kind of image: photos are fitted with shapes, the other kinds are traced; silhouette: outlines of"
        " objects photographed on a plain ground.",
        common=True,
    )
    kind: Kind = shape_option(
        Kind.FILL,
        **FITTED,
        shorthands=(
            Option(name="closed", type=bool, help="Filled shapes.", shown_default="yes", value=Kind.FILL),
            Option(
                name="open",
                type=bool,
                help="Strokes instead of filled shapes.",
                value=Kind.STROKE,
                common=True,
            ),
        ),
    )
    shape: str = shape_option(
        CURVE,
        "Form of all shapes: triangle, rectangle, ellipse, circle, polygon:N, or line, a straight stroke.",
        shown_default="free outlines",
        pattern=f"{CURVE}|{'|'.join(FORMS)}|polygon:({POLYGON_CORNERS})",
        wanted=f"one of {', '.join((CURVE, *FORMS))}, or polygon:N with 3 to 64 corners",
        metavar="FORM",
        values=tuple(FORMS),
        **FITTED,
        common=True,
    )
    mixed: bool = shape_option(
        False,
        "Fills and strokes together, whichever suits better; in line art, fills for filled areas.",
        subjects=("photo", "line"),
        elsewhere="fitted",
    )
    iterations: int = fit_option(
        1000,
        "Number of steps, instead of that of --quality.",
        (1, 1_000_000),
        shown_default="",
        subjects=("photo", "line"),
        elsewhere="ignored",
        shorthands=(
            Option(
                name="quality",
                help="Effort: how many steps.",
                default=DEFAULT_QUALITY,
                choices=QUALITIES,
                group="What to make",
                common=True,
            ),
        ),
    )
    renderer: str = fit_option(
        "exact",
        "How a fit renders shapes: as viewers do, as Gaussians close to that, or as the paper's soft ones.",
        **FITTED,
        choices=renderer_names(),
    )
    paint: Painting | None = color_option(
        None,
        "Flat colours, one kind of gradient, or whichever is worth its bytes.",
        shown_default="flat for photos, auto for drawings",
        subjects=("photo", "drawing"),
        elsewhere="ignored",
    )
    loss: LossName = fit_option(
        "l2",
        "What a fit minimises: the squared error, or with it what differs in structure or along edges.",
        subjects=("photo",),
        refine=True,
    )
    levels: tuple[int, ...] = shape_option(
        (),
        "Total number of shapes after each level, such as 64,256,1024.",
        **FITTED,
        metavar="N,N",
        parse=parse_levels,
        shorthands=(
            Option(
                name="layered",
                type=bool,
                help="Levels from coarse to fine, as groups; those up to any one form a complete picture.",
            ),
        ),
    )
    colors: int | None = color_option(
        None, "At most N colours; the shapes are then opaque.", (1, MOST_COLOR_COUNT), common=True
    )
    palette: tuple[str, ...] = color_option(
        (),
        "The only colours, as '#f80,white' in quotes, or a file of them.",
        metavar="COLORS",
        values=COLOR_NAMES,
        files=True,
        parse=parse_palette,
    )
    opaque: bool = color_option(False, "No translucent shapes.", **TUNING)
    target_psnr: float | None = limit_option(
        None, "Make the smallest file with a PSNR of at least DB.", **FITTED, metavar="DB"
    )
    time_budget: float | None = limit_option(
        None,
        "Time limit, such as 60s or 2m; the number of steps is adapted to it.",
        metavar="TIME",
        parse=parse_duration,
        refine=True,
    )
    max_bytes: int | None = limit_option(
        None,
        "Make the best file of at most this size, such as 100KB or 1MB.",
        subjects=("photo", "drawing"),
        elsewhere="fitted",
        metavar="SIZE",
        parse=parse_bytes,
        common=True,
    )
    max_memory: int | None = limit_option(
        None,
        "Memory limit, such as 4GB; an image that needs more is processed at a reduced size.",
        metavar="SIZE",
        parse=parse_bytes,
    )
    detail: float = drawing_option(
        0.5, "For drawings: from 0, few big shapes, to 1, every speck.", FRACTION, **DRAWN, common=True
    )
    optics: str = drawing_option(
        "auto",
        "What a scan, a filter or resizing did to a drawing, to be undone: auto (found), none, "
        "the light alone (sRGB, linear), or the report.json of a run with --json.",
        pattern=how.PATTERN,
        wanted=how.WANTED,
        metavar="HOW",
        values=how.WORDS,
        files=True,
        parse=how.parse_optics,
        **DRAWN,
    )
    seed: int = fit_option(0, "Random seed.", (0, 2**32 - 1), **TUNING)
    background: str = color_option(
        "auto",
        "auto (transparent where the image is), none, or a colour: white, or '#fff' in quotes.",
        pattern=f"auto|none|(?i:{COLOR.pattern})",
        wanted=f"auto, none or a colour such as white or '#fff' ({QUOTED})",
        metavar="COLOR",
        values=("auto", "none", *COLOR_NAMES),
        parse=parse_background,
        refine=True,
        common=True,
    )
    remove_background: Removal | None = color_option(
        None,
        "Leave out the colour of the border: from there inwards, as --background none does, or also in holes,"
        " such as those of letters.",
    )
    title: str = svg_option("", "Title of the picture, in the file.", (0, 1000), metavar="TEXT", refine=True)
    size: str = size_option(
        "", "Size of the picture, such as 200x150mm; or one side, as in 200mm, x150mm.", metavar="WxH"
    )
    page: str = size_option(
        "",
        "Sheet of paper, with margins: a3, a4, a5, letter.",
        metavar="NAME",
        values=("a3", "a4", "a5", "letter"),
    )
    units: str = size_option(
        "",
        "Unit of the size in the file, which follows from the image's resolution: mm, cm, in, pt; or px.",
        metavar="UNIT",
        values=("mm", "cm", "in", "pt", "px"),
    )
    dpi: float | None = size_option(
        None,
        "Resolution of the image in pixels per inch, for its size in the file.",
        (1, 1e6),
        shown_default="that in the image file, else 96",
        metavar="N",
    )
    dxf: DxfCurves = machine_option(
        "arcs",
        "Curves in a .dxf: arcs; splines; lines, for OpenSCAD; r12: lines, for old programs.",
        refine=True,
    )
    width: str = machine_option(
        "",
        "For line art: one width for all strokes, in pixels or, such as 0.3mm, on the sheet.",
        metavar="N",
        parse=str,
        subjects=("line",),
        elsewhere="ignored",
    )
    ids: bool = svg_option(
        False, "Name paths after their colours, and group neighbouring paths of one colour.", refine=True
    )
    simple: bool = machine_option(
        False, "Outlines of fills that do not cross themselves, as those of drawings.", refine=True
    )
    separate: bool = machine_option(
        False, "A path for each connected part of a colour, with its holes.", refine=True
    )
    stack: Stack = machine_option(
        "overlap",
        "Whether shapes overlap, or each is cut where others cover it; photos are opaque then.",
        refine=True,
    )
    bridges: str = machine_option(
        "",
        "For stencils: bridges of a width, in pixels or such as 2mm, that hold what is within an outline.",
        metavar="N",
        parse=str,
        subjects=("drawing",),
    )
    symbols: bool = drawing_option(
        False, "Write equal outlines once, as symbols; nearly equal ones become equal.", subjects=("drawing",)
    )
    strokes: bool = drawing_option(
        False, "Lines of even width with round ends become strokes, but not in drafts.", **DRAWN
    )
    minify: bool = svg_option(
        False, "Write the shortest text, without line breaks and without the mark of warpsplat.", refine=True
    )
    precision: int | None = svg_option(
        None,
        "Maximum precision of coordinates, in decimals of a pixel.",
        (0, 6),
        shown_default="auto",
        refine=True,
    )
    simplify: bool = option(False)
    basis: Basis = research(
        Basis.SPLINE,
        "Basis of new shapes; Gaussians need `cubic`.",
        parse=parse_basis,
        wanted="one of cubic, spline",
        shown_default="spline",
    )
    spline_points: int = research(12, "Control points of a new spline.", (3, 64))
    chain_cubics: int = research(2, "Cubics in each of the two chains of a fill.", (1, 8))
    coarse: float = research(0.82, "Fraction of the iterations on a reduced image.", FRACTION, **TUNING)
    coarse_pixels: int = research(100_000, "Most pixels of that image.", (1, 10**9), **TUNING)
    fine_pixels: int = research(1_600_000, "Most pixels of the image in the last iterations.", (1, 10**9))
    opacity: float = research(0.98, "Opacity of a new shape, which hides what it replaces.", FRACTION)
    softness: float = research(0.6, "Least standard deviation of soft Gaussians [canvas px].", (0, 100))
    gaussian_density: float = research(0.5, "Soft Gaussians of a shape, over their usual number.", (0.05, 20))
    order: Order = research("age", "The newest shapes in front, or the smallest as in the paper.")
    loss_weight: float | None = research(
        None, "Weight of what `loss` adds to the squared error.", WEIGHT, shown_default="0.005 ssim, 3 edges"
    )
    texture: float = research(
        0.1, "Power of the local variance by which errors count less: textured areas mask them.", FRACTION
    )
    xing: float = research(0.0, "Weight of the Xing loss (paper: 0.01), which is not needed here.", WEIGHT)
    bending: float = research(
        5e-4, "Weight of the bending of cubics, which straightens burrs and loops.", WEIGHT
    )
    fold_start: float = research(
        0.2, "Weight of the area where a fill's strip folds over itself; it grows geometrically.", (1e-6, 1e6)
    )
    fold_end: float = research(3.0, "The same at the end: folds are a fault in the file.", (1e-6, 1e6))
    through_scales: bool = research(True, "Whether gradients flow through the Gaussians' scales and angles.")
    viewer: bool = research(True, "Whether the last steps see what a viewer shows, rounded.")
    tidy: bool = research(
        True,
        "Whether drawings are fitted, and lose nodes worth less than their bytes.",
        subjects=("drawing", "line"),
        elsewhere="ignored",
    )
    level_weight: float = research(0.3, "Weight of the error of each earlier level's picture.", WEIGHT)
    rates: dict[str, float] = research(
        default_rates, "Adam's rates at the start, by attribute.", WEIGHT, parse=parse_rates
    )
    beta1: float = research(0.8, "Share of Adam's first moments that a step keeps.", MOMENT)
    beta2: float = research(0.8, "The same of the second moments; equal, no step exceeds its rate.", MOMENT)
    final_rate: float = research(0.2, "Fraction of each rate that is left at the end.", FRACTION)
    density: Density = research(
        Density, "Pruning and densification.", parse=parse_density, wanted="a mapping"
    )

    def __post_init__(self) -> None:
        """Check types, ranges and contradictions, see ``check_fields``."""
        check_fields(self)
        for is_broken, *options in RULES:
            if is_broken(self):
                raise UsageError(" and ".join(options).format(self) + " cannot be combined")
        if len(self.palette) > MOST_COLOR_COUNT:
            raise UsageError(f"palette has more than {MOST_COLOR_COUNT} colours")
        if self.levels and (self.levels[0] < 1 or list(self.levels) != sorted(set(self.levels))):
            raise UsageError(f"levels must be ascending numbers of shapes, not {self.levels}")
        if self.levels and self.levels[-1] != self.curves:
            raise UsageError(f"curves {self.curves} and the last of the levels {self.levels} differ")
        for name, each in self.unsuited(self.subject):
            if each.elsewhere != "ignored":
                raise UsageError(
                    f"subject {self.subject} and {name} cannot be combined; "
                    f"{name} needs subject {' or '.join(each.subjects)}"
                )

    @property
    def form(self) -> tuple[Basis, int]:
        """The basis of new shapes, and their number of points if it is a choice."""
        if self.shape == CURVE:
            return self.basis, self.spline_points
        return FORMS.get(self.shape) or (Basis.POLYGON, int(self.shape.partition(":")[2]))

    @property
    def is_limited(self) -> bool:
        """Whether the file may have some colours only."""
        return self.colors is not None or bool(self.palette)

    @property
    def limited_by(self) -> str:
        """Name of the option that limits the colours."""
        return "palette" if self.palette else "colors"

    @property
    def removal(self) -> Removal | None:
        """Which background of an opaque image is removed, if any."""
        return self.remove_background or ("outside" if self.background == "none" else None)

    @property
    def sized_by(self) -> str:
        """Name of an option that gives the file a size on paper; empty: none."""
        options = (("size", self.size), ("page", self.page), ("dpi", self.dpi), ("units", self.units))
        return next((name for name, value in options if value), "")

    @property
    def reshapes(self) -> bool:
        """Whether outlines become others for machines, after the fit."""
        return self.simple or self.separate or self.stack == "cutout" or bool(self.bridges)

    @property
    def counting(self) -> list[str]:
        """Names of the options given, other than ``curves``, that decide the number of shapes."""
        given = (("levels", self.levels), ("target-psnr", self.target_psnr), ("max-bytes", self.max_bytes))
        return [name for name, value in (*given, ("time-budget", self.time_budget)) if value]

    @property
    def painting(self) -> Painting:
        """How fitted shapes are painted."""
        return self.paint or "flat"

    @property
    def quality(self) -> Quality:
        """The preset that these settings come from, by what only presets change."""
        matching = (
            quality
            for quality in reversed(QUALITIES)
            if all(getattr(self, name) == PRESETS[quality][name] for name in OF_PRESETS & {*PRESETS[quality]})
        )
        return next((quality for quality in matching if PRESETS[quality]), DEFAULT_QUALITY)

    def unsuited(self, subject: Subject) -> list[tuple[str, Option]]:
        """Return the options given that have no effect on a subject, each with what its user calls it."""
        if subject == "auto":
            return []
        subject = "drawing" if subject == "silhouette" else subject  # as which it is drawn
        quality, found = self.quality, []
        for each in options_of(Settings):
            value = getattr(self, each.field)
            by_quality = value in [preset[each.field] for preset in PRESETS.values() if each.field in preset]
            is_given = value != each.default and not by_quality
            if each.subjects and subject not in each.subjects and is_given:
                found.append((self._called(each), each))
        if self.is_limited or self.stack == "cutout":  # implies it
            found = [(name, each) for name, each in found if each.field != "opaque"]
        changed = [each for each in options_of(Settings) if each.field in OF_PRESETS & {*PRESETS[quality]}]
        if changed and not any(subject in each.subjects for each in changed):
            found.append((f"quality {quality}", changed[0]))
        return found

    def _called(self, option: Option) -> str:
        """Return an option given as its user names it."""
        value = getattr(self, option.field)
        if option.field == "levels" and value == levels_of(self.curves):
            return "layered"
        of_value = [shorthand.name for shorthand in option.shorthands if shorthand.value == value]
        return of_value[0] if of_value else f"{option.name} {value}" if option.type is str else option.name

    def fingerprint(self) -> str:
        """Return a short hash of all that decides the result; a new option, not used, does not change it."""
        default = asdict(Settings())
        given = {name: value for name, value in asdict(self).items() if value != default[name]}
        return hashlib.sha256(json.dumps(given, sort_keys=True).encode()).hexdigest()[:16]


RULES: tuple[tuple[Callable[[Settings], object], str, str], ...] = (
    (lambda s: s.mixed and s.kind == Kind.STROKE, "mixed", "open"),
    (lambda s: s.mixed and s.shape != CURVE, "mixed", "shape {0.shape}"),
    (lambda s: s.shape not in (CURVE, LINE) and s.kind == Kind.STROKE, "shape {0.shape}", "open"),
    (lambda s: s.shape == LINE and s.kind == Kind.FILL, "shape line", "closed"),
    (lambda s: s.shape != CURVE and s.renderer != "exact", "shape {0.shape}", "renderer {0.renderer}"),
    (lambda s: s.painting != "flat" and s.is_limited, "paint {0.paint}", "{0.limited_by}"),
    (lambda s: s.levels and s.counting[1:], "levels", "{0.counting[1]}"),
    (lambda s: s.size and s.page, "size", "page"),
    (lambda s: s.dpi and (s.size or s.page), "dpi", "{0.sized_by}"),
    (lambda s: s.dpi and s.units == "px", "dpi", "units px"),
)
"""Contradictions: whether settings, ``{0}``, have one, and two options that cannot be combined. Those with a
subject follow from ``Option.subjects``, those with a renderer from ``FitRenderer.check``."""


def solid_color(background: str) -> FloatArray | None:
    """Return the colour that ``Settings.background`` names, sRGB in [0, 1], shape (3,); None if none."""
    color = color_of(background)
    if color is None:
        return None
    return np.frombuffer(bytes.fromhex(color[1:]), np.uint8).astype(np.float32) / np.float32(255)


def levels_of(curves: int) -> tuple[int, ...]:
    """Return up to three levels, the last with all the ``curves``."""
    levels = [curves // LEVEL_FACTOR**2, curves // LEVEL_FACTOR, curves]
    return tuple(count for count in levels if count >= LEAST_LEVEL_SHAPES or count == curves)


def make_settings(quality: Quality = DEFAULT_QUALITY, **options: Any) -> Settings:
    """Return the preset ``quality`` with ``options`` on top; those that are None are left out.

    Without ``curves`` among them, a simple image gets fewer than the default.

    Raises:
        UsageError: an unknown name, a value out of range, or options that contradict each other.
    """
    known = {each.keyword: each for made in options_of(Settings) for each in (made, *made.shorthands)}
    given: dict[str, Any] = {}
    for name, value in {"quality": quality, **options}.items():
        if value is None:
            continue
        if name not in known:
            raise UsageError(f"unknown setting {shown(name)}{nearest(name, known)}")
        given[name] = known[name].parsed(value)
    expand(given)
    preset = preset_for(given.pop("quality", DEFAULT_QUALITY), given)
    settings = replace(preset, **{**given, "rates": preset.rates})
    if settings.renderer != "exact":
        load_renderer(settings.renderer).check(settings)
    if settings.sized_by or settings.width or settings.bridges:
        from warpsplat.svg.page import checked_unit, length_of, sheet_for  # brings what writes files

        checked_unit(settings.units)
        if settings.size or settings.page:
            sheet_for(settings.size, settings.page, settings.units, 1, 1)
        for name, length in (("width", settings.width), ("bridges", settings.bridges)):
            if length:
                length_of(length, name)
    return settings


def expand(given: dict[str, Any]) -> None:
    """Replace shorthands among the ``given`` options by what they stand for, and add what options require."""
    closed, is_open = given.pop("closed", None), given.pop("open", None)
    if closed and is_open:
        raise UsageError("closed and open cannot be combined; mixed has both fills and strokes")
    if closed or is_open or closed is False:
        given["kind"] = Kind.FILL if closed else Kind.STROKE
    if given.get("shape") == LINE:
        given.setdefault("kind", Kind.STROKE)
    if given.pop("layered", False):
        given.setdefault("levels", levels_of(given.get("curves", Settings.curves)))
    if given.get("levels"):  # the last of them is the whole
        given.setdefault("curves", given["levels"][-1])
    if given.get("colors") or given.get("palette"):  # what shines through would make further colours
        given["opaque"] = True
    if given.get("stack") == "cutout":  # what is below shows through no more
        given["opaque"] = True


def preset_for(quality: Quality, given: Mapping[str, Any]) -> Settings:
    """Return the defaults that suit the ``given`` options, and all rates."""
    preset = Settings(simplify="curves" not in given, **PRESETS[quality])
    rates = dict(preset.rates)
    renderer = given.get("renderer", "exact")
    # Most pixels of the image in the last iterations for each shape of a form: more show nothing new.
    form_pixels = 8000
    if renderer != "exact":
        preset = load_renderer(renderer).preset(preset)
    elif given.get("shape", CURVE) != CURVE:
        rates["points"] = FORM_POINT_RATE
        density = replace(preset.density, surplus=FORM_SURPLUS)
        preset = replace(preset, texture=0.0, density=density)
        curves = given.get("curves")
        if isinstance(curves, int):  # else none, or refused later
            fine = max(preset.coarse_pixels, form_pixels * curves)
            preset = replace(preset, fine_pixels=min(preset.fine_pixels, fine))
    elif given.get("kind", Kind.FILL) == Kind.FILL:
        rates["points"] = FILL_POINT_RATE
    if given.get("opaque"):
        rates["opacities"] = 0.0
    if given.get("paint", "flat") != "flat":  # colours and frames can do the same for fewer bytes
        rates |= {"stop_opacities": 0.0, "stop_offsets": 0.0}
    rates |= given.get("rates", {})
    if given.get("colors") or given.get("palette"):  # colours are chosen, not trained
        rates["colors"] = 0.0
    return replace(preset, rates=rates)
