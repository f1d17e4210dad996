from __future__ import annotations

import io
import tracemalloc
from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image

from tests.scenes import random_scene
from warpsplat.errors import Stopped
from warpsplat.metrics import psnr, score_svg, similarities
from warpsplat.scene import Kind
from warpsplat.ssimulacra2 import ssimulacra2
from warpsplat.svg import viewer
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg


def test_psnr() -> None:
    a = np.zeros((4, 4, 3))
    assert psnr(a, a) == float("inf")
    assert psnr(a, a + 255) == pytest.approx(0)
    assert psnr(a, a + 25.5) == pytest.approx(20)


def by_the_book(a: np.ndarray, b: np.ndarray) -> tuple[float, float, float]:
    """Return PSNR, SSIM and MS-SSIM of whole images, computed with 64 bits."""
    weights, product, single = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333), 1.0, None
    error = np.mean((a - b) ** 2)
    for scale, weight in enumerate(weights):

        def blur(x: np.ndarray) -> np.ndarray:
            return cv2.GaussianBlur(x, (11, 11), 1.5)[5:-5, 5:-5]

        c1, c2 = 2.55**2, 7.65**2
        ma, mb = blur(a), blur(b)
        contrast = (2 * (blur(a * b) - ma * mb) + c2) / (blur(a * a) - ma**2 + blur(b * b) - mb**2 + c2)
        full = contrast * (2 * ma * mb + c1) / (ma**2 + mb**2 + c1)
        single = full.mean() if single is None else single
        product *= (full if scale == 4 else contrast).mean() ** weight
        half = (a.shape[1] // 2, a.shape[0] // 2)
        a, b = (cv2.resize(x, half, interpolation=cv2.INTER_AREA) for x in (a, b))
    return 10 * np.log10(255**2 / error), float(single), product


def scored_scene() -> tuple[str, np.ndarray]:
    scene = random_scene(Kind.FILL, count=40, width=371, height=357)
    big = replace(scene, points=(2 * scene.points).astype(np.float32))
    noise = np.random.default_rng(2).normal(0, 0.05, (357, 371, 3))
    text = write_svg(big)
    return text, np.clip(on_white(render_svg(text)) / 255 + noise, 0, 1).astype(np.float32)


def test_figures_are_those_of_their_definitions() -> None:
    text, target = scored_scene()
    want = by_the_book(on_white(render_svg(text)), np.round(target.astype(np.float64) * 255))
    score = score_svg(text, target, perceptual=False)
    np.testing.assert_allclose([score.psnr, score.ssim, score.ms_ssim], want, atol=1e-4)
    levels = 255 * target
    assert similarities(levels, levels) == pytest.approx((1, 1))
    assert similarities(levels[:351], levels[:351])[1] is None, "the fifth scale would have 21 rows"
    assert similarities(levels[:11], levels[:11]) == (None, None)


@pytest.mark.parametrize("per_pixel", [0.5, 1.0, 5.0, 32.0])
def test_strips_of_any_view_box(per_pixel: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Strips begin where they should for any units: a tenth of a row would be visible."""
    scene = random_scene(Kind.FILL, count=40, width=91, height=157)
    text = write_svg(scene, per_pixel=per_pixel)
    whole = viewer.draw(text, 91, 157).astype(int)
    monkeypatch.setattr(viewer, "STRIP_PIXELS", 91 * 20)
    monkeypatch.setattr(viewer, "WHOLE_PIXELS", 91 * 157 - 1)
    in_strips = viewer.draw(text, 91, 157, own=True).astype(int)
    row = np.abs(np.roll(whole, 1, axis=0) - whole).mean()
    assert np.abs(in_strips - whole).mean() < 0.025 * row
    assert np.abs(in_strips - whole).max() <= 32
    # Another program's units need not be pixels: its files are drawn in one piece.
    foreign = text.replace("<!--warpsplat", "<!--another")
    np.testing.assert_array_equal(viewer.draw(foreign, 91, 157), whole)


def test_transparent_files_are_scored_on_white() -> None:
    shape = '<rect width="40" height="40" opacity=".4"/>'
    text = f'<svg xmlns="http://www.w3.org/2000/svg" width="40" height="40">{shape}</svg>'
    score = score_svg(text, np.full((40, 40, 3), 153 / 255, np.float32))
    assert score.psnr > 50


def test_scoring_can_be_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scoring stops at every stage: before drawing, between strips, between the strips of the figures."""
    text, target = scored_scene()
    monkeypatch.setattr(viewer, "STRIP_PIXELS", 371 * 100)
    monkeypatch.setattr(viewer, "WHOLE_PIXELS", 0)
    asked = 0

    def count() -> bool:
        nonlocal asked
        asked += 1
        return False

    score_svg(text, target, perceptual=False, stop=count)
    assert asked > 12
    for last in range(1, asked, 5):
        left = iter(range(last))
        with pytest.raises(Stopped):
            score_svg(text, target, perceptual=False, stop=lambda left=left: next(left, None) is None)  # type: ignore[misc]


def test_memory_of_a_score_is_bounded() -> None:
    """Beside the image less than 30 bytes a pixel without SSIMULACRA2; ``tracemalloc`` sees no drawing."""
    text = write_svg(random_scene(Kind.FILL, width=2000, height=1500))
    target = np.zeros((1500, 2000, 3), np.float32)
    tracemalloc.start()
    try:
        score_svg(text, target, perceptual=False)
        assert tracemalloc.get_traced_memory()[1] < 30 * 2000 * 1500
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("shape", [(61, 43), (8, 9), (200, 130)])
def test_ssimulacra2_is_that_of_its_package(shape: tuple[int, int]) -> None:
    package = pytest.importorskip("ssimulacra2")
    rng = np.random.default_rng(0)
    image = cv2.GaussianBlur(rng.integers(0, 256, (*shape, 3), np.uint8), (9, 9), 3)
    noisy = np.clip(image + rng.normal(0, 12, image.shape), 0, 255).astype(np.uint8)
    files = [io.BytesIO(), io.BytesIO()]
    for file, pixels in zip(files, (image, noisy), strict=True):
        Image.fromarray(pixels).save(file, "PPM")
    assert ssimulacra2(image, noisy) == pytest.approx(package.compute_ssimulacra2(*files), abs=0.02)
    assert ssimulacra2(image, image) == 100
    assert ssimulacra2(image[:7], noisy[:7]) is None


def test_ssimulacra2_is_measured_of_the_file_on_white() -> None:
    shape = '<circle cx="40" cy="30" r="25" fill="#c52" fill-opacity=".7"/>'
    text = f'<svg xmlns="http://www.w3.org/2000/svg" width="80" height="60">{shape}</svg>'
    image = np.round(on_white(render_svg(text))).astype(np.uint8)
    noisy = np.clip(image + np.random.default_rng(0).normal(0, 12, image.shape), 0, 255).astype(np.uint8)
    target = (noisy / 255).astype(np.float32)
    figure = ssimulacra2(noisy, image)
    assert figure is not None and figure < 90
    score = score_svg(text, target)
    assert score.ssimulacra2 == figure
    assert score.as_dict()["ssimulacra2"] == round(figure, 2)
    assert score_svg(text, target, perceptual=False).ssimulacra2 is None


@pytest.mark.parametrize("size", [(64, 48), (65, 48), (64, 49)])
@pytest.mark.parametrize("channels", [3, 4])
def test_strips_make_the_figures_of_the_whole(
    size: tuple[int, int], channels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Channels of large images are computed strip by strip."""
    width, height = size
    rng = np.random.default_rng(0)
    target = rng.uniform(0, 1, (height, width, channels)).astype(np.float32)
    if channels == 4:
        target[..., :3] *= target[..., 3:]
    text = write_svg(random_scene(Kind.FILL, 5, width=width, height=height, seed=1))
    whole = score_svg(text, target, own=True, perceptual=False)
    monkeypatch.setattr("warpsplat.metrics.WHOLE_PIXELS", 0)
    monkeypatch.setattr("warpsplat.metrics.STRIP_PIXELS", 640)
    monkeypatch.setattr(viewer, "STRIP_PIXELS", 640)
    pieces = score_svg(text, target, own=True, perceptual=False)
    for name, value in whole.as_dict().items():
        assert pieces.as_dict()[name] == pytest.approx(value, abs=1e-6), name
