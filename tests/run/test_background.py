"""Images with opacity, and files without the background of their images."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests.drawing.trace.line_art import drawn
from tests.runs import scored
from warpsplat.errors import UsageError
from warpsplat.files.sources import image_of
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import score_svg
from warpsplat.run.prepare import load_target
from warpsplat.run.result import Result
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import render_own

RING = (
    '<circle cx="32" cy="32" r="26" fill="#c22" stroke="none"/><circle cx="32" cy="32" r="16" fill="#fff" '
    'stroke="none"/><circle cx="32" cy="32" r="8" fill="#146" stroke="none"/>'
)
"""A ring with a hole, in which a disc lies, on white."""


def made(image: object, subject: str, **options: Any) -> Result:
    return warpsplat.vectorize(image, subject=subject, device="cpu", **options)


def opacity(result: Result) -> FloatArray:
    shown = np.asarray(render_own(result.svg).convert("RGBA"))[..., 3] / 255
    return shown.astype(np.float32)


def distances() -> FloatArray:
    y, x = np.mgrid[:64, :64].astype(np.float32) + np.float32(0.5)
    return np.asarray(np.sqrt(np.square(x - 32) + np.square(y - 32)), np.float32)


@pytest.mark.parametrize("quality", ["draft", "balanced"])
@pytest.mark.parametrize("removal", ["outside", "everywhere"])
def test_drawings(removal: str, quality: str) -> None:
    """Nothing lies in the holes, below other shapes, or beyond the outlines."""
    image, away = drawn(RING, 64, 64), distances()
    result = made(image, "drawing", remove_background=removal, quality=quality)
    shown = opacity(result)
    assert (shown[away > 27] == 0).all()
    assert (shown[away < 25] == 1).all() == (removal == "outside")
    hole = shown[(away > 9) & (away < 15)]
    assert (hole == (removal == "outside")).all()
    whole = made(image, "drawing", quality=quality)
    assert scored(result).psnr > scored(whole).psnr - 1, "measured on its background"
    assert "#fff, was removed" in result.notes[-1]
    assert result.scene.canvas.background is None
    assert scored(result).bytes == len(result.svg.encode())


def test_edges_have_nothing_of_the_background() -> None:
    """Over black, a ring is nowhere brighter than its colour."""
    result = made(drawn(RING, 64, 64), "drawing", remove_background="everywhere")
    on_black = np.asarray(render_own(result.svg).convert("RGBA"), np.float32)
    premultiplied = on_black[..., :3] * on_black[..., 3:] / 255
    assert (premultiplied <= (0xCC + 1, 0x44 + 1, 0x66 + 1)).all()


def test_none_is_a_background_that_is_removed_outside() -> None:
    image = drawn(RING, 64, 64)
    assert made(image, "drawing", background="none") == made(image, "drawing", remove_background="outside")


def test_a_background_in_place_of_the_removed_one() -> None:
    result = made(drawn(RING, 64, 64), "drawing", remove_background="everywhere", background="#8cf")
    shown = np.asarray(render_own(result.svg).convert("RGB"))
    assert shown[0, 0].tolist() == shown[32, 20].tolist() == [0x88, 0xCC, 0xFF]


@pytest.mark.parametrize(
    "options", [{"background": "#8cf"}, {"stack": "cutout"}, {"background": "#8cf", "stack": "cutout"}]
)
def test_figures_are_those_on_the_background(options: dict[str, Any]) -> None:
    image = drawn(RING, 64, 64)
    plain, other = (made(image, "drawing", remove_background="everywhere", **o) for o in ({}, options))
    assert abs(scored(other).psnr - scored(plain).psnr) < 1.5


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_a_palette_is_not_for_a_background_that_is_left_out(quality: str) -> None:
    """White in black only would be black on black, whose edges could be anywhere."""
    options = {"remove_background": "everywhere", "quality": quality}
    plain, black = (made(drawn(RING, 64, 64), "drawing", **options, **o) for o in ({}, {"palette": "#000"}))
    assert "#fff, was removed" in black.notes[-1]
    assert (
        np.abs(opacity(black) - opacity(plain)).mean() < 0.08
    )  # 0.023 where edges fit other colours, 0.29 if any will do


@pytest.mark.parametrize(("width", "noted"), [("2", False), ("40", True)])
def test_bridges_wider_than_their_parts_are_reported(width: str, noted: bool) -> None:
    result = made(drawn(RING, 64, 64), "drawing", quality="draft", bridges=width)
    assert any("left out, as stencils have none" in note for note in result.notes)
    assert ("bridges are wider than 1 of the 1 part" in result.notes[-1]) == noted


@pytest.mark.parametrize("removal", ["outside", "everywhere"])
def test_pixel_art_is_exact(removal: str) -> None:
    cells = np.full((9, 11, 3), 255, np.uint8)
    cells[2:7, 2:8] = (0, 0, 90)
    cells[3:5, 3:6] = 255
    cells[6, 3] = (200, 0, 0)
    cells[0:2, 9:] = (0, 140, 0)
    shown = opacity(made(np.repeat(np.repeat(cells, 4, 0), 4, 1), "pixel", remove_background=removal))
    wanted = (cells != 255).any(axis=2)
    if removal == "outside":
        wanted[3:5, 3:6] = True
    np.testing.assert_array_equal(shown[::4, ::4], wanted)


def test_lines_have_no_paper() -> None:
    image = drawn('<path d="M6 10L40 50L58 12" fill="none" stroke="#000" stroke-width="3"/>', 64, 64)
    result = made(image, "line", background="none", iterations=5)
    assert opacity(result)[0, 0] == 0
    assert scored(result).psnr > 20


@pytest.mark.slow
def test_photographs() -> None:
    """Shapes are fitted to what is left, whose edges have the colours inside."""
    away = distances()[..., None]
    light = np.linspace(0.75, 0.9, 64)[:, None, None]
    disc = np.clip(20 - away, 0, 1)
    image = light * (1 - disc) + np.array([0.7, 0.2, 0.1]) * disc
    result = made(image.astype(np.float32), "photo", remove_background="outside", curves=8, iterations=60)
    shown = opacity(result)
    assert shown[distances() < 18].mean() > 0.95
    assert shown[distances() > 22].mean() < 0.02
    assert "background was removed" in result.notes[-1]


def test_transparent_images_have_none() -> None:
    image = np.zeros((32, 32, 4), np.uint8)
    image[8:20, 8:20] = (200, 0, 0, 255)
    result = made(image, "drawing", remove_background="everywhere")
    assert "no background was removed" in result.notes[-1]
    assert not any("no background" in note for note in made(image, "drawing", background="none").notes)


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


def fitted(tmp_path: Path, device: str, source: bytes, **settings: object) -> tuple[Result, str]:
    output = tmp_path / "o.svg"
    chosen = make_settings(curves=12, iterations=200, **settings)
    return warpsplat.vectorize(source, settings=chosen, device=device, output=output), output.read_text()


@pytest.mark.slow
def test_a_transparent_image_makes_a_transparent_file(tmp_path: Path, device: str) -> None:
    result, text = fitted(tmp_path, device, badge())
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
    _, text = fitted(tmp_path, device, badge(), background="#204060")
    corner = np.asarray(render_own(text).convert("RGBA"))[0, 0]
    assert corner.tolist() == [0x20, 0x40, 0x60, 255]
    _, text = fitted(tmp_path, device, badge(opaque=True))
    assert '<rect width="' in text


def test_images_as_a_background_asks_for_them() -> None:
    clear = load_target(badge(), "x", "auto")
    assert clear.shape == (48, 48, 4)
    np.testing.assert_array_equal(clear, load_target(badge(), "x", "none"))
    assert (clear[..., :3] <= clear[..., 3:]).all(), "premultiplied"
    np.testing.assert_allclose(load_target(badge(), "x", "#ff8000")[0, 0], [1, 128 / 255, 0])
    assert load_target(badge(opaque=True), "x", "auto").shape == (48, 48, 3)
    assert (load_target(badge(opaque=True), "x", "none")[..., 3] == 1).all()


def test_unknown_ways_of_removal_are_refused() -> None:
    with pytest.raises(UsageError, match="remove-background must be one of outside, everywhere, not 'all'"):
        make_settings(remove_background="all")
