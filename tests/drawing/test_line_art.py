"""Line art in, strokes out."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

import warpsplat
from tests.drawing.trace.line_art import CROSS, TEE, drawn, grown, shown
from tests.runs import scored, vectorize
from warpsplat.errors import ImageError, UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.run.result import Result
from warpsplat.scene import Kind


def lines_of(image: np.ndarray, device: str) -> Result:
    return vectorize(image, make_settings(subject="line"), Backend.on(device))


def on_clear(image: np.ndarray) -> np.ndarray:
    """Black ink of a picture on nothing, premultiplied."""
    cover = 1 - image[..., :1]
    return np.concatenate([np.zeros_like(image), cover], axis=2)


@pytest.mark.parametrize("paths", [CROSS, TEE, '<circle cx="48" cy="36" r="20"/>'])
def test_the_strokes_are_the_ink(paths: str, device: str) -> None:
    image = drawn(paths)
    ink = 1 - image[..., 0]
    result = lines_of(on_clear(image), device)
    painted = shown(result.svg)
    assert "<rect" not in result.svg
    assert 'fill="#' not in result.svg
    assert grown(painted > 0.5)[ink > 0.5].mean() > 0.99
    assert np.clip(painted - ink, 0, None).sum() < 0.05 * painted.sum()
    assert scored(result).psnr > 26


def test_a_ring_is_one_closed_stroke_of_its_place_and_width(device: str) -> None:
    scene = lines_of(drawn('<circle cx="48" cy="36" r="22"/>'), device).scene
    assert scene.closed.tolist() == [1]
    assert scene.widths == pytest.approx(3, abs=0.1)
    assert np.hypot(*(scene.points[::3] - (48, 36)).T) == pytest.approx(22, abs=0.15)


def test_jpeg_and_grey_paper(device: str) -> None:
    image = drawn(TEE, ground="#ccc")
    ok, data = cv2.imencode(".jpg", (255 * image).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 60])
    assert ok
    noisy = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.float32) / 255
    result = lines_of(noisy, device)
    assert len(result.scene) == 2
    assert re.search(r'<rect [^>]*fill="#(c[a-f0-9])\1\1"|<rect [^>]*fill="#ccc"', result.svg)


def test_pens_are_groups_that_say_their_colour(device: str) -> None:
    image = drawn('<path d="M10 20H86"/><path d="M10 36H86"/><path d="M10 52H60" stroke="#cc0000"/>')
    result = lines_of(image, device)
    assert re.findall(r'<g id="(.*?)">', result.svg) == ["pen-1-000000", "pen-2-cc0000"]
    assert result.scene.layer.tolist() == [0, 0, 1]
    assert result.svg.count("<path") == 3


def test_a_sheet_does_not_change_the_figures(device: str, tmp_path: Path) -> None:
    image = (255 * drawn(CROSS)[..., ::-1]).astype(np.uint8)
    ok, data = cv2.imencode(".png", image)
    assert ok
    for minify in (False, True):
        results = [
            warpsplat.vectorize(
                data.tobytes(),
                settings=make_settings(subject="line", page=page, minify=minify),
                device=device,
                output=tmp_path / f"{len(page)}.svg",
                name="a.png",
            )
            for page in ("", "a4")
        ]
        text = (tmp_path / "2.svg").read_text()
        assert text == results[1].svg
        assert 'width="297mm" height="210mm"' in text
        assert scored(results[0]).psnr == scored(results[1]).psnr


@pytest.mark.parametrize(
    ("given", "pixels"),
    [({"width": "2"}, 2), ({"width": 1.5}, 1.5), ({"width": "0.5 mm", "size": "48x36mm"}, 1)],
)
def test_a_given_width_is_that_of_all_strokes(given: dict[str, str], pixels: float, device: str) -> None:
    disc = '<circle cx="24" cy="36" r="14" fill="#000" stroke="none"/>'
    image = drawn(f'{disc}<path d="M50 12V60M70 10V52"/><path d="M88 30V60" stroke-width="5"/>')
    scene = vectorize(image, make_settings(subject="line", **given), Backend.on(device)).scene
    assert scene.widths == pytest.approx(pixels)
    ends = scene.points[np.stack([scene.first[:-1], scene.first[1:] - 1])][:, scene.closed == 0]
    assert sorted(np.ptp(ends, axis=0)[:, 1].round().tolist())[-3:] == [30, 42, 48]
    assert scene.closed.sum() >= 14 / pixels - 2, "the disc is filled by rings"


@pytest.mark.parametrize("width", ["0", "thin", "2px", "-1"])
def test_widths_that_are_none_are_refused(width: str) -> None:
    with pytest.raises(UsageError, match="a length such as"):
        make_settings(subject="line", width=width)


def test_paper_without_ink_is_refused(device: str) -> None:
    with pytest.raises(ImageError, match="no lines"):
        lines_of(np.ones((40, 50, 3), np.float32), device)


BLOB = (
    '<circle cx="30" cy="36" r="16" fill="#000"/><path d="M30 36H88"/><path d="M70 8V64" stroke="#cc0000"/>'
)


def test_mixed_line_art_keeps_its_areas(device: str) -> None:
    fine = drawn(f'<g transform="scale(8)">{BLOB}</g>', 768, 576)
    image = fine.reshape(72, 8, 96, 8, 3).mean(axis=(1, 3))
    result = vectorize(image, make_settings(subject="line", mixed=True), Backend.on(device))
    assert re.findall(r'<g id="(.*?)">', result.svg) == ["pen-1-000000", "pen-2-cc0000"]
    assert np.bincount(result.scene.kind).tolist() == [1, 2]
    # A circle, although a line begins at it, or with the beginning of the line as exact as it is drawn.
    assert scored(result).psnr > (34 if result.scene.point_counts()[0] == 12 else 42)


def test_without_areas_all_is_strokes_a_disc_a_dot_and_the_rest_rings(device: str) -> None:
    disc = lines_of(drawn(BLOB), device)
    assert (disc.scene.kind == Kind.STROKE).all()
    assert len(disc.scene) == 3
    assert scored(disc).psnr > 34
    image = drawn('<path d="M8 12H50V60H8Z" fill="#000" stroke="none"/><path d="M70 8V64M50 36H88"/>')
    rings = lines_of(image, device)
    assert (rings.scene.kind == Kind.STROKE).all()
    mixed = vectorize(image, make_settings(subject="line", mixed=True), Backend.on(device))
    assert scored(mixed).psnr > scored(rings).psnr > 34
    assert 2 * len(mixed.svg) < len(rings.svg)


def test_areas_alone_are_fills(device: str) -> None:
    image = drawn('<circle cx="30" cy="36" r="20" fill="#000"/>')
    result = vectorize(image, make_settings(subject="line", mixed=True), Backend.on(device))
    assert result.scene.kind.tolist() == [Kind.FILL]
    assert scored(result).psnr > 34


def test_a_line_thinner_than_a_pixel_is_one_thin_stroke(device: str) -> None:
    image = drawn('<path d="M8 10L88 31" stroke-width=".4"/><path d="M8 50H88"/><path d="M8 60H88"/>')
    result = lines_of(image, device)
    assert len(result.scene) == 3
    assert sorted(result.scene.widths.round(1).tolist())[0] < 0.7


@pytest.mark.parametrize("radius", [1.5, 4, 8])
def test_dots_are_strokes_of_no_length(radius: float, device: str) -> None:
    image = drawn(
        f'<circle cx="30.3" cy="30.4" r="{radius}" fill="#000" stroke="none"/><path d="M8 60H88M60 10V50"/>'
    )
    result = lines_of(image, device)
    assert (result.scene.kind == Kind.STROKE).all()
    assert len(result.scene) == 3
    assert scored(result).psnr > 30


def test_dots_alone(device: str) -> None:
    result = lines_of(drawn('<circle cx="30" cy="30" r="6" fill="#000" stroke="none"/>'), device)
    assert scored(result).psnr > 26


def test_what_is_broad_at_the_end_of_a_line_is_covered(device: str) -> None:
    image = drawn('<path d="M8 36H70"/><path d="M66 28L82 36L66 44Z" fill="#000" stroke="none"/>')
    painted = shown(lines_of(on_clear(image), device).svg)
    ink = 1 - image[..., 0]
    assert grown(painted > 0.5)[ink > 0.5].mean() > 0.99
    assert np.clip(painted - ink, 0, None).sum() < 0.03 * painted.sum()
