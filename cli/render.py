"""``warpsplat render``."""

from __future__ import annotations

from pathlib import Path

import click

from warpsplat.errors import ImageError, UsageError


@click.command("render", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("svg", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, allow_dash=True),
    required=True,
    help="PNG to write, - for the standard output.",
)
@click.option("--scale", type=float, default=1.0, show_default=True, help="Magnification.")
def command(svg: Path, output: Path, scale: float) -> None:
    """Render SVG (any, not only ours; - for the standard input) to a PNG, as a viewer shows it."""
    import math
    import sys

    from warpsplat.files import check_output, write_atomically
    from warpsplat.inputs import STANDARD, input_name
    from warpsplat.inspect_svg import MAX_PIXELS, inspect_svg, read_svg_text, svg_size
    from warpsplat.viewer import draw_png

    if not (math.isfinite(scale) and scale > 0):
        raise UsageError(f"scale must be a positive number, not {scale}")
    if output != STANDARD:
        if output.suffix.lower() != ".png":
            raise UsageError(f"{output}: a PNG is written; give a name that ends in .png")
        check_output(output, svg)
    text = read_svg_text(svg)
    try:
        size = svg_size(inspect_svg(text).root)
        if size and max(size[0], 1.0) * scale * max(size[1], 1.0) * scale > MAX_PIXELS:
            raise UsageError(f"scale {scale} makes more than {MAX_PIXELS // 1_000_000} million pixels")
        if size and min(max(1.0, side) for side in size) * scale < 0.5:
            raise UsageError(f"scale {scale} leaves no pixel of {size[0]:g}x{size[1]:g}")
        png = draw_png(text, zoom=scale)
    except ImageError as error:
        raise ImageError(f"{input_name(svg)}: {error}") from error
    if output == STANDARD:
        sys.stdout.buffer.write(png)
    else:
        write_atomically(output, png)
