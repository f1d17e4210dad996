"""What programs written on top of DiffVG do besides the plain loop."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from xml.etree import ElementTree

import pytest
import torch

from tests.pydiffvg.helpers import SIZE, render, tensor
from warpsplat import pydiffvg
from warpsplat.errors import ImageError
from warpsplat.pydiffvg import device as first_device

LOGO = f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIZE} {SIZE}">
<rect width="30" height="20" fill="#123456"/><path d="M4 30L40 28L30 44z" fill="red" opacity=".5"/></svg>"""


def blob() -> pydiffvg.Path:
    """Of two cubics, closed."""
    points = tensor([[8, 20], [10, 4], [36, 6], [40, 22], [42, 40], [12, 44]])
    return pydiffvg.Path(torch.tensor([2, 2]), points, True, tensor(0.0))


def group(number: int = 0, color: torch.Tensor | None = None) -> pydiffvg.ShapeGroup:
    return pydiffvg.ShapeGroup(torch.tensor([number]), tensor(0.8, 0.4, 0.2, 0.9) if color is None else color)


def test_a_document_that_is_parsed_already(tmp_path: Path) -> None:
    """Programs that refine SVGs of language models never write them to a file."""
    path = tmp_path / "logo.svg"
    path.write_text(LOGO, encoding="utf-8")
    width, height, shapes, groups = pydiffvg.parse_scene(ElementTree.fromstring(LOGO))
    assert (width, height) == (SIZE, SIZE)
    assert torch.equal(render(shapes, groups), render(*pydiffvg.svg_to_scene(path)[2:]))
    with pytest.raises(ImageError, match="uses <text>"):
        pydiffvg.parse_scene(ElementTree.fromstring(LOGO.replace("<rect", "<text>a</text><rect")))


def test_size_of_the_canvas_leads_the_arguments() -> None:
    arguments = pydiffvg.RenderFunction.serialize_scene(SIZE, 40, [blob()], [group()])
    assert arguments[:2] == [SIZE, 40]


def test_the_device_is_an_attribute() -> None:
    assert isinstance(pydiffvg.device, torch.device)
    assert pydiffvg.device is first_device
    assert torch.ones(1, device=pydiffvg.device).device.type == pydiffvg.get_device().type
    assert pydiffvg.use_gpu == torch.cuda.is_available()


def test_a_background_without_opacity_is_opaque() -> None:
    colors = torch.rand(SIZE, SIZE, 3, generator=torch.Generator().manual_seed(1))
    opaque = torch.cat([colors, torch.ones(SIZE, SIZE, 1)], dim=2)
    colors.requires_grad_()
    image = render([blob()], [group()], colors)
    assert torch.equal(image, render([blob()], [group()], opaque))
    image.sum().backward()
    assert colors.grad is not None and colors.grad.shape == colors.shape
    assert float(colors.grad[0, 0, 0]) == pytest.approx(1.0, abs=1e-5)


def test_a_style_of_the_whole_file(tmp_path: Path) -> None:
    pydiffvg.save_svg(tmp_path / "a.svg", SIZE, SIZE, [blob()], [group()], background="background: #cde")
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert ElementTree.fromstring(text).get("style") == "background: #cde"
    assert pydiffvg.prettify(ElementTree.fromstring("<a><b/></a>")).endswith("<a>\n  <b />\n</a>")


def test_a_document_on_a_gpu_that_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "logo.svg"
    path.write_text(LOGO, encoding="utf-8")
    with pytest.warns(UserWarning, match="there is no cuda:9"):
        svg = pydiffvg.OptimizableSvg(path, device="cuda:9")
    assert svg.render().isfinite().all()


def test_copies_are_scenes_of_their_own() -> None:
    shapes, groups = [blob()], [group()]
    shapes[0].points.requires_grad_()
    copied = copy.deepcopy(shapes), copy.deepcopy(groups)
    stored = pickle.loads(pickle.dumps((shapes, groups)))
    copied[0][0].points.data += 3
    render(*copied).sum().backward()
    assert copied[0][0].points.grad is not None and shapes[0].points.grad is None
    assert torch.equal(render(*stored), render(shapes, groups))


def test_shapes_are_added_between_steps() -> None:
    """One optimiser for all that there are so far, values clamped in place, as layer by layer programs do."""
    target = render([blob()], [group(color=tensor(0.1, 0.3, 0.9, 1.0))])
    shapes: list[pydiffvg.Path] = []
    groups: list[pydiffvg.ShapeGroup] = []
    losses = []
    for number in range(3):
        shapes.append(blob())
        shapes[-1].points = (shapes[-1].points * 0.5 + 6 * number).requires_grad_()
        groups.append(group(number, torch.tensor([0.5, 1.2, -0.1, 1.0], requires_grad=True)))
        colors = [one.fill_color for one in groups]
        optimizer = torch.optim.Adam([one.points for one in shapes], lr=0.5)
        optimizer.add_param_group({"params": colors, "lr": 0.05})
        for _ in range(4):
            optimizer.zero_grad()
            loss = (render(shapes, groups) - target).square().mean()
            loss.backward()
            optimizer.step()
            with torch.no_grad():
                for color in colors:
                    assert isinstance(color, torch.Tensor)
                    color.clamp_(0.0, 1.0)
            losses.append(loss.item())
    assert losses[-1] < 0.6 * losses[0]


def test_only_what_asks_for_a_gradient_has_one() -> None:
    shape, of = blob(), group()
    assert isinstance(of.fill_color, torch.Tensor)
    of.fill_color.requires_grad_()
    image = render([shape], [of], size=(24, 32))
    image.sum().backward()
    assert of.fill_color.grad is not None and shape.points.grad is None
    with torch.no_grad():
        assert not render([shape], [of]).requires_grad


def test_values_may_change_before_the_way_back() -> None:
    """The gradient is that of the picture as it was."""
    gradients = []
    for moves in (False, True):
        shape = blob()
        shape.points.requires_grad_()
        image = render([shape], [group()])
        if moves:
            shape.points.data.mul_(0.5)
        image[..., 3].sum().backward()
        gradients.append(shape.points.grad)
    assert torch.equal(*gradients)
