"""How a picture was made, enlarged and coloured is found and undone."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageFilter

import warpsplat
from tests.drawing.trace.drawings import decibels, draw
from warpsplat.drawing import optics as optics_module
from warpsplat.drawing import without_optics as without_optics_module
from warpsplat.drawing.constraints import DRAFT_GRID
from warpsplat.drawing.edges import LINEAR, MIDDLES, Edges, find_edges
from warpsplat.drawing.optics import NONE, SCALE, Seen
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.reduced import before_enlarging
from warpsplat.drawing.seen_colors import MOST_COLORS, with_seen_colors
from warpsplat.drawing.trace.trace import Traced, trace
from warpsplat.drawing.without_optics import without_optics
from warpsplat.errors import UsageError
from warpsplat.fit.export import finished, shown_image
from warpsplat.fit.optics import RADIUS, RINGS, Kernel, Optics, parse_optics
from warpsplat.fit.settings import make_settings
from warpsplat.run.options import settings_from
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.viewer import on_white, render_svg

SIDE, BIG = 96, 8

BODY = (
    '<rect width="96" height="96" fill="#f4f1de"/><path d="M12 80L44 14L82 78z" fill="#b0344d"/>'
    '<circle cx="60" cy="30" r="17" fill="#3d5a80"/><path d="M20 20L70 86" stroke="#222" stroke-width="4"/>'
)
"""Colours from which rings go beyond."""


def enlarged(times: int) -> Image.Image:
    image = draw(f'<g transform="scale({times})">{BODY}</g>', times * SIDE, times * SIDE, hard=times == BIG)
    return Image.fromarray(np.round(255 * image).astype(np.uint8))


def small(how: Image.Resampling, times: int = 1) -> Image.Image:
    return enlarged(BIG).resize((times * SIDE, times * SIDE), how)


def in_linear_light(large: Image.Image | None = None) -> Image.Image:
    light = LINEAR[np.asarray(large or enlarged(BIG))].reshape(SIDE, BIG, SIDE, BIG, 3).mean(axis=(1, 3))
    return Image.fromarray(np.searchsorted(MIDDLES, light.astype(np.float32)).astype(np.uint8))


BOX = Image.Resampling.BOX

MADE: dict[str, Callable[[], Image.Image]] = {
    "blurred": lambda: small(BOX).filter(ImageFilter.GaussianBlur(0.7)),
    "sharpened": lambda: small(BOX).filter(ImageFilter.UnsharpMask(1, 80, 0)),
    "by Lanczos": lambda: small(Image.Resampling.LANCZOS),
    "by bicubic": lambda: small(Image.Resampling.BICUBIC),
    "in linear light": in_linear_light,
}


def pixels(image: Image.Image) -> FloatArray:
    return np.asarray(image, np.float32) / np.float32(255)


def drawn(image: FloatArray, times: int = 1, **given: str) -> FloatArray:
    """A drawing of an image as a viewer shows it."""
    svg = warpsplat.vectorize(image, subject="drawing", **given).svg
    return np.asarray(np.asarray(on_white(render_svg(svg, zoom=times))) / 255, np.float32)


def noting(sizes: list[tuple[int, ...]]) -> Callable[[FloatArray], Traced]:
    """Return a function that traces, and notes the sizes of what it is given."""

    def traced(image: FloatArray) -> Traced:
        sizes.append(image.shape[:2])
        return trace(image)

    return traced


def show(scene: Scene) -> FloatArray:
    return shown_image(finished(scene, make_settings(), DRAFT_GRID / SCALE), scene, 3)


def test_linear_light_must_explain_the_image_clearly_better(monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture may look as if its colours were mixed in linear light when they were not."""
    monkeypatch.setattr(optics_module, "find_edges", partial(find_edges, is_linear=True))
    for image, is_linear in ((small(Image.Resampling.HAMMING), False), (in_linear_light(), True)):
        seen = pixels(image)
        found = without_optics(seen, 0.0, partial(trace, noise=0.0), show, lambda: False).pixels
        assert (found is not seen) == is_linear


def test_a_blur_is_found_although_colours_look_mixed_in_linear_light(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def voted(image: FloatArray, noise: float = 0.0, *, is_linear: bool | None = None) -> Edges:
        return find_edges(image, noise, is_linear=is_linear is not False)

    monkeypatch.setattr(optics_module, "find_edges", voted)
    blurred = pixels(MADE["blurred"]())
    found = without_optics(blurred, 0.0, partial(trace, noise=0.0), show, lambda: False)
    assert found.optics == Optics("sRGB")
    assert decibels(found.pixels, pixels(small(BOX))) > decibels(blurred, pixels(small(BOX))) + 4


@pytest.mark.parametrize(("second", "traces"), [(100.1, 4), (99.9, 6)])
def test_linear_light_is_given_up_after_two_turns_without_gain(
    monkeypatch: pytest.MonkeyPatch, second: float, traces: int
) -> None:
    """A map as a JPEG was explained a little better in each of six turns, and much worse by its fit."""
    costs = iter([105.0, 100.0, 103.0, 102.0, second, 97.0, 98.0])
    monkeypatch.setattr(without_optics_module, "cost_of", lambda *_: next(costs))
    seen, traced = pixels(in_linear_light()), list[tuple[int, ...]]()
    result = without_optics(seen, 0.0, noting(traced), show, lambda: False).pixels
    assert len(traced) == traces and (result is seen) == (second > 100)


def quarter(kernel: Kernel) -> list[list[float]]:
    """A kernel as reports have it."""
    weights = dict(zip(RINGS, kernel, strict=True))
    return [[weights[max(y, x), min(y, x)] for x in range(RADIUS)] for y in range(RADIUS)]


def test_known_optics_are_undone_however_well_they_explain() -> None:
    """Those of a report are not looked for again."""
    image = pixels(MADE["blurred"]())
    report = warpsplat.vectorize(image, subject="drawing", quality="draft").optics
    assert report is not None
    other = pixels(small(BOX))
    again = warpsplat.vectorize(other, subject="drawing", quality="draft", optics=report.as_dict()).optics
    assert again is not None and again.light == report.light
    np.testing.assert_allclose(again.kernel, report.kernel, atol=1e-4)
    assert warpsplat.vectorize(other, subject="drawing", quality="draft").optics is None
    linear = warpsplat.vectorize(other, subject="drawing", quality="draft", optics="linear").optics
    assert linear is not None and linear.light == "linear"


def test_translucent_images_are_taken_as_mixed_in_srgb() -> None:
    image = np.dstack([pixels(small(BOX)), np.ones((SIDE, SIDE), np.float32)])
    image[:4, :4, 3] = 0
    svgs = [
        warpsplat.vectorize(image, subject="drawing", quality="draft", optics=how).svg
        for how in ("auto", "linear")
    ]
    assert svgs[0] == svgs[1]


def test_optics_are_words_or_those_of_a_report(tmp_path: Path) -> None:
    text = parse_optics({"light": "linear", "kernel": quarter(NONE)})
    assert parse_optics(text) == text and Optics.of(text) == Optics("linear", NONE)
    assert Optics.of("auto") == Optics.of("none") == Optics()
    assert Optics.of("linear") == Optics("linear")
    file = tmp_path / "report.json"
    file.write_text(json.dumps({"psnr": 30, "optics": {"light": "sRGB", "kernel": quarter(NONE)}}))
    assert settings_from({"optics": str(file)}).optics == "sRGB " + text.split(maxsplit=1)[1]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("atuo", "did you mean 'auto'"),
        ("report.json", "report.json: No such file"),
        ("{", "optics must be auto, none, sRGB, linear or a report.json"),
        ({"optics": None}, "must have a light"),
        ('{"light": "red"}', "sRGB or linear, not 'red'"),
        ("sRGB " + " ".join(["e"] * len(RINGS)), "must be auto, none"),
        ({"light": "red"}, "sRGB or linear, not 'red'"),
        ({"kernel": [[1.0]]}, "5 rows of 5 numbers"),
        ({"kernel": [["1"] * 5] * 5}, "5 rows of 5 numbers"),
        ({"kernel": [[0.25, 0, 0, 0, 0], *[[0.1, 0, 0, 0, 0]] * 4]}, "the same across and down"),
        ({"kernel": [[0.1] * 5] * 5}, "must add up to 1/4, not 2.5"),
    ],
)
def test_wrong_optics_are_refused(given: object, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        settings_from({"optics": given})


def test_plain_and_unsmoothed_images_have_no_kernel() -> None:
    """Any kernel that sharpens would explain steps."""
    found = Seen.of(pixels(small(BOX))).find(pixels(small(BOX, SCALE)))
    np.testing.assert_allclose(found.kernel, NONE, atol=2e-3)
    ink = np.where(np.asarray(small(BOX).convert("L")) < 128, 0, 255)
    image = np.repeat(ink[..., None], 3, axis=2).astype(np.float32) / 255
    assert Seen.of(image).find(pixels(small(BOX, SCALE))).kernel == NONE


@pytest.mark.parametrize(("how", "is_late"), [(None, False), ("blurred", True)])
def test_images_without_optics_or_time_are_traced_once(how: str | None, is_late: bool) -> None:
    image, traced = pixels(MADE[how]() if how else small(BOX)), list[tuple[int, ...]]()
    result = without_optics(image, None, noting(traced), show, lambda: is_late).pixels
    assert result is image and len(traced) == 1


def test_a_part_of_a_large_picture_tells_whether_there_is_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """A blur is undone in it; a shape that its trace does not explain, as stripes of a pixel, is no blur."""
    monkeypatch.setattr(without_optics_module, "LOOK", 40)
    monkeypatch.setattr(without_optics_module, "PARTS", 4)
    blurred = pixels(MADE["blurred"]())
    result = without_optics(blurred, None, trace, show, bool).pixels
    assert decibels(result, pixels(small(BOX))) > decibels(blurred, pixels(small(BOX))) + 4
    traced = list[tuple[int, ...]]()
    odd = pixels(small(BOX)).copy()
    odd[40:70, 4:34] = (np.arange(30) % 2)[:, None]
    result = without_optics(odd, None, noting(traced), show, bool).pixels
    assert result is odd
    assert traced == [(SIDE, SIDE), (40, 40), (40, 40)], "then the part, as it is and without a kernel"


def test_a_kernel_is_told_by_few_pixels_and_by_strips(monkeypatch: pytest.MonkeyPatch) -> None:
    seen, fine = Seen.of(pixels(MADE["blurred"]())), pixels(small(BOX, SCALE))
    whole = seen.find(fine)
    monkeypatch.setattr(optics_module, "STRIP", 7)
    strips = seen.find(fine)
    assert strips.kernel == whole.kernel
    np.testing.assert_array_equal(strips.undone, whole.undone)
    monkeypatch.setattr(optics_module, "MOST_TOLD", 700)
    few = seen.find(fine)
    assert few.kernel != whole.kernel
    np.testing.assert_allclose(few.kernel, whole.kernel, atol=0.01)
    assert decibels(few.undone, whole.undone) > 40
    assert few.error / few.without == pytest.approx(whole.error / whole.without, rel=0.2)


@pytest.mark.parametrize("how", MADE)
def test_drawings_are_nearer_to_their_source_with_optics(how: str) -> None:
    """It is nearer to the source, four times as large, than without its optics, and as small."""
    picture, source = pixels(MADE[how]()), pixels(enlarged(4))
    sharp, soft = (drawn(picture, 4, optics=optics) for optics in ("auto", "none"))
    assert decibels(sharp, source) > decibels(soft, source) + 0.5
    assert decibels(sharp, source) > 36
    assert len(warpsplat.vectorize(picture, subject="drawing").svg) < 1200


def test_a_blurred_draft_is_drawn_sharp() -> None:
    picture, source = pixels(MADE["blurred"]()), pixels(small(BOX))
    assert decibels(drawn(picture, quality="draft"), source) > decibels(picture, source) + 4


@pytest.mark.parametrize("how", [None, *MADE])
def test_ringing_and_linear_light_are_detected(how: str | None) -> None:
    found = find_edges(np.asarray(MADE[how]() if how else small(BOX), np.float32))
    assert found.clean.sum() > 300
    if how != "by Lanczos":  # which leaves several rings, the outermost of which are faint
        assert found.has_rings == (how in ("sharpened", "by bicubic"))
    assert found.is_linear == (how == "in linear light")


@pytest.mark.parametrize("width", [0.8, 1.6, 3.0])
def test_thin_lines_tell_linear_light(width: float) -> None:
    """Where nothing is wide, there is no edge between two flat colours."""
    arcs = "".join(f'<path d="M{x} 90A70 70 0 0 1 92 {x}"/>' for x in range(4, 60, 9))
    body = f'<g transform="scale({BIG})" fill="none" stroke="#1d3557" stroke-width="{width}">{arcs}</g>'
    body = f'<rect width="768" height="768" fill="#fff"/>{body}'
    large = Image.fromarray(np.round(255 * draw(body, BIG * SIDE, BIG * SIDE)).astype(np.uint8))
    assert find_edges(np.asarray(in_linear_light(large), np.float32)).is_linear
    assert not find_edges(np.asarray(large.resize((SIDE, SIDE), BOX), np.float32)).is_linear


def test_outlines_are_no_rings() -> None:
    """A dark outline around a paler shape is as clean as a ring, but much darker."""
    image = np.full((40, 40, 3), 250, np.float32)
    image[8:32, 8:32] = (20, 20, 90)
    image[10:30, 10:30] = (90, 120, 200)
    found = find_edges(image)
    assert not found.has_rings
    np.testing.assert_array_equal(found.plain, image)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 3), (3, 2), (1, 40), (3, 50)])
def test_small_images_have_no_edges_and_were_not_enlarged(shape: tuple[int, int]) -> None:
    for planes in (3, 4):
        image = np.zeros((*shape, planes), np.float32)
        image[-1:, -1:] = 200
        found = find_edges(image)
        np.testing.assert_array_equal(found.plain, image)
        assert not found.has_rings and not found.is_linear
    before = before_enlarging(np.full((*shape, 3), 90, np.float32))
    assert before is None or (before == 90).all()


def floats(image: Image.Image) -> FloatArray:
    return np.asarray(image, np.float32)


@pytest.mark.parametrize("size", [(120, 120), (144, 144), (201, 200), (230, 230), (301, 300)])
@pytest.mark.parametrize("by", ["Pillow", "OpenCV"])
def test_images_enlarged_by_any_factor_are_restored(size: tuple[int, int], by: str) -> None:
    was = small(BOX)
    large = was.resize(size, Image.Resampling.BILINEAR)
    if by == "OpenCV":
        large = Image.fromarray(cv2.resize(np.asarray(was), size, interpolation=cv2.INTER_LINEAR))
    found = before_enlarging(floats(large))
    assert found is not None and found.shape == (SIDE, SIDE, 3)
    assert np.abs(found - floats(was)).mean() < 0.5


def test_other_images_are_not_taken_for_enlarged() -> None:
    """Nor does what is smooth, or has edges along the axes only: a mixed pixel between flat ones lies alone
    between two of nearly any smaller image."""
    others = (Image.Resampling.BICUBIC, Image.Resampling.LANCZOS, Image.Resampling.NEAREST)
    images = [*(small(BOX).resize((150, 150), how) for how in others), small(BOX), enlarged(2)]
    images.append(small(BOX).filter(ImageFilter.GaussianBlur(2.5)))
    box = np.full((90, 120, 3), 250, np.float32)
    box[20:70, 30:80] = (40, 90, 160)
    box[20:70, 29], box[20:70, 80], box[19, 30:80], box[70, 30:80] = 180, 100, 230, 130
    for image in (*map(floats, images), box):
        assert before_enlarging(image) is None


def test_a_drawing_is_as_large_as_the_image_and_as_sharp_as_before() -> None:
    picture = pixels(small(BOX).resize((151, 150), Image.Resampling.BILINEAR))
    assert Picture.of(picture).pixels.shape[0] < 120
    made = warpsplat.vectorize(picture, subject="drawing")
    assert (made.scene.canvas.width, made.scene.canvas.height) == (151, 150)
    shown = (
        np.asarray(on_white(render_svg(made.svg, zoom=4).resize((4 * SIDE, 4 * SIDE), BOX)), np.float32) / 255
    )
    assert decibels(shown, pixels(enlarged(4))) > 38
    assert len(made.svg) < 800
    assert made.optics and made.optics.psnr > made.score.psnr  # type: ignore[union-attr]


INK = (61, 31, 54)
RAMP = '<linearGradient id="g"><stop stop-color="#fd0"/><stop offset="1" stop-color="#06c"/></linearGradient>'
SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{0}" viewBox="0 0 96 96">'
    '<rect width="96" height="96" fill="#fff"/><circle cx="30" cy="34" r="22" fill="#a23b72"/>'
    '<path d="M58 12l2-.5 20 76-2 .5zM12 70l60-8 .3 2-60 8z" fill="#3d1f36"/></svg>'
)


@pytest.mark.parametrize(("is_wrong", "is_shaded"), [(True, False), (False, False), (False, True)])
def test_colors_of_thin_lines_are_recovered(is_wrong: bool, is_shaded: bool) -> None:
    """Through the optics of a sharpened picture. A gradient stays and counts."""
    svg = SVG.replace("<rect", RAMP + "<rect").replace("#a23b72", "url(#g)") if is_shaded else SVG
    big = Image.fromarray(np.asarray(on_white(render_svg(svg.format(768)))).astype(np.uint8))
    made = big.resize((96, 96), BOX).filter(ImageFilter.UnsharpMask(1, 60 * (not is_shaded), 0))
    seen, true = Seen.of(pixels(made)), warpsplat.load_svg(svg.format(96))
    kernel = seen.find(*(show(each) for each in seen.scenes(true))).kernel
    is_ink = (np.abs(255 * true.colors - INK) < 1).all(axis=1)
    wrong = np.where(is_ink[:, None] & is_wrong, np.float32([0.15, 0, 0.12]), true.colors)
    found = with_seen_colors(replace(true, colors=wrong), seen, kernel, show)
    np.testing.assert_allclose(255 * found.colors, 255 * true.colors, atol=4)
    np.testing.assert_array_equal(found.stop_colors, true.stop_colors)
    np.testing.assert_array_equal(found.points, true.points)


def test_many_colours_stay() -> None:
    bars = "".join(
        f'<path d="M{5 * i} 0h4v96h-4z" fill="rgb({15 * i},0,90)"/>' for i in range(MOST_COLORS + 1)
    )
    drawn = warpsplat.load_svg(f'<svg xmlns="http://www.w3.org/2000/svg" width="96" height="96">{bars}</svg>')
    seen = Seen.of(draw(bars))
    fine = np.zeros((SCALE * 96, SCALE * 96, 4), np.float32)
    assert with_seen_colors(drawn, seen, seen.find(fine).kernel, lambda each: fine) is drawn
