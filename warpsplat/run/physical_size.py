"""The size of a file in millimetres or on a sheet of paper, and its size in bytes."""

from __future__ import annotations

from dataclasses import dataclass, replace

from warpsplat.errors import counted
from warpsplat.fit.export import finished, for_machines
from warpsplat.fit.settings import Settings
from warpsplat.run.prepare import PreparedImage
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.bridges import hole_widths
from warpsplat.scene.geometry import most_seen
from warpsplat.svg.page import (
    MILLIMETRES,
    PIXELS_AN_INCH,
    Sheet,
    length_of,
    natural_sheet,
    on_sheet,
    sheet_for,
    with_own_size,
)
from warpsplat.svg.write import on_background


@dataclass(frozen=True)
class PhysicalSize:
    """The sheet of paper that a file is drawn on, or the size of the picture alone."""

    settings: Settings
    size: tuple[int, int]
    """Width and height of the image [px]."""
    resolution: tuple[float, float]
    """Pixels an inch along x and y, for the picture's own size."""
    where_from: str
    """Where that is from, for people."""

    def given_to(self, svg: str) -> str:
        """Return a file that this program wrote with the size that the settings ask for, if any."""
        settings = self.settings
        if settings.size or settings.page:
            return on_sheet(svg, self.sheet)
        return with_own_size(svg, self.sheet) if settings.sized_by else svg

    def notes(self) -> tuple[str, ...]:
        """Return which size the picture has by its resolution, if that decides it."""
        settings = self.settings
        if settings.sized_by not in {"dpi", "units"} or settings.units == "px":
            return ()
        size = "x".join(self.sheet.lengths()) + f" {self.sheet.unit}"
        x, y = (f"{each:.5g}" for each in self.resolution)
        return (f"{size}: {x if x == y else f'{x} and {y}'} pixels per inch, {self.where_from}",)

    @property
    def sheet(self) -> Sheet:
        """The sheet of the settings, or one of the picture's own size."""
        settings = self.settings
        if settings.size or settings.page:
            return sheet_for(settings.size, settings.page, settings.units, *self.size)
        return natural_sheet(*self.size, self.resolution, settings.units)


def physical_size(image: PreparedImage, settings: Settings) -> PhysicalSize:
    """Return the size of the file of an image."""
    resolution, where_from = (PIXELS_AN_INCH, PIXELS_AN_INCH), "as the image file states none; --dpi gives it"
    if settings.dpi:
        resolution, where_from = (settings.dpi, settings.dpi), "by --dpi"
    elif image.resolution:
        resolution, where_from = image.resolution, "by the image file"
    return PhysicalSize(settings, image.size, resolution, where_from)


def with_pixels(image: PreparedImage) -> PreparedImage:
    """Return an image whose settings have the width of strokes, and that of bridges, in pixels.

    Strokes are made in the pixels that are processed, bridges in those of the file.
    """
    settings, processed = image.problem.settings, image.problem.size[0] / image.size[0]
    width, bridges = (_pixels(image, name) for name in ("width", "bridges"))
    settings = replace(settings, width=width and f"{float(width) * processed:.9g}", bridges=bridges)
    return replace(image, problem=replace(image.problem, settings=settings))


def _pixels(image: PreparedImage, name: str) -> str:
    """Return a length among the settings in pixels of the image, empty if there is none."""
    settings = image.problem.settings
    text = getattr(settings, name)
    if not text:
        return ""
    length, unit = length_of(text, name)
    if unit:
        length *= MILLIMETRES[unit] * physical_size(image, settings).sheet.scale(*image.size)
    return f"{length:.9g}"


def on_removed(svg: str, scene: Scene, settings: Settings, per_pixel: float, background: FloatArray) -> str:
    """Return the SVG of ``export_within`` on the background that was removed, sRGB in [0, 1], shape (3,)."""
    if scene.canvas.background is not None:  # another one, which machines may have as a path
        bare = replace(scene, canvas=replace(scene.canvas, background=None))
        svg = finished(for_machines(bare, settings, per_pixel), settings, per_pixel)
    return on_background(svg, background)


def bridge_notes(scene: Scene, settings: Settings, per_pixel: float) -> tuple[str, ...]:
    """Return the note that bridges are too wide for what they hold, if they are."""
    if not settings.bridges:
        return ()
    cut = for_machines(scene, replace(settings, bridges="", separate=False), per_pixel)
    holes, width = hole_widths(cut, per_pixel), float(settings.bridges)
    narrow = sum(each < width for each in holes)
    held = f"{narrow} of the {counted(len(holes), 'part')} that they hold"
    return (f"bridges are wider than {held}; narrower ones leave more of the picture",) if narrow else ()


def export_within(
    scene: Scene, settings: Settings, per_pixel: float, metadata: str, physical: PhysicalSize
) -> tuple[str, Scene]:
    """Return the SVG without its physical size, and its shapes: those that show most within ``max_bytes``."""

    def made() -> tuple[str, int]:
        text = finished(for_machines(scene, settings, per_pixel), settings, per_pixel, metadata)
        return text, len(physical.given_to(text).encode())

    svg, size = made()
    while settings.max_bytes and size > settings.max_bytes and len(scene) > 1:
        excess = 1 - settings.max_bytes / size
        count = min(max(1, round(excess * len(scene))), len(scene) - 1)
        scene = most_seen(scene, len(scene) - count)
        svg, size = made()
    return svg, scene
