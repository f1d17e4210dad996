"""Drawings traced, and what the file shows of them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.drawing.trace.drawings import LOGO, STAR, decibels, draw, ground, photograph
from warpsplat.drawing.trace.hidden import HIDES_ALL, Cover, hidden_path
from warpsplat.drawing.trace.label_map import LabelMap
from warpsplat.drawing.trace.seeds import noise_of
from warpsplat.drawing.trace.trace import Traced, trace
from warpsplat.metrics import psnr
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, Paint
from warpsplat.scene.attributes import Joint


def psnr_of(traced: Traced, image: FloatArray) -> float:
    """PSNR of the exact coverage: the viewer's differs by up to a decibel, by how an arc is written."""
    return psnr(np.round(255 * render(traced.scene)), np.round(255 * image))


def hex_colors(traced: Traced) -> list[str]:
    return ["".join(f"{round(255 * float(v)):02x}" for v in color) for color in traced.scene.colors]


def on_outline(traced: Traced) -> np.ndarray:
    return np.isin(traced.joints, (Joint.CORNER, Joint.SMOOTH))


def test_a_logo() -> None:
    image = draw(LOGO)
    traced = trace(image)
    assert sorted(hex_colors(traced)) == ["2457a8", "ee4266", "ffd23f", "ffffff"]
    assert traced.scene.canvas.background is None
    assert (traced.scene.opacities == 1).all()
    assert psnr_of(traced, image) > 39
    star = hex_colors(traced).index("ffd23f")
    points = slice(traced.scene.first[star], traced.scene.first[star + 1])
    corners = traced.scene.points[points][traced.joints[points] == Joint.CORNER]
    tips = np.array([point.split(",") for point in STAR.split()], np.float64)
    assert np.hypot(*(tips[:, None] - corners).transpose(2, 0, 1)).min(axis=1).max() < 0.4
    assert len(corners) <= 12, "viewers' antialiasing is coarse: sides are a little uneven"
    disc = hex_colors(traced).index("ee4266")
    assert traced.scene.point_counts()[disc] == 12
    assert on_outline(traced).sum() * 3 == len(traced.scene.points)


DRAWINGS = {
    "rings": (
        ground("#f4f1de") + '<circle cx="30" cy="48" r="20" fill="none" stroke="#e07a5f" stroke-width="7"/>'
        '<circle cx="70" cy="44" r="18.3" fill="#3d405b"/><circle cx="70" cy="44" r="7.7" fill="#81b29a"/>',
        40,
        5,
    ),
    "overlaps": (
        '<circle cx="40" cy="40" r="30" fill="#06d6a0"/><rect x="44" y="44" width="44" height="44" rx="8" '
        'fill="#118ab2"/><path d="M10 90L30 60L50 90Z" fill="#ef476f"/>',
        36,
        3,
    ),
    "letters": (
        ground("#1d3557") + '<path d="M10 80V16H44V28H24V42H40V54H24V80Z" fill="#f1faee"/><path '
        'fill-rule="evenodd" d="M50 80L66 16H76L92 80H80L77 66H65L62 80ZM67 54H75L71 36Z" fill="#a8dadc"/>',
        36,
        2,
    ),
    "gradient": (
        '<defs><radialGradient id="b"><stop stop-color="#fff"/><stop offset="1" stop-color="#0a7"/>'
        f'</radialGradient></defs>{ground("#eee")}<circle cx="48" cy="48" r="40" fill="url(#b)"/>',
        41,
        1,
    ),
    "transparent middle": (  # whatever lies in the ring
        '<circle cx="48" cy="48" r="38" fill="none" stroke="#333" stroke-width="14"/>'
        '<circle cx="48" cy="48" r="38" fill="none" stroke="#fb0" stroke-width="5"/>',
        35,
        3,
    ),
    "translucent": ('<rect x="10" y="10" width="60" height="60" fill="#842" fill-opacity="0.5"/>', 45, 1),
    "letters of the ground": (  # on a band on a disc
        ground("#0a3") + '<circle cx="48" cy="48" r="44" fill="#fd0"/><rect x="14" y="30" width="68" '
        'height="36" fill="#fff"/><rect x="40" y="40" width="16" height="16" fill="#0a3"/>',
        40,
        4,
    ),
}


@pytest.mark.parametrize(("body", "least", "paths"), DRAWINGS.values(), ids=DRAWINGS.keys())
def test_drawings(body: str, least: float, paths: int) -> None:
    image = draw(body)
    traced = trace(image)
    assert psnr_of(traced, image) > least
    assert len(traced.scene) <= paths
    assert (Paint.RADIAL in traced.scene.paint) == ("radialGradient" in body)
    assert (traced.scene.canvas.background is None) == (image.shape[2] == 4)


def test_pixels_that_are_exact_stay_exact() -> None:
    body = (
        ground("#fff") + '<rect width="96" height="31" fill="#c8102e"/><rect y="60" width="96" height="36" '
    )
    body += 'fill="#003da5"/><rect x="40" y="20" width="20" height="50" fill="#ffcd00"/>'
    image = draw(body, hard=True)
    traced = trace(image)
    assert psnr_of(traced, image) == np.inf
    assert len(traced.scene) == 3
    assert on_outline(traced).sum() <= 20
    assert (traced.joints != Joint.SMOOTH).all() and (traced.joints != Joint.FREE).all()


def test_a_narrow_strap_has_the_colour_of_its_whole_pixels() -> None:
    # Each of its pixels is at a border: those that are wholly of it tell its colour, not the mixed ones.
    image = np.broadcast_to(np.array([165, 121, 57], np.float32) / 255, (32, 32, 3)).copy()
    image[:, 12:20] = 0
    share = np.array([0.557, 1, 1, 1, 0.868])[:, None]
    image[:, 13:18] = np.round(share * (106, 70, 47)) / 255
    assert "6a462f" in hex_colors(trace(image))


def test_lower_shapes_continue_below_upper_ones() -> None:
    """The square is four corners, the disc on its edge cuts nothing out of it."""
    body = ground("#fff") + '<rect x="10" y="20" width="50" height="50" fill="#357"/>'
    traced = trace(draw(body + '<circle cx="60" cy="45" r="18" fill="#e94"/>'))
    square = hex_colors(traced).index("335577")
    assert 4 <= traced.scene.point_counts()[square] / 3 <= 7
    disc = hex_colors(traced).index("ee9944")
    assert disc > square
    assert traced.scene.point_counts()[disc] == 12


@pytest.mark.parametrize("most", [1, 2, 3])
def test_a_limit_of_paths(most: int) -> None:
    assert 1 <= len(trace(draw(LOGO), most=most).scene) <= most


def test_photographs_are_traced_too() -> None:
    """By mistake, but to an end."""
    traced = trace(photograph(), most=40)
    assert len(traced.scene) <= 40
    assert psnr_of(traced, photograph()) > 12


@pytest.mark.parametrize("shape", [(2, 2, 3), (2, 9, 4), (3, 3, 4), (4, 4, 3)])
def test_the_smallest_pictures(shape: tuple[int, ...]) -> None:
    image = np.random.default_rng(0).random(shape).astype(np.float32)
    image[..., :3] *= image[..., 3:] if shape[2] == 4 else 1
    with np.errstate(all="raise"):  # around one pixel an outline has no direction
        traced = trace(image)
    assert len(traced.joints) == len(traced.scene.points)
    assert np.isfinite(traced.scene.points).all()


def test_one_colour_and_nothing() -> None:
    white = trace(np.ones((8, 8, 3), np.float32))
    assert len(white.scene) == 0 and white.scene.canvas.background is not None
    empty = trace(np.zeros((8, 8, 4), np.float32))
    assert len(empty.scene) == 0 and empty.scene.canvas.background is None


def test_hidden_parts_do_not_show_through_gaps() -> None:
    image = np.zeros((64, 64, 4), np.float32)
    image[6:58, 6:58] = 0.1, 0.1, 0.1, 1
    image[10:54, 10:54, :3] = 0.9, 0.2, 0.1
    image[10:32, 10:40, :3] = 0.1, 0.6, 0.2
    image[10:40, 40:54, :3] = 0.1, 0.3, 0.9
    image[26:38, 26:44] = 0
    assert render(trace(image).scene)[28:36, 28:42, 3].max() < 0.01


def test_visible_parts_in_concave_outlines_are_kept() -> None:
    """Three lines go round a square, the innermost below the others: the shortest way under the square from
    one end of the outer line to the other would cover it."""
    image = np.ones((96, 96, 3), np.float32)
    image[18:84, 12:84] = (0.2, 0.5, 0.8)
    image[24:81, 15:81] = (0.5, 0.7, 0.3)
    image[30:79, 17:79] = (0.9, 0.6, 0.1)
    image[10:73, 23:73] = 0.3
    traced = trace(image)
    assert psnr_of(traced, image) > 40


def square(top: int, bottom: int, left: int, right: int, value: float) -> FloatArray:
    """A square on nothing, 96 px."""
    shade = np.zeros((96, 96), np.float32)
    shade[top:bottom, left:right] = value
    return shade


@pytest.mark.parametrize(
    ("shade", "place", "color"),
    [
        (cv2.GaussianBlur(square(24, 80, 20, 76, 0.5), (0, 0), 4), np.s_[20:72, 20:76], (0.2, 0.4, 0.9)),
        (cv2.GaussianBlur(square(28, 76, 24, 72, 0.6), (0, 0), 6), np.s_[24:72, 24:72], (0.98, 0.98, 0.98)),
    ],
)
def test_a_soft_shadow_is_a_few_bands(
    shade: FloatArray, place: tuple[slice, slice], color: tuple[float, ...]
) -> None:
    """Cuts that gain nothing at first are made: the halves of a ring of shade are no nearer to a gradient."""
    tone = np.repeat(1 - shade[..., None], 3, axis=2)
    tone[place] = color
    image = np.round(tone * 255).astype(np.float32) / 255
    scene = trace(image).scene
    assert 6 <= len(scene) <= 30
    assert decibels(render(scene), image) > 36  # a single gradient reaches 28


def test_shading_of_many_hues_is_not_cut_into_patches() -> None:
    y, x = np.mgrid[:64, :64] / np.float32(64)
    image = np.round(np.stack([1 - x / 2, 0.5 + y / 2, x / 3], axis=2) * 255).astype(np.float32) / 255
    assert len(trace(image).scene) <= 2


def test_a_shadow_that_fades_away_is_kept() -> None:
    """On a transparent ground, where it goes over into nothing."""
    shade = square(40, 80, 20, 76, 0.5)
    image = np.zeros((96, 96, 4), np.float32)
    image[..., 3] = np.round(cv2.GaussianBlur(shade, (0, 0), 5) * 255) / 255
    image[20:64, 20:76] = (0.2, 0.4, 0.9, 1)
    shown = render(trace(image).scene)
    assert shown.shape[2] == 4
    assert np.sqrt(np.square(255 * (shown - image)[..., 3]).mean()) < 3
    assert shown[:8].max() == 0, "nothing is painted where nothing was"


def test_only_grain_counts_as_noise() -> None:
    """Of a map every pixel is beside an edge, and some of its steps are small."""
    rng = np.random.default_rng(0)
    colors = np.array([(90, 30, 20), (100, 120, 30), (110, 150, 60)], np.float32)
    ramp = np.round(np.broadcast_to(np.linspace(0, 240, 80)[:, None, None], (80, 80, 3)))
    for plain in (ramp, colors[rng.integers(0, 3, (80, 80))]):
        image = np.concatenate([plain, np.full((80, 80, 1), 255)], axis=2).astype(np.float32)
        assert noise_of(image) < 1
        image[..., :3] += np.round(rng.normal(0, 4, (80, 80, 1)))
        assert noise_of(image) > 3
    coarse = np.kron(2 * rng.integers(0, 2, (40, 40)), np.ones((2, 2)))
    image[..., :3] = 100 + coarse[..., None]  # steps of a scaled picture differ by no more than they are
    assert noise_of(image) == 2
    opacity = rng.normal(128, 6, (80, 80, 1)).astype(np.float32)
    assert noise_of(np.repeat(opacity, 4, axis=2)) < 0.01  # white, not seen on white
    assert noise_of(np.concatenate([np.repeat(opacity / 2, 3, axis=2), opacity], axis=2)) > 1


def test_a_thin_line_that_begins_at_a_margin_is_under_its_cover() -> None:
    """The shortest hidden path from one side of it to the other, at the margin, would leave all of it out."""
    ranks = np.ones((20, 20), np.int32)
    ranks[10, :15] = 0
    right, left = [[1, 0]] * 15, [[-1, 0]] * 15
    steps = np.array([*right, [0, 1], *left])
    begins = np.cumsum([[0, 10], *steps[:-1]], axis=0)
    cover = Cover(LabelMap.of(ranks).mapped(np.arange(2), HIDES_ALL))
    middles = cover.middles(np.zeros(len(steps), np.int32), begins, steps, steps.astype(np.float64))
    ends = np.array([[0.0, 10.0], [0.0, 11.0]])
    goals = np.concatenate([ends[:1], middles, ends[1:]])
    path = hidden_path(cover, 0, False, goals, np.concatenate([begins, begins[-1:], begins[-1:]]))
    outline = np.concatenate([ends[:1], path, ends[1:]]).astype(np.float32)
    assert all(cv2.pointPolygonTest(outline, (x + 0.5, 10.5), False) > 0 for x in range(15))
