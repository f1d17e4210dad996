"""Foreign SVGs, improved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import ragged_scene, random_scene
from tests.svg.foreign import FOREIGN, HEAD
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.jobs.refine import refine
from warpsplat.jobs.vectorize import Result
from warpsplat.metrics import score_svg
from warpsplat.render.backend import Backend
from warpsplat.render.renderer import render
from warpsplat.scene import Basis, Kind
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg


def improved(
    text: str, target: np.ndarray, settings: Settings, device: str, **how: bool
) -> tuple[Result, float]:
    refined = refine(text, target, settings, Backend.on(device), name="a.svg", **how)
    return refined.result, refined.before


def test_nothing_is_added(device: str) -> None:
    """A file without a background gets none; one with a background keeps it."""
    target = np.full((30, 40, 3), 0.4, np.float32)
    for behind in ("", '<rect width="40" height="30" fill="#ccc"/>'):
        text = f'{HEAD}width="40" height="30">{behind}<path d="M5 5H35V25Z" fill="red"/></svg>'
        result, before = improved(text, target, make_settings(iterations=10), device)
        assert result.score and result.score.psnr > before
        assert result.svg.count("<rect") == (1 if behind else 0)
        assert result.score.psnr == pytest.approx(score_svg(result.svg, target).psnr)


def test_refining_raises_the_psnr_and_keeps_the_paths(device: str) -> None:
    scene = random_scene(Kind.FILL, count=6, width=48, height=40, seed=2)
    target = render(scene, backend=Backend.on(device))
    rng = np.random.default_rng(0)
    moved = replace(scene, points=scene.points + rng.normal(0, 1, scene.points.shape).astype(np.float32))
    text = write_svg(moved)
    result, before = improved(text, target, make_settings(iterations=120), device)
    assert result.score
    assert result.score.psnr > before + 4
    assert result.score.paths == 6
    assert result.score.nodes <= 6 * 6


def test_paths_of_different_lengths_stay_as_long(device: str) -> None:
    text = (
        HEAD
        + 'width="40" height="30"><path d="M5 5H35V25Z"/>'
        + ('<path d="M9 9h2v2h2v2h2v2h2v2h-10z" fill="red"/></svg>')
    )
    target = np.full((30, 40, 3), 0.4, np.float32)
    result, _ = improved(text, target, make_settings(iterations=10), device)
    assert result.score
    assert result.score.nodes <= 20


def test_no_improvement_changes_nothing(device: str) -> None:
    text = HEAD + FOREIGN["lines"]
    target = (on_white(render_svg(text)) / 255).astype(np.float32)
    result, _ = improved(text, target, make_settings(iterations=5), device)
    assert result.svg == text


@pytest.mark.parametrize("kind", list(Kind))
def test_splines_of_own_files_stay_splines(device: str, kind: Kind) -> None:
    """As cubics they would take twice as many numbers."""
    scene = random_scene(kind, count=6, width=48, height=40, seed=2, basis=Basis.SPLINE)
    target = render(scene, backend=Backend.on(device))
    noise = np.random.default_rng(0).normal(0, 0.5, scene.points.shape)
    text = write_svg(replace(scene, points=(scene.points + noise).astype(np.float32)), per_pixel=10)
    settings = make_settings(iterations=60, precision=1)
    result, before = improved(text, target, settings, device)
    assert result.score
    assert result.score.psnr > before + 3
    assert set(result.scene.basis) == {Basis.SPLINE}
    np.testing.assert_array_equal(result.scene.first, scene.first)
    assert result.score.bytes < 1.05 * len(text)
    back, _ = load_scene(result.svg, 48, 40, "b.svg")
    np.testing.assert_array_equal(back.basis, scene.basis)


def test_an_own_file_of_both_bases_is_refined(device: str) -> None:
    """Also of an image of another size than the file says."""
    outlines = [(Kind.FILL, basis, n) for n in (3, 5) for basis in Basis]
    text = write_svg(ragged_scene(outlines, 48, 40, seed=1), per_pixel=3)
    target = np.full((80, 96, 3), 0.4, np.float32)
    result, before = improved(text, target, make_settings(iterations=10), device)
    assert result.score
    assert result.score.psnr > before
    assert result.scene.basis.tolist() == [basis for _, basis, _ in outlines]


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
    assert result.score
    assert result.score.psnr > before + 6
    assert result.svg.count("<path") == 3
    for word in ("evenodd", "stroke-dasharray", "linearGradient", "fill-opacity"):
        assert word in result.svg
