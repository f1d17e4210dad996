"""Line art in, strokes out."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import warpsplat
from tests.drawing.drawings import vectorized
from tests.drawing.trace.drawings import as_file, draw_exactly, ground
from tests.drawing.trace.line_art import CROSS, PEN, TEE, drawn, grown, shown
from tests.runs import scored
from warpsplat.drawing.junctions import with_junctions
from warpsplat.errors import ImageError, UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.run.result import Result
from warpsplat.scene import Canvas, Kind, Scene
from warpsplat.svg.data import straight_cubics


def lines_of(image: np.ndarray, device: str, **options: object) -> Result:
    return vectorized(image, device, "line", **options)


ARROW = '<path d="M8 36H70"/><path d="M66 28L82 36L66 44Z" fill="#000" stroke="none"/>'


@pytest.mark.parametrize("paths", [CROSS, TEE, '<circle cx="48" cy="36" r="20"/>', ARROW])
def test_the_strokes_are_the_ink(paths: str, device: str) -> None:
    """On nothing, and what is broad at the end of a line is covered."""
    image = drawn(paths)
    ink = 1 - image[..., 0]
    result = lines_of(np.concatenate([np.zeros_like(image), ink[..., None]], axis=2), device)
    painted = shown(result.svg)
    assert "<rect" not in result.svg
    assert 'fill="#' not in result.svg
    assert grown(painted > 0.5)[ink > 0.5].mean() > 0.99
    assert np.clip(painted - ink, 0, None).sum() < (0.03 if paths is ARROW else 0.05) * painted.sum()
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
def test_bad_widths_are_refused(width: str) -> None:
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


def test_without_areas_everything_is_drawn_with_strokes(device: str) -> None:
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


def strokes(*lines: list[tuple[float, float]]) -> Scene:
    points = np.array([np.linspace(a, b, 4) for a, b in lines], np.float32)
    scene = Scene.uniform(Kind.STROKE, Canvas(96, 72, None), points)
    return replace(scene, widths=np.full(len(lines), 4, np.float32))


@pytest.mark.parametrize(
    ("stem", "met"),
    [
        ([(48, 21.4), (48, 65.2)], (48, 20)),
        ([(48, 18.5), (48, 65.2)], (48, 20)),
        ([(37, 21.5), (60, 65.2)], (36.2105, 20)),
        ([(48, 23), (48, 60)], None),  # beside the ink
        ([(20, 21), (80, 21.5)], None),  # along it
        ([(48, 10), (48, 60)], None),  # across it
        ([(48, 21), (48, 21)], None),  # a dot
    ],
)
def test_an_end_in_the_ink_of_another_is_put_on_its_centre_line(
    stem: list[tuple[float, float]], met: tuple[float, float] | None
) -> None:
    scene = strokes([(10, 20), (86, 20)], stem)
    made = with_junctions(scene)
    assert made.points_of(1)[0] == pytest.approx(met or stem[0], abs=1e-3)
    assert straight_cubics(made, made.points.astype(np.float64))[[0, 4]].all(), "lines stay lines"
    stay = slice(None) if met is None else [0, 1, 2, 3, 7]
    np.testing.assert_array_equal(made.points[stay], scene.points[stay])


def scene_of(paths: str, device: str, *, is_grey: bool) -> tuple[Scene, float]:
    image = drawn(paths)
    result = lines_of(image if is_grey else np.round(image), device)
    return result.scene, scored(result).psnr


SLANTED = '<path d="M12 12L84 24"/><path d="M40 16.667L56 64"/>'


@pytest.mark.parametrize("paths", [TEE, SLANTED, SLANTED.replace("<path", '<path stroke-width="5"', 1)])
@pytest.mark.parametrize("is_grey", [True, False])
def test_a_line_that_ends_at_another_ends_on_its_centre_line(paths: str, is_grey: bool, device: str) -> None:
    scene, _ = scene_of(paths, device, is_grey=is_grey)
    bar, stem = sorted(map(scene.points_of, range(2)), key=lambda points: -float(np.ptp(points[:, 0])))
    low = stem[stem[:, 1].argmin()]
    first, last = bar[bar[:, 0].argmin()], bar[bar[:, 0].argmax()]
    way = (last - first) / np.hypot(*(last - first))
    off = low - first
    assert abs(off[0] * way[1] - off[1] * way[0]) < 0.15


LINE, CURVE = '<path d="M8 36H88"/>', '<path d="M8 50C30 50 30 20 48 20S66 50 88 50"/>'
RING = '<circle cx="48" cy="36" r="22"/>'


@pytest.mark.parametrize("is_grey", [True, False])
@pytest.mark.parametrize(
    ("paths", "widths"),
    [
        (f'{LINE}<path d="M40 36H88" stroke-width="7"/>', [3, 7]),
        ('<path d="M8 36H88" stroke-width="2"/><path d="M32 36H64" stroke-width="6"/>', [2, 2, 6]),
        (f'{CURVE}<path d="M48 20C66 20 66 50 88 50" stroke-width="6"/>', [3, 6]),
        (f'{RING}<path d="M48 14A22 22 0 0 1 48 58" stroke-width="6"/>', [3, 6]),
    ],
)
def test_a_line_of_two_pens_is_a_stroke_of_each(
    paths: str, widths: list[float], is_grey: bool, device: str
) -> None:
    scene, psnr = scene_of(f'{paths}<path d="M8 5H88M8 67H88"/>', device, is_grey=is_grey)
    assert sorted(scene.widths) == pytest.approx(sorted([*widths, 3, 3]), abs=0.3 if is_grey else 0.6)
    assert psnr > 21
    ends = scene.points[np.concatenate([scene.first[:-1], scene.first[1:] - 1])]
    away = np.linalg.norm(ends[:, None] - ends[None], axis=2) + 99 * np.eye(len(ends))
    assert (away.min(axis=1) < 0.1).sum() >= 2, "one begins where the other ends"


@pytest.mark.parametrize("is_grey", [True, False])
@pytest.mark.parametrize(
    "paths",
    [
        f'{LINE}<path d="M44 36H88" stroke-width="4"/>',
        f'{CURVE}<path d="M48 20C66 20 66 50 88 50" stroke-width="4"/>',
        RING,
    ],
)
def test_a_width_step_of_one_pixel_does_not_split_a_stroke(paths: str, is_grey: bool, device: str) -> None:
    assert len(scene_of(paths, device, is_grey=is_grey)[0]) == 1


HOOK = '<path d="M14 58V30a16 16 0 0 1 32 0v14" stroke-width="7"/>'
RED_RING = '<circle cx="70" cy="24" r="12" stroke-width="5" stroke="#d62828"/>'
BLOCK = '<path d="M60 46h24v16h-24z" fill="#1d3557" stroke="none"/>'
WEDGE = '<path d="M10 12L80 8L80 20z" fill="#000" stroke="none"/>'
BLUNT = '<path d="M14 36H84" stroke-width="12" stroke-linecap="butt"/>'


def strokes_of(paths: str, device: str) -> Result:
    return vectorized(drawn(paths), device, strokes=True)


def test_lines_become_strokes_and_areas_stay_fills(device: str) -> None:
    result = strokes_of(HOOK + RED_RING + BLOCK, device)
    scene = result.scene
    is_stroke = scene.kind == Kind.STROKE
    assert is_stroke.sum() == 2
    np.testing.assert_allclose(np.sort(scene.widths[is_stroke]), [5, 7], atol=0.15)
    assert result.svg.count('stroke-linecap="round"') == 1
    assert result.svg.count("<rect") == 2  # the ground and the block
    assert scored(result).psnr > 35


@pytest.mark.parametrize("paths", [WEDGE, BLUNT, BLOCK])
def test_shapes_without_constant_width_stay_fills(paths: str, device: str) -> None:
    assert (strokes_of(paths, device).scene.kind == Kind.FILL).all()


def test_one_path_may_be_partly_strokes(device: str) -> None:
    """The rest keeps its colour and its place."""
    result = strokes_of('<path d="M12 14H84"/>' + BLOCK.replace("#1d3557", "#000"), device)
    scene = result.scene
    assert scene.kind.tolist() == [Kind.FILL, Kind.STROKE]
    np.testing.assert_array_equal(scene.colors[0], scene.colors[1])
    assert set(scene.points_of(1)[:, 1].tolist()) == {14.0}
