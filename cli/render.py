"""``warpsplat render``."""

from __future__ import annotations

from pathlib import Path

import click

from warpsplat.errors import ImageError, UsageError


@click.command("render", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("svg", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="PNG to write.")
@click.option("--scale", type=float, default=1.0, show_default=True, help="Magnification.")
def command(svg: Path, output: Path, scale: float) -> None:
    """Render SVG (any, not only ours) to a PNG, as a viewer shows it."""
    import io
    import math

    from warpsplat.files import check_output, write_atomically
    from warpsplat.inspect_svg import read_svg_text
    from warpsplat.viewer import render_svg, svg_size

    text = read_svg_text(svg)
    check_output(output, svg)
    if not (math.isfinite(scale) and scale > 0):
        raise UsageError(f"scale must be a positive number, not {scale}")
    width, height = svg_size(text, svg)
    if width * height > MAX_PIXELS:
        raise ImageError(f"{svg}: is {width}x{height} pixels, more than {MAX_PIXELS // 1_000_000} million")
    if width * scale * height * scale > MAX_PIXELS:
        raise UsageError(f"scale {scale} makes more than {MAX_PIXELS // 1_000_000} million pixels")
    if min(width, height) * scale < 0.5:
        raise UsageError(f"scale {scale} leaves no pixel of {width}x{height}")
    try:
        image = render_svg(text, zoom=scale)
    except ImageError as error:
        raise ImageError(f"{svg}: {error}") from error
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    write_atomically(output, buffer.getvalue())


MAX_PIXELS = 400_000_000
"""Largest picture [pixels]; four bytes each."""
