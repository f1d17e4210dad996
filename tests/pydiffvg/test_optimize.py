"""SVG documents that are optimised in place."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
import torch

from tests.pydiffvg.helpers import on_white, psnr, shown, tensor
from warpsplat import pydiffvg
from warpsplat.errors import UsageError
from warpsplat.pydiffvg.optimizable import MODES, OptimizableTransform

DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" width="40" height="40">
<linearGradient id="sky"><stop stop-color="#aaf"/><stop offset="1" stop-color="#fca"/></linearGradient>
<rect width="40" height="40" style="fill:url(#sky)"/>
<g id="all" transform="translate(20 20)" opacity="0.9"><path id="bar" transform="rotate(20)"
d="M-14 -3H14V3H-14Z" style="fill:#228844;stroke:black;stroke-width:1"/></g></svg>"""


def document(
    tmp_path: Path, settings: pydiffvg.SvgOptimizationSettings | None = None, device: str = "cpu"
) -> pydiffvg.OptimizableSvg:
    path = tmp_path / "drawing.svg"
    path.write_text(DRAWING, encoding="utf-8")
    return pydiffvg.OptimizableSvg(path, settings, device=device)


def test_a_document_renders_and_is_written_as_its_file(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="there is no cuda:9"):
        svg = document(tmp_path, device="cuda:9")
    image = svg.render().cpu()
    (tmp_path / "written.svg").write_text(svg.write_xml(), encoding="utf-8")
    for name in ("drawing.svg", "written.svg"):
        assert psnr(on_white(image), shown(tmp_path / name)) > 33
    assert svg.render(scale=0.5).shape == (20, 20, 4)


def test_a_rotation_is_found(tmp_path: Path) -> None:
    settings = pydiffvg.SvgOptimizationSettings()
    settings.global_override(["paths", "optimize_points"], False)
    settings.global_override(["optimize_color"], False)
    settings.global_override(["transforms", "transform_lr"], 3e-2)
    settings.undefault("all")["transforms"]["optimize_transforms"] = False
    for name in ("stops", "color", "location"):
        settings.global_override(["gradients", f"optimize_{name}"], False)
    svg = document(tmp_path, settings)
    with torch.no_grad():
        target = svg.render()
        transform = svg.root.children[1].children[0].transform
        assert transform is not None
        transform.rotation.add_(0.25)
    losses = []
    for _ in range(45):
        svg.zero_grad()
        loss = (svg.render() - target).square().mean()
        loss.backward()
        svg.step()
        losses.append(loss.item())
    assert losses[-1] < 0.05 * losses[0]
    assert transform.rotation.item() == pytest.approx(0.349, abs=0.03)


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_starts_at_the_transform(mode: str) -> None:
    settings = pydiffvg.SvgOptimizationSettings.default_params["transforms"] | {"transform_mode": mode}
    rotated, sheared, mirrored = (
        [[0.6, -0.8, 3], [0.8, 0.6, -2]],
        [[1.2, 0.3, 3], [-0.5, 0.7, -2]],
        [[2, 0, 1], [0, -2, 5]],
    )
    for rows in (rotated, sheared, mirrored):
        matrix = tensor([*rows, [0, 0, 1]])
        assert torch.allclose(OptimizableTransform(matrix, settings)(), matrix, atol=1e-5)


def test_settings_are_saved(tmp_path: Path) -> None:
    settings = pydiffvg.SvgOptimizationSettings()
    settings.undefault("a")["color_lr"] = 0.5
    settings.override_optimizer("SGD")
    text = io.StringIO()
    settings.save(text)
    text.seek(0)
    again = pydiffvg.SvgOptimizationSettings(text)
    own, is_own = again.retrieve("a")
    assert is_own and own["color_lr"] == 0.5 and own["optimizer"] == "SGD"
    assert not again.retrieve("b")[1]
    assert again.reset_to_defaults("a")["color_lr"] == 2e-3
    settings.override_optimizer("Newton")
    with pytest.raises(UsageError, match="optimizer 'Newton'"):
        document(tmp_path, settings)
