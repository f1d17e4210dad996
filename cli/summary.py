"""A result in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from warpsplat.errors import printable
from warpsplat.extensions import load_renderer


def summary(output: Path, values: dict[str, Any]) -> str:
    """Return one line about a result."""
    from warpsplat.run.formats import PICTURE_ENDINGS

    name = "standard output" if str(output) == "-" else printable(str(output))
    note = f", stopped after {values['iterations']} iterations" if values["stopped"] else ""
    picture = " as an SVG" if output.suffix.lower() in PICTURE_ENDINGS else ""
    if values["paths"] is None:
        size = f"{values['bytes'] / 1000:.1f} kB{picture}"
        return f"{name}: figures not measured, {size}, {values['seconds']:.1f} s{note}"
    ssim = "" if values["ssim"] is None else f", SSIM {values['ssim']:.3f}"
    ssim += "" if values["ms_ssim"] is None else f", MS-SSIM {values['ms_ssim']:.3f}"
    ssim += "" if values["ssimulacra2"] is None else f", SSIMULACRA2 {values['ssimulacra2']:.1f}"
    psnr = "exact" if values["psnr"] is None else f"{values['psnr']:.2f} dB"
    if load_renderer(values["renderer"]).soft:
        psnr = f"the soft render {values['render_psnr']:.2f} dB, the file {psnr}"
    levels = ", ".join(_level(level) for level in values["levels"][:-1])
    note += f"; the first {levels}" if levels else ""
    return (
        f"{name}: {psnr}{ssim}, {values['paths']} paths, {values['nodes']} nodes, "
        f"{values['bytes'] / 1000:.1f} kB ({values['gzip_bytes'] / 1000:.1f} kB gzipped){picture}, "
        f"{values['seconds']:.1f} s{note}"
    )


def _level(level: dict[str, Any]) -> str:
    """Return the PSNR of a layered file up to a level."""
    return f"{level['shapes']} shapes " + ("exact" if level["psnr"] is None else f"{level['psnr']:.2f} dB")
