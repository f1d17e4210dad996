"""Line art in, strokes out."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import warpsplat
from tests.drawing.drawings import vectorized
from tests.drawing.trace.drawings import as_file, draw_exactly, ground
from tests.drawing.trace.line_art import CROSS, PEN, TEE, drawn, grown, shown
from tests.runs import scored
from warpsplat.errors import ImageError, UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.run.result import Result
from warpsplat.scene import Kind


def lines_of(image: np.ndarray, device: str, **options: object) -> Result:
    return vectorized(image, device, "line", **options)


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
    result = lines_of(as_file(drawn(TEE, ground="#ccc"), quality=60), device)
    assert len(result.scene) == 2
    assert re.search(r'<rect [^>]*fill="#(c[a-f0-9])\1\1"|<rect [^>]*fill="#ccc"', result.svg)


def test_pens_are_groups_that_say_their_colour(device: str) -> None:
    image = drawn('<path d="M10 20H86"/><path d="M10 36H86"/><path d="M10 52H60" stroke="#cc0000"/>')
    result = lines_of(image, device)
    assert re.findall(r'<g id="(.*?)">', result.svg) == ["pen-1-000000", "pen-2-cc0000"]
    assert result.scene.layer.tolist() == [0, 0, 1]
    assert result.svg.count("<path") == 3


def test_a_sheet_does_not_change_the_figures(device: str, tmp_path: Path) -> None:
    image = (255 * drawn(CROSS)).astype(np.uint8)
    for minify in (False, True):
        results = [
            warpsplat.vectorize(
                image,
                settings=make_settings(subject="line", page=page, minify=minify),
                device=device,
                output=tmp_path / "a.svg",
            )
            for page in ("", "a4")
        ]
        text = (tmp_path / "a.svg").read_text()
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
    scene = lines_of(image, device, **given).scene
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
    image = draw_exactly(f"{ground('#fff', 96, 72)}<g {PEN}>{BLOB}</g>", 96, 72)
    result = lines_of(image, device, mixed=True)
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
    rings, mixed = lines_of(image, device), lines_of(image, device, mixed=True)
    assert (rings.scene.kind == Kind.STROKE).all()
    assert scored(mixed).psnr > scored(rings).psnr > 34
    assert 2 * len(mixed.svg) < len(rings.svg)
    alone = lines_of(drawn('<circle cx="30" cy="36" r="20" fill="#000"/>'), device, mixed=True)
    assert alone.scene.kind.tolist() == [Kind.FILL]
    assert scored(alone).psnr > 34


def test_a_line_thinner_than_a_pixel_is_one_thin_stroke(device: str) -> None:
    image = drawn('<path d="M8 10L88 31" stroke-width=".4"/><path d="M8 50H88"/><path d="M8 60H88"/>')
    result = lines_of(image, device)
    assert len(result.scene) == 3
    assert sorted(result.scene.widths.round(1).tolist())[0] < 0.7


@pytest.mark.parametrize("radius", [1.5, 4, 8])
@pytest.mark.parametrize("lines", ["", "M8 60H88M60 10V50"])
def test_dots_are_strokes_of_no_length(lines: str, radius: float, device: str) -> None:
    dot = f'<circle cx="30.3" cy="30.4" r="{radius}" fill="#000" stroke="none"/>'
    result = lines_of(drawn(f'{dot}<path d="{lines}"/>'), device)
    assert (result.scene.kind == Kind.STROKE).all()
    assert len(result.scene) == (3 if lines else 1)
    assert scored(result).psnr > (30 if lines else 26)


def test_what_is_broad_at_the_end_of_a_line_is_covered(device: str) -> None:
    image = drawn('<path d="M8 36H70"/><path d="M66 28L82 36L66 44Z" fill="#000" stroke="none"/>')
    painted = shown(lines_of(on_clear(image), device).svg)
    ink = 1 - image[..., 0]
    assert grown(painted > 0.5)[ink > 0.5].mean() > 0.99
    assert np.clip(painted - ink, 0, None).sum() < 0.03 * painted.sum()
