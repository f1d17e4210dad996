"""The paper's two renderers, as a fit uses them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.cli.helpers import one_line, run
from tests.fit.pictures import picture
from tests.runs import vectorize
from tests.scenes import random_scene
from warpsplat.cli.run import summary
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.run.figures import render_figures
from warpsplat.scene import Kind
from warpsplat.svg.write import write_svg


def test_paper_options_run(device: str) -> None:
    settings = make_settings(
        kind=Kind.STROKE,
        renderer="splat",
        curves=8,
        iterations=30,
        order="area",
        through_scales=False,
    )
    result = vectorize(picture(), settings, Backend.on(device))
    assert result.score
    assert len(result.scene) == 8
    assert result.score.paths == 8


@pytest.mark.parametrize("kind", list(Kind))
def test_soft_gaussians_have_two_figures(device: str, kind: Kind) -> None:
    """That of their own render, which the scene gives again, and that of the file."""
    settings = make_settings(curves=60, iterations=60, renderer="gaussian", kind=kind)
    result = vectorize(picture(), settings, Backend.on(device))
    assert result.score
    assert result.score.paths == 60
    values = result.as_dict()
    assert (values["renderer"], values["psnr"]) == ("gaussian", round(result.score.psnr, 3))
    again = render_figures(result.scene, picture(), settings, Backend.on(device))
    assert (result.render_psnr, result.render_ssim) == again
    assert result.render_psnr > 24
    assert result.render_psnr > result.score.psnr > 14
    reduced = vectorize(picture(), replace(settings, fine_pixels=500, iterations=3), Backend.on(device))
    assert reduced.render_ssim is None, "an image that is larger than what was trained on"
    said = summary(Path("a.svg"), values)
    assert f"the soft render {values['render_psnr']:.2f} dB, the file {values['psnr']:.2f} dB" in said


def test_figures_of_the_render_and_of_the_file_have_their_own_names(device: str) -> None:
    """The render is of splats; the file has paths, as every viewer shows them."""
    settings = make_settings(curves=30, iterations=40, renderer="splat")
    result = vectorize(picture(), settings, Backend.on(device))
    values = result.as_dict()
    assert values["psnr"] == round(score_svg(result.svg, picture(), perceptual=False).psnr, 3)
    # After its last step the numbers are rounded for the file: 0.01 to 0.04 dB over five seeds.
    splats, _ = render_figures(result.scene, picture(), settings, Backend.on(device))
    assert values["render_psnr"] == pytest.approx(splats, abs=0.2)
    assert values["estimated_psnr"] == round(result.estimated_psnr, 3)


def test_soft_gaussians_are_in_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_text(write_svg(random_scene(Kind.FILL)))
    assert run("render", svg, "-o", png, "--renderer", "gaussian") == 2
    assert "vectorize --renderer gaussian" in one_line(capsys.readouterr().err)
    assert not png.exists()
