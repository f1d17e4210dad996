"""What is done with an image for what it shows."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

import warpsplat
from tests.drawing.drawings import vectorized
from tests.drawing.trace.drawings import draw, ground
from tests.drawing.trace.line_art import drawn
from tests.runs import scored
from warpsplat.drawing.picture import LEAST_ORIGINAL_SIDE, Picture
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.settings import Painting, make_settings
from warpsplat.metrics import score_svg
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import render_svg

DRAWING = (
    '<circle cx="50" cy="50" r="31" fill="#06c" stroke="none"/>'
    '<path d="M4 92L40 60L90 96z" fill="#fc0" stroke="none"/>'
)


def repeated(image: FloatArray, times: int) -> FloatArray:
    return np.repeat(np.repeat(image, times, axis=0), times, axis=1)


def test_repeated_pixels_are_reduced_before_tracing(device: str) -> None:
    """The large file shows what the small one does, without the steps of the pixels."""
    small = drawn(DRAWING, 100, 100)
    large = vectorized(repeated(small, 3), device)
    assert {'width="300"', 'height="300"'} <= set(large.svg.partition(">")[0].split())
    assert (large.scene.canvas.width, large.scene.canvas.height) == (300, 300)
    plain = vectorized(small, device)
    assert score_svg(large.svg, small, perceptual=False).psnr >= scored(plain).psnr - 0.5
    assert large.scene.points.shape == plain.scene.points.shape


@pytest.mark.parametrize(
    ("side", "times", "found"),
    [
        (LEAST_ORIGINAL_SIDE, 2, 2),
        (LEAST_ORIGINAL_SIDE - 1, 2, 1),
        (LEAST_ORIGINAL_SIDE // 2, 6, 3),
        (20, 1, 1),
    ],
)
def test_enlargement_leaves_a_picture_to_trace(side: int, times: int, found: int) -> None:
    noise = np.random.default_rng(0).random((side, side + 1, 3)).astype(np.float32)
    assert (Picture.of(repeated(noise, times)).enlargement == found).all()


@pytest.mark.parametrize("given", [{"colors": 2}, {"palette": "#06c,#fc0"}])
def test_translucent_paint_is_left_out_with_few_colors(device: str, given: dict[str, object]) -> None:
    """A soft shadow, as regions and as a ramp: what is less than half there is left out."""
    shadow = (
        '<linearGradient id="s"><stop stop-opacity=".5"/><stop offset="1" stop-opacity="0"/></linearGradient>'
    )
    body = f'{shadow}<rect x="30" y="6" width="26" height="50" fill="url(#s)"/>'
    body += '<rect x="8" y="48" width="22" height="10" fill-opacity=".3"/>'
    body += (
        '<rect x="6" y="6" width="26" height="42" fill="#06c"/><circle cx="18" cy="24" r="8" fill="#fc0"/>'
    )
    result = vectorized(draw(body, 64, 64), device, **given)
    shown = np.asarray(render_svg(result.svg))
    assert shown[8:46, 8:30, 3].min() == 255, "what is opaque is there"
    assert shown[:, 36:, 3].max() == shown[51:, :, 3].max() == 0
    assert "opacity" not in result.svg


def test_a_gradient_has_the_opacity_of_its_stops_alone() -> None:
    body = '<linearGradient id="s"><stop stop-color="#c00"/><stop offset="1" stop-color="#c00" '
    body += 'stop-opacity=".2"/></linearGradient><rect x="6" y="6" width="52" height="52" fill="url(#s)"/>'
    image = draw(body, 64, 64)
    assert np.abs(render(trace(image).scene)[8:56, 8:56] - image[8:56, 8:56]).max() < 0.02


@pytest.mark.parametrize("placing", [{"size": "50x40mm"}, {"page": "a4"}, {"units": "in"}, {}])
def test_figures_are_of_the_file_that_is_delivered(
    tmp_path: Path, device: str, placing: dict[str, str]
) -> None:
    output = tmp_path / "out.svg"
    image = drawn('<circle cx="16" cy="16" r="9" fill="#06c" stroke="none"/>', 32, 32)
    settings = make_settings(subject="drawing", **placing)
    result = warpsplat.vectorize(
        (255 * image).astype(np.uint8), settings=settings, device=device, output=output
    )
    data = output.read_bytes()
    assert (result.svg.encode(), scored(result).bytes) == (data, len(data))
    assert scored(result).gzip_bytes == len(gzip.compress(data, 9, mtime=0))


SHADED = (
    '<linearGradient id="a"><stop stop-color="#f40"/><stop offset="1" stop-color="#fd0"/></linearGradient>'
    '<radialGradient id="b"><stop stop-color="#fff"/><stop offset="1" stop-color="#06c"/></radialGradient>'
)
IMAGE = np.round(
    255
    * draw(
        f'{ground("#fff")}{SHADED}<rect x="6" y="6" width="84" height="36" fill="url(#a)"/>'
        '<circle cx="48" cy="68" r="22" fill="url(#b)"/>'
    )[..., :3]
).astype(np.uint8)


def made(paint: Painting | None) -> warpsplat.Result:
    return warpsplat.vectorize(IMAGE, quality="draft", subject="drawing", paint=paint)


@pytest.mark.parametrize(
    ("paint", "kinds"),
    [("flat", ()), ("linear", ("linear",)), ("radial", ("radial",)), ("auto", ("linear", "radial"))],
)
def test_only_allowed_gradients_are_used(paint: Painting, kinds: tuple[str, ...]) -> None:
    result = made(paint)
    assert not [note for note in result.notes if "paint" in note]
    assert [kind for kind in ("linear", "radial") if f"<{kind}Gradient" in result.svg] == [*kinds]


def test_shading_becomes_bands_where_gradients_are_not_allowed() -> None:
    flat, usual = made("flat"), made("auto")
    assert len(flat.scene) > len(usual.scene)
    assert flat.score and flat.score.psnr > 25
    assert made(None).svg == usual.svg
