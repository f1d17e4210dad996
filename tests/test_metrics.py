from __future__ import annotations

import itertools
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from tests.scenes import random_scene
from warpsplat.errors import Stopped
from warpsplat.metrics import SSIMULACRA2_PIXELS, Score, ms_ssim, psnr, score_svg, ssim, ssimulacra2
from warpsplat.scene import Kind
from warpsplat.svg import strips
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg


def small_score() -> tuple[str, Score]:
    """Return a file of five shapes, and its score for what it shows."""
    text = write_svg(random_scene(Kind.FILL, count=5))
    return text, score_svg(text, (on_white(render_svg(text)) / 255).astype(np.float32))


def test_psnr() -> None:
    a = np.zeros((4, 4, 3))
    assert psnr(a, a) == float("inf")
    assert psnr(a, a + 255) == pytest.approx(0)
    assert psnr(a, a + 25.5) == pytest.approx(20)


def test_ssim() -> None:
    rng = np.random.default_rng(0)
    a = rng.uniform(0, 255, (32, 32, 3))
    noisy = ssim(a, np.clip(a + rng.normal(0, 60, a.shape), 0, 255))
    assert ssim(a, a) == pytest.approx(1)
    assert noisy and 0.2 < noisy < 0.95
    assert ssim(a[:11], a[:11]) is None


def test_ms_ssim() -> None:
    a = np.random.default_rng(0).uniform(0, 255, (352, 360, 3))
    assert ms_ssim(a, a) == pytest.approx(1)
    fine, coarse = ms_ssim(a, cv2.GaussianBlur(a, (0, 0), 1.0)), ms_ssim(a, np.clip(a + 40, 0, 255))
    assert fine and coarse and 0.3 < fine < coarse < 1
    assert ms_ssim(a[:351], a[:351]) is None, "the fifth scale would have 21 rows"


def test_score() -> None:
    text, score = small_score()
    assert score.psnr > 60
    assert score.paths == 5
    assert score.bytes == len(text.encode())
    assert score.gzip_bytes < score.bytes


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


def test_score_in_strips_is_that_of_whole_images(monkeypatch: pytest.MonkeyPatch) -> None:
    text, target = scored_scene()
    want = by_the_book(on_white(render_svg(text)), np.round(target.astype(np.float64) * 255))
    # In strips this thin, edges move a little.
    cases = ((1 << 20, 1 << 22, 1e-4), (371 * 20, 1 << 22, 1e-4), (371 * 20, 0, 5e-3))
    for strip, whole, tolerance in cases:
        monkeypatch.setattr(strips, "STRIP_PIXELS", strip)
        monkeypatch.setattr(strips, "WHOLE_PIXELS", whole)
        score = score_svg(text, target, eyes=False)
        np.testing.assert_allclose([score.psnr, score.ssim, score.ms_ssim], want, atol=tolerance)


@pytest.mark.parametrize("per_pixel", [0.5, 1.0, 5.0, 32.0])
def test_strips_of_any_view_box(per_pixel: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Strips begin where they should for any units: a tenth of a row would be visible.

    Another program's units need not be pixels: its files are drawn in one piece.
    """
    scene = random_scene(Kind.FILL, count=40, width=91, height=157)
    text = write_svg(scene, per_pixel=per_pixel)
    whole = strips.draw(text, 91, 157).astype(int)
    monkeypatch.setattr(strips, "STRIP_PIXELS", 91 * 20)
    monkeypatch.setattr(strips, "WHOLE_PIXELS", 91 * 157 - 1)
    np.testing.assert_array_equal(strips.draw(text.replace("<!--warpsplat", "<!--another"), 91, 157), whole)
    in_strips = strips.draw(text, 91, 157, own=True).astype(int)
    row = np.abs(np.roll(whole, 1, axis=0) - whole).mean()
    assert np.abs(in_strips - whole).mean() < 0.025 * row
    assert np.abs(in_strips - whole).max() <= 32


def test_transparent_files_are_scored_on_white() -> None:
    shape = '<rect width="40" height="40" opacity=".4"/>'
    text = f'<svg xmlns="http://www.w3.org/2000/svg" width="40" height="40">{shape}</svg>'
    score = score_svg(text, np.full((40, 40, 3), 153 / 255, np.float32))
    assert score.psnr > 50


def test_scoring_can_be_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scoring stops at every stage: before drawing, between strips, between the strips of the figures."""
    text, target = scored_scene()
    monkeypatch.setattr(strips, "STRIP_PIXELS", 371 * 100)
    monkeypatch.setattr(strips, "WHOLE_PIXELS", 0)
    calls = itertools.count()
    score_svg(text, target, eyes=False, stop=lambda: next(calls) < 0)
    asked = next(calls)
    assert asked > 12
    for last in range(1, asked, 5):
        answers = itertools.chain([False] * (last - 1), itertools.repeat(True))
        with pytest.raises(Stopped):
            score_svg(text, target, eyes=False, stop=answers.__next__)


def test_memory_of_a_score_is_bounded() -> None:
    """Beside the image less than 30 bytes a pixel without SSIMULACRA2; ``tracemalloc`` sees no drawing."""
    text = write_svg(random_scene(Kind.FILL, width=2000, height=1500))
    target = np.zeros((1500, 2000, 3), np.float32)
    tracemalloc.start()
    score_svg(text, target, eyes=False)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 30 * 2000 * 1500


def test_ssimulacra2_is_that_of_the_package(tmp_path: Path) -> None:
    """The package compares the SVG rendered on white with the image."""
    package = pytest.importorskip("ssimulacra2")
    shape = '<circle cx="40" cy="30" r="25" fill="#c52" fill-opacity=".7"/>'
    text = f'<svg xmlns="http://www.w3.org/2000/svg" width="80" height="60">{shape}</svg>'
    image = np.round(on_white(render_svg(text))).astype(np.uint8)
    noisy = np.clip(image + np.random.default_rng(0).normal(0, 12, image.shape), 0, 255).astype(np.uint8)
    for name, pixels in (("image", noisy), ("shown", image)):
        Image.fromarray(pixels).save(tmp_path / f"{name}.png")
    wanted = package.compute_ssimulacra2(str(tmp_path / "image.png"), str(tmp_path / "shown.png"))
    score = score_svg(text, (noisy / 255).astype(np.float32))
    assert score.ssimulacra2 == pytest.approx(wanted, abs=1e-9)
    assert score.as_dict()["ssimulacra2"] == round(wanted, 2)
    assert wanted < 90
    assert ssimulacra2(image, image) == 100


def test_ssimulacra2_has_its_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """A package of our own: it is asked for images of neither too few nor too many pixels, image first."""
    asked: list[list[Any]] = []

    def compute(*files: Any) -> float:
        asked.append([np.asarray(Image.open(file)) for file in files])
        return -7.123

    monkeypatch.setitem(sys.modules, "ssimulacra2", SimpleNamespace(compute_ssimulacra2=compute))
    wide = SSIMULACRA2_PIXELS // 8 + 1
    for shape in ((7, 20, 3), (20, 7, 3), (8, wide, 3)):
        assert ssimulacra2(np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)) is None
    assert not asked
    a, b = np.random.default_rng(0).integers(0, 256, (2, 8, 9, 3), np.uint8)
    assert ssimulacra2(a, b) == -7.123
    np.testing.assert_array_equal(asked[0], [a, b])


def test_without_the_package_ssimulacra2_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ssimulacra2", None)  # makes importing it fail
    _, score = small_score()
    assert score.ssimulacra2 is None and score.as_dict()["ssimulacra2"] is None
    assert score.psnr > 60


@pytest.mark.parametrize(("width", "height"), [(64, 48), (65, 48), (64, 49)])
@pytest.mark.parametrize("channels", [3, 4])
def test_strips_make_the_figures_of_the_whole(
    width: int, height: int, channels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Channels of large images are computed strip by strip."""
    target = np.random.default_rng(0).uniform(0, 1, (height, width, channels)).astype(np.float32)
    if channels == 4:
        target[..., :3] *= target[..., 3:]
    text = write_svg(random_scene(Kind.FILL, 5, width=width, height=height, seed=1))
    whole = score_svg(text, target, own=True, eyes=False)
    monkeypatch.setattr("warpsplat.metrics.WHOLE_PIXELS", 0)
    monkeypatch.setattr("warpsplat.metrics.STRIP_PIXELS", 640)
    monkeypatch.setattr(strips, "STRIP_PIXELS", 640)
    pieces = score_svg(text, target, own=True, eyes=False)
    for name, value in whole.as_dict().items():
        assert pieces.as_dict()[name] == pytest.approx(value, abs=1e-6), name
