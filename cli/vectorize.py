"""``warpsplat vectorize``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.options import quality_options, run_options, settings_from
from warpsplat.errors import ImageError


def summary(output: Path, values: dict[str, Any]) -> str:
    """One line on the result, for people."""
    ssim = "" if values["ssim"] is None else f", SSIM {values['ssim']:.3f}"
    ssim += "" if values["ms_ssim"] is None else f", MS-SSIM {values['ms_ssim']:.3f}"
    psnr = "exact" if values["psnr"] is None else f"{values['psnr']:.2f} dB"
    note = f", stopped after {values['iterations']} iterations" if values["stopped"] else ""
    return (
        f"{output}: {psnr}{ssim}, {values['paths']} paths, {values['nodes']} nodes, "
        f"{values['bytes'] / 1000:.1f} kB ({values['gzip_bytes'] / 1000:.1f} kB gzipped), "
        f"{values['seconds']:.1f} s{note}"
    )


@click.command("vectorize", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("image", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="SVG to write.  [default: IMAGE with .svg, here]"
)
@quality_options
@run_options
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
def command(
    image: Path,
    output: Path | None,
    device: str,
    threads: int | None,
    verbose: int,
    quiet: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """Turn IMAGE into an SVG and say how good the file is.

    The figures are those of the file as a viewer shows it: PSNR and SSIM
    against the image, number of paths, size.
    """
    settings = settings_from(given)
    if not image.name or image.is_dir():
        raise ImageError(f"{image}: is a folder, not an image")
    output = output or Path(image.name).with_suffix(".svg")
    if not image.exists():
        raise ImageError(f"{image}: no such file")
    from warpsplat.files import check_output

    check_output(output, image)
    from warpsplat.cli.run import leave, run_file
    from warpsplat.device import choose_device, start_warp

    start_warp()
    result = run_file(
        image, output, settings, choose_device(device), threads=threads, verbose=verbose, quiet=quiet
    )
    values = {"image": str(image), "output": str(output), "device": device, **result.as_dict()}
    if as_json:
        click.echo(json.dumps(values))
    elif not quiet:
        click.echo(summary(output, values))
    leave(result)
