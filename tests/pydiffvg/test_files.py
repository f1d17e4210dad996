"""SVG files and images read and written, and documents that are optimised in place."""

from __future__ import annotations

import io
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import torch

from tests.pydiffvg.helpers import SIZE, blob, group, on_white, png, psnr, render, shown, tensor
from warpsplat import pydiffvg
from warpsplat.errors import ImageError, UsageError
from warpsplat.pydiffvg.optimizable import MODES, OptimizableTransform

DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 48 48" width="96">
<style>.a {fill: #3366cc}</style><linearGradient id="l" x1="0" y1="0" x2="1" y2="1">
<stop offset="0" stop-color="red"/><stop offset="1" stop-color="blue" stop-opacity=".5"/></linearGradient>
<radialGradient id="r"><stop offset="0.2" stop-color="#fff"/><stop offset="1"/></radialGradient>
<rect width="48" height="48" fill="#eed"/>
<g transform="translate(4 3) rotate(5)"><path class="a" d="M2 2h14v12q-6 8 -14 0z" opacity=".8"/></g>
<ellipse cx="34" cy="12" rx="10" ry="6" fill="url(#l)" stroke="#222" stroke-width="2"/>
<circle cx="14" cy="34" r="9" fill="url(#r)"/>
<path d="M26 28L44 30L36 44z M32 32L36 40L40 33z" fill="green" fill-rule="evenodd"/>
<path d="M4 24C16 18 20 30 44 22" fill="none" stroke="purple" stroke-width="3" stroke-dasharray="5 3"/>
<g opacity=".5"><circle cx="20" cy="24" r="3"/></g></svg>"""


def test_a_drawing_is_read_and_written(tmp_path: Path) -> None:
    source, small, saved = tmp_path / "drawing.svg", tmp_path / "small.svg", tmp_path / "new" / "saved.svg"
    source.write_text(DRAWING, encoding="utf-8")
    small.write_text(DRAWING.replace('width="96"', 'width="48"'), encoding="utf-8")
    width, height, shapes, groups = pydiffvg.svg_to_scene(source)
    assert (width, height) == (SIZE, SIZE)
    assert all(isinstance(shape, pydiffvg.Path) for shape in shapes)
    image = render(shapes, groups)
    pydiffvg.save_svg(saved, width, height, shapes, groups)
    assert min(psnr(on_white(image), shown(path)) for path in (small, saved)) > 36
    parsed = pydiffvg.parse_scene(ElementTree.fromstring(DRAWING))
    assert parsed[:2] == (SIZE, SIZE)
    assert torch.equal(render(*parsed[2:]), image)


def test_segments_keep_their_degree() -> None:
    (path,) = pydiffvg.from_svg_path("M2 2h14v12q-6 8 -14 0c1 2 3 4 5 6z")
    assert path.num_control_points.tolist() == [0, 0, 1, 2, 0]
    assert path.is_closed and len(path.points) == 8
    (line,) = pydiffvg.from_svg_path("M2 2h14v12", torch.diag(tensor(2, 3, 1)))
    assert not line.is_closed
    assert line.points.tolist() == [[4, 6], [32, 6], [32, 42]]
    (closed,) = pydiffvg.from_svg_path("M2 2h14v12", force_close=True)
    assert closed.is_closed and closed.num_control_points.tolist() == [0, 0, 0]


def test_gamma_and_background_of_a_saved_scene(tmp_path: Path) -> None:
    shapes, groups = [pydiffvg.Rect(tensor(0, 0), tensor(8, 8))], [group(0, tensor(0.2, 0.2, 0.2, 1.0))]
    pydiffvg.save_svg(tmp_path / "a.svg", 8, 8, shapes, groups, use_gamma=True)
    # Filters work in linear light unless each of their parts says otherwise, as DiffVG's does.
    assert "feFuncA" in (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert shown(tmp_path / "a.svg")[4, 4, 0] == pytest.approx(0.2 ** (1 / 2.2), abs=0.01)
    pydiffvg.save_svg(tmp_path / "b.svg", SIZE, SIZE, [blob()], [group()], background="background: #cde")
    assert ElementTree.parse(tmp_path / "b.svg").getroot().get("style") == "background: #cde"
    assert pydiffvg.prettify(ElementTree.fromstring("<a><b/></a>")).endswith("<a>\n  <b />\n</a>")


STOPS = '<stop stop-color="red"/><stop offset="1"/>'
RECT = '<rect width="9" height="9" fill="url(#g)"/>'


@pytest.mark.parametrize(
    ("body", "cause"),
    [
        ("<text>a</text>", "uses <text>"),
        (f'<linearGradient id="g" spreadMethod="repeat">{STOPS}</linearGradient>{RECT}', "Method repeat"),
        (f'<radialGradient id="g" fx=".2">{STOPS}</radialGradient>{RECT}', "focus"),
    ],
)
def test_unsupported_elements_are_named(tmp_path: Path, body: str, cause: str) -> None:
    path = tmp_path / "a.svg"
    text = f'<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9">{body}</svg>'
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ImageError, match=f"a.svg: .*{cause}"):
        pydiffvg.svg_to_scene(path)
    with pytest.raises(ImageError, match=cause):
        pydiffvg.parse_scene(ElementTree.fromstring(text))


def test_images(tmp_path: Path) -> None:
    image = torch.full((4, 5, 4), 0.25)
    pydiffvg.imwrite(image, tmp_path / "new" / "a.png")
    found = png(tmp_path / "new" / "a.png")
    assert found.shape == (4, 5, 4)
    assert found[0, 0].tolist() == [136, 136, 136, 64]
    assert float(image[0, 0, 0]) == 0.25
    pydiffvg.imwrite(np.array([[1.0, 3.0]]), str(tmp_path / "b.png"), gamma=1.0, normalize=True)
    assert png(tmp_path / "b.png").tolist() == [[0, 255]]
    pydiffvg.imwrite(image, tmp_path / "c.jpg", gamma=1.0)
    assert png(tmp_path / "c.jpg").shape == (4, 5, 3)


DOCUMENT = """<svg xmlns="http://www.w3.org/2000/svg" width="40" height="40">
<linearGradient id="sky"><stop stop-color="#aaf"/><stop offset="1" stop-color="#fca"/></linearGradient>
<rect width="40" height="40" style="fill:url(#sky)"/>
<g id="all" transform="translate(20 20)" opacity="0.9"><path id="bar" transform="rotate(20)"
d="M-14 -3H14V3H-14Z" style="fill:#228844;stroke:black;stroke-width:1"/></g></svg>"""


def document(
    tmp_path: Path, settings: pydiffvg.SvgOptimizationSettings | None = None, device: str = "cpu"
) -> pydiffvg.OptimizableSvg:
    path = tmp_path / "drawing.svg"
    path.write_text(DOCUMENT, encoding="utf-8")
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
