"""Images with opacity, and the background of the file."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests.runs import scored
from warpsplat.files.sources import image_of
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import score_svg
from warpsplat.run.prepare import load_target
from warpsplat.run.result import Result
from warpsplat.svg.viewer import render_own


def badge(opaque: bool = False) -> bytes:
    """A white ring on nothing, or on a grey that no default is."""
    y, x = np.mgrid[:48, :48] + 0.5
    distance = np.hypot(x - 24, y - 24)
    alpha = np.clip(18 - distance, 0, 1) * np.clip(distance - 8, 0, 1)
    pixels = np.full((48, 48, 4), 255, np.uint8)
    pixels[..., 3] = np.round(255 * alpha)
    if opaque:
        pixels[..., :3] = np.round(100 + 155 * alpha)[..., None]
        pixels[..., 3] = 255
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG")
    return out.getvalue()


def made(tmp_path: Path, device: str, source: bytes, **settings: object) -> tuple[Result, str]:
    output = tmp_path / "o.svg"
    chosen = make_settings(curves=12, iterations=200, **settings)
    return warpsplat.vectorize(source, settings=chosen, device=device, output=output), output.read_text()


@pytest.mark.slow
def test_a_transparent_image_makes_a_transparent_file(tmp_path: Path, device: str) -> None:
    result, text = made(tmp_path, device, badge())
    assert "<rect" not in text
    shown = np.asarray(render_own(text).convert("RGBA"))
    wanted = image_of(badge())
    empty = wanted[..., 3] == 0
    assert not shown[:4][empty[:4]].any(), "far from what is drawn"
    assert (shown[..., 3][empty] > 0).mean() < 0.03, "and but for a few pixels beside it"
    assert scored(result).psnr > 22
    # White on white tells nothing: the figure is that on black.
    on_white = score_svg(text, image_of(badge(), paper=1.0)).psnr
    assert scored(result).psnr < on_white


@pytest.mark.slow
def test_backgrounds_that_are_asked_for(tmp_path: Path, device: str) -> None:
    _, text = made(tmp_path, device, badge(), background="#204060")
    corner = np.asarray(render_own(text).convert("RGBA"))[0, 0]
    assert corner.tolist() == [0x20, 0x40, 0x60, 255]
    _, text = made(tmp_path, device, badge(opaque=True))
    assert '<rect width="' in text


def test_images_as_a_background_asks_for_them() -> None:
    clear = load_target(badge(), "x", "auto")
    assert clear.shape == (48, 48, 4)
    np.testing.assert_array_equal(clear, load_target(badge(), "x", "none"))
    assert (clear[..., :3] <= clear[..., 3:]).all(), "premultiplied"
    np.testing.assert_allclose(load_target(badge(), "x", "#ff8000")[0, 0], [1, 128 / 255, 0])
    assert load_target(badge(opaque=True), "x", "auto").shape == (48, 48, 3)
    assert (load_target(badge(opaque=True), "x", "none")[..., 3] == 1).all()
