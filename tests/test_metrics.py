from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image

from tests.scenes import random_scene
from warpsplat.errors import ImageError
from warpsplat.inspect_svg import inspect_svg
from warpsplat.metrics import ms_ssim, psnr, score_svg, ssim
from warpsplat.svg import write_svg
from warpsplat.viewer import on_white, render_svg


def test_psnr() -> None:
    a = np.zeros((4, 4, 3))
    assert psnr(a, a) == float("inf")
    assert psnr(a, a + 255) == pytest.approx(0)
    assert psnr(a, a + 25.5) == pytest.approx(20)


def test_ssim() -> None:
    rng = np.random.default_rng(0)
    a = rng.uniform(0, 255, (32, 32, 3))
    same = ssim(a, a)
    noisy = ssim(a, np.clip(a + rng.normal(0, 60, a.shape), 0, 255))
    assert same == pytest.approx(1)
    assert noisy is not None
    assert 0.2 < noisy < 0.95
    assert ssim(a[:11], a[:11]) is None


def test_ssim_against_the_formula_at_one_window() -> None:
    """A 12x12 image has four windows: computed here with explicit weights."""
    rng = np.random.default_rng(1)
    a, b = rng.uniform(0, 255, (2, 12, 12, 1))
    kernel = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    weights = np.outer(kernel, kernel) / kernel.sum() ** 2
    values = []
    for y in range(2):
        for x in range(2):
            p, q = a[y : y + 11, x : x + 11, 0], b[y : y + 11, x : x + 11, 0]
            mp, mq = (weights * p).sum(), (weights * q).sum()
            vp, vq = (weights * p * p).sum() - mp**2, (weights * q * q).sum() - mq**2
            c = (weights * p * q).sum() - mp * mq
            c1, c2 = 2.55**2, 7.65**2
            values.append((2 * mp * mq + c1) * (2 * c + c2) / ((mp**2 + mq**2 + c1) * (vp + vq + c2)))
    assert ssim(np.repeat(a, 3, 2), np.repeat(b, 3, 2)) == pytest.approx(np.mean(values), rel=1e-6)


def test_ms_ssim() -> None:
    rng = np.random.default_rng(0)
    a = rng.uniform(0, 255, (352, 360, 3))
    assert ms_ssim(a, a) == pytest.approx(1)
    blurred = cv2.GaussianBlur(a, (0, 0), 1.0)
    fine, coarse = ms_ssim(a, blurred), ms_ssim(a, np.clip(a + 40, 0, 255))
    assert fine is not None
    assert coarse is not None
    assert 0.3 < fine < coarse < 1
    assert ms_ssim(a[:351], a[:351]) is None, "the fifth scale would have 21 rows"


NODES = [
    ('<path d="M0 0c1 1 2 2 3 3 1 1 2 2 3 3z"/>', 3),
    ('<path fill="#fff" d="M0,0L1-1.5.5,2H3V4Z"/><circle r="2"/>', 6),
    ('<path id="d" d="m0 0a1 1 0 0 1 2 2q1 1 2 2t1 1"/>', 4),
    ("<rect/>", 0),
]


@pytest.mark.parametrize(("text", "count"), NODES)
def test_nodes(text: str, count: int) -> None:
    assert inspect_svg(f'<svg xmlns="http://www.w3.org/2000/svg">{text}</svg>').nodes == count


def test_white_behind_transparency() -> None:
    image = Image.new("RGBA", (1, 1), (255, 0, 0, 51))
    np.testing.assert_allclose(on_white(image)[0, 0], [255, 204, 204])


def test_score() -> None:
    scene = random_scene("closed", count=5)
    text = write_svg(scene)
    target = (on_white(render_svg(text)) / 255).astype(np.float32)
    score = score_svg(text, target)
    assert score.psnr > 60
    assert score.paths == 5
    assert score.bytes == len(text.encode())
    assert score.gzip_bytes < score.bytes


def test_not_svg() -> None:
    with pytest.raises(ImageError, match="cannot be rendered"):
        render_svg("hello")
