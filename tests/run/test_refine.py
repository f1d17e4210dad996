"""Foreign SVGs, improved."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.runs import scored
from tests.scenes import random_scene
from tests.svg.foreign import FOREIGN, HEAD, load_scene
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.run.physical_size import PhysicalSize
from warpsplat.run.refine import refine_svg
from warpsplat.run.result import Result
from warpsplat.scene import Basis, Kind
from warpsplat.svg.read import load_kept
from warpsplat.svg.viewer import on_white, premultiplied, render_svg
from warpsplat.svg.write import write_svg


def improved(
    text: str, target: np.ndarray, settings: Settings, device: str, **how: bool
) -> tuple[Result, float]:
    refined = refine_svg(text, Problem(target, settings), Run(Backend.on(device)), "a.svg", **how)
    assert refined.before is not None
    return refined, refined.before


def test_nothing_is_added(device: str) -> None:
    """A file without a background gets none; one with a background keeps it."""
    target = np.full((30, 40, 3), 0.4, np.float32)
    for behind in ("", '<rect width="40" height="30" fill="#ccc"/>'):
        text = f'{HEAD}width="40" height="30">{behind}<path d="M5 5H35V25Z" fill="red"/></svg>'
        result, before = improved(text, target, make_settings(iterations=10), device)
        assert scored(result).psnr > before
        assert result.svg.count("<rect") == (1 if behind else 0)
        assert scored(result).psnr == pytest.approx(score_svg(result.svg, target).psnr)


def test_no_improvement_changes_nothing(device: str) -> None:
    text = HEAD + FOREIGN["lines"]
    target = (on_white(render_svg(text)) / 255).astype(np.float32)
    result, _ = improved(text, target, make_settings(iterations=5), device)
    assert result.svg == text


@pytest.mark.parametrize("kind", list(Kind))
def test_splines_of_own_files_stay_splines(device: str, kind: Kind) -> None:
    """Cubics would take twice as many numbers."""
    scene = random_scene(kind, count=6, width=48, height=40, seed=2, basis=Basis.SPLINE)
    target = render(scene, backend=Backend.on(device))
    noise = np.random.default_rng(0).normal(0, 0.5, scene.points.shape)
    text = write_svg(replace(scene, points=(scene.points + noise).astype(np.float32)), per_pixel=10)
    settings = make_settings(iterations=60, precision=1)
    result, before = improved(text, target, settings, device)
    assert scored(result).psnr > before + 3
    assert set(result.scene.basis) == {Basis.SPLINE}
    np.testing.assert_array_equal(result.scene.first, scene.first)
    assert scored(result).bytes < 1.15 * len(text), "0.92 to 0.97 over five seeds"
    back, _ = load_scene(result.svg, 48, 40, "b.svg")
    np.testing.assert_array_equal(back.basis, scene.basis)


MIXED = (
    '<linearGradient id="g"><stop stop-color="#fc0"/><stop offset="1" stop-color="#06c"/></linearGradient>'
    '<path fill-rule="evenodd" d="M3 3h20v20h-20zM8 8h10v10h-10z" fill="url(#g)" stroke="#024" '
    'stroke-width="2"/><path d="M28 5l9 18" stroke="green" stroke-width="3" stroke-dasharray="5 2"/>'
    '<circle cx="30" cy="9" r="6" fill="#a33" fill-opacity=".5"/>'
)


def test_shapes_of_any_kind_are_refined_together(device: str) -> None:
    """They stay what they are: holes, styles of strokes, gradients, fill and stroke of one path."""
    text = f'{HEAD}width="40" height="30">{MIXED}</svg>'
    wanted = text.replace("M3 3h20v20", "M4 4h19v22").replace("#a33", "#393").replace("l9 18", "l7 19")
    target = (on_white(render_svg(wanted)) / 255).astype(np.float32)
    result, before = improved(text, target, make_settings(iterations=80), device)
    assert scored(result).psnr > before + 6
    assert result.svg.count("<path") == 2 and result.svg.count("<circle") == 1
    for word in ("evenodd", "stroke-dasharray", "linearGradient", "fill-opacity"):
        assert word in result.svg


COVER = '<g filter="url(#f)"><path d="M8 6h24v18h-24z" fill="#fd0"/></g>'
FILTERED = (
    f'{HEAD}width="40" height="30"><filter id="f"><feOffset dx="1"/></filter><rect width="40" height="30" '
    f'fill="#246"/><path d="M3 4h14v22h-14z" fill="#c33"/><path d="M12 9h14v10h-14z" fill="#0a4"/>{COVER}'
    '<path d="M14 12h20v14z" fill="#358"/></svg>'
)


SHEET = re.compile(r'<svg xmlns="\S+" width="(\S+)" height="(\S+)" viewBox="([^"]+)">')


@pytest.mark.parametrize(
    "sheet",
    [
        {"page": "a4"},
        {"size": "50x40mm"},
        {"units": "in"},
        {"dpi": 200.0},
        {"page": "a5", "background": "none"},
    ],
    ids=str,
)
def test_a_picture_on_a_sheet_stays_there(device: str, sheet: dict[str, str]) -> None:
    """The paths are the same as without the sheet, and the picture lies in the same place on it."""
    target = np.ascontiguousarray(picture()[:36, :48])
    settings = make_settings(curves=6, iterations=20, **sheet)
    scene = random_scene(Kind.FILL, count=6, width=48, height=36, seed=2)
    still = write_svg(scene, per_pixel=2, background=not sheet.get("background"))
    text = PhysicalSize(settings, (48, 36), (96, 96), "").given_to(still)
    wanted, result = (improved(svg, target, settings, device)[0] for svg in (still, text))
    assert wanted.score and result.before
    assert scored(result).psnr == scored(wanted).psnr > result.before
    assert scored(result).bytes == len(result.svg.encode())
    assert result.svg[result.svg.index("<path") :].strip() in wanted.svg
    before, after = (SHEET.match(svg) for svg in (text, result.svg))
    assert before and after and after.groups()[:2] == before.groups()[:2]
    views = [np.array(found[3].split(), np.float64) for found in (before, after)]
    np.testing.assert_allclose(views[1] / views[1][2], views[0] / views[0][2], atol=1e-5)


def test_margins_of_a_foreign_file_are_part_of_the_picture(device: str) -> None:
    """The file looks like one on a sheet, but was not written by warpsplat."""
    head = '<svg xmlns="http://www.w3.org/2000/svg" width="24px" height="24px" viewBox="-2 -2 24 24">'
    text = f'{head}<rect x="-2" y="-2" width="24" height="24"/><path d="M0 0h9v9z" fill="red"/></svg>'
    target = np.zeros((24, 24, 3), np.float32)
    target[2:12, 2:12] = [1, 0, 0]
    before = improved(text, target, make_settings(iterations=3), device)[1]
    assert before == pytest.approx(score_svg(text, target).psnr)


def test_paths_around_kept_elements_are_fitted(device: str) -> None:
    """Below them, in front of them, and out of sight, where it stays as it is."""
    target = (on_white(render_svg(FILTERED)) / 255).astype(np.float32)
    moved = FILTERED.replace("M3 4h14v22h-14z", "M5 6h12v18h-12z").replace("M14 12h20v14z", "M18 13h13v10z")
    result, before = improved(moved, target, make_settings(iterations=150), device, keep=True)
    assert scored(result).psnr > before + 12
    assert scored(result).psnr == pytest.approx(score_svg(result.svg, target).psnr)
    below, above = result.svg.split(COVER)
    assert (below.count("<path"), above.count("<path")) == (2, 1)
    assert result.as_dict()["curves"] == 3
    before_it = load_kept(moved, 40, 30, "a.svg").scene
    np.testing.assert_allclose(result.scene.points_of(1), before_it.points_of(1), atol=1)


def test_paths_below_a_blended_element_are_fitted(device: str) -> None:
    """Paths are fitted below an element that is multiplied with them."""
    blend = '<path d="M8 2h24v26h-24z" fill="#fa0" style="mix-blend-mode:multiply"/>'
    text = f'{HEAD}width="40" height="30"><rect width="40" height="30" fill="#eee"/>%s{blend}</svg>'
    target = (on_white(render_svg(text % '<path d="M5 5h30v12h-30z" fill="#4ac"/>')) / 255).astype(np.float32)
    moved = text % '<path d="M7 7h25v12h-25z" fill="#4ac"/>'
    result, before = improved(moved, target, make_settings(iterations=200), device, keep=True)
    assert scored(result).psnr > max(before + 8, 28)
    assert blend in result.svg


def clear(text: str) -> np.ndarray:
    return (premultiplied(render_svg(text)) / 255).astype(np.float32)


def test_a_transparent_image_keeps_the_file_transparent(device: str) -> None:
    text = f'{HEAD}width="40" height="30"><path d="M5 5h20v20h-20z" fill="#fff" fill-opacity=".7"/></svg>'
    target = clear(text.replace("M5 5h20v20", "M8 6h22v18"))
    result, before = improved(text, target, make_settings(iterations=100), device)
    assert scored(result).psnr > before + 10
    assert "<rect" not in result.svg
    shown = np.asarray(render_svg(result.svg).convert("RGBA"))
    assert not shown[target[..., 3] == 0].any(), "what is empty stays empty"
    assert scored(result).psnr == pytest.approx(score_svg(result.svg, target).psnr), "on black and on white"


def test_backgrounds(device: str) -> None:
    """The file's lies behind a transparent image, unless another is asked for."""
    path = '<path d="M5 5h20v20h-20z" fill="#c00"/>'
    behind = '<rect width="40" height="30" fill="#ff0"/>'
    target = clear(f'{HEAD}width="40" height="30">{path.replace("h20v20", "h25v18")}</svg>')
    text = f'{HEAD}width="40" height="30">{behind}{path}</svg>'

    def corner(text: str, image: np.ndarray, background: str) -> list[int]:
        settings = make_settings(iterations=20, background=background)
        result, before = improved(text, image, settings, device)
        assert scored(result).psnr > before
        return np.asarray(render_svg(result.svg).convert("RGBA"))[29, 39].tolist()

    plain = text.replace(behind, "")
    assert corner(text, target, "auto") == [255, 255, 0, 255]
    assert corner(plain, target, "auto") == [0, 0, 0, 0]
    assert corner(plain, target, "#204060") == [0x20, 0x40, 0x60, 255]
    assert corner(text, target, "#204060") == [0x20, 0x40, 0x60, 255]
    opaque = np.concatenate([target[..., :3], np.ones_like(target[..., 3:])], axis=2)
    assert corner(text, opaque, "none")[3] < 255, "a shape as any other, which moves"
    assert corner(plain, opaque, "none") == [0, 0, 0, 0]
