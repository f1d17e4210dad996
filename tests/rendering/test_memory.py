"""Pictures that no memory holds are refused before anything is allocated for them."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import cast

import pytest
import warp as wp

import warpsplat
from tests.scenes import random_scene
from warpsplat.errors import ResourceError, UsageError
from warpsplat.rendering import backend, memory
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.memory import check_memory
from warpsplat.scene import Kind

SCENE = random_scene(Kind.FILL, width=40, height=40)


def by_torch(side: int, count: int) -> object:
    from warpsplat.torch import SceneTensors, render

    return render([SceneTensors.of(SCENE)] * count, side, side)


def by_pydiffvg(side: int) -> object:
    import torch

    from warpsplat import pydiffvg

    path = pydiffvg.Path(
        num_control_points=torch.tensor([0, 0, 0]),
        points=torch.tensor([[1.0, 1.0], [9.0, 1.0], [9.0, 9.0]]),
        is_closed=True,
    )
    group = pydiffvg.ShapeGroup(shape_ids=torch.tensor([0]), fill_color=torch.tensor([1.0, 0.0, 0.0, 1.0]))
    scene = pydiffvg.RenderFunction.serialize_scene(side, side, [path], [group])
    return pydiffvg.RenderFunction.apply(side, side, 2, 2, 0, None, *scene)


WAYS: dict[str, Callable[[int], object]] = {
    "scene": lambda side: warpsplat.render(SCENE, side, device="cpu"),
    "splat": lambda side: warpsplat.render(SCENE, side, side, device="cpu", renderer="splat"),
    "scale": lambda side: warpsplat.render(SCENE, scale=side / 40, device="cpu"),
    "tensors": lambda side: by_torch(side, 1),
    "several tensors": lambda side: by_torch(side, 3),
    "pydiffvg": by_pydiffvg,
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("side", [30_000, 200_000])
def test_what_no_memory_holds(way: str, side: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "machine_memory", lambda: 8 * 10**9)
    made: list[int] = []
    array = backend.Backend.array

    def counted(self: backend.Backend, dtype: object, *shape: int) -> object:
        made.extend(shape)
        return array(self, dtype, *shape)

    monkeypatch.setattr(backend.Backend, "array", counted)
    with pytest.raises(ResourceError, match=rf"of {side}x{side} px would take about .* 7\.2 GB; draw it"):
        WAYS[way](side)
    assert max(made, default=0) < 10**6


def test_what_is_small_is_drawn_without_a_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "machine_memory", lambda: pytest.fail("asked"))
    assert warpsplat.render(SCENE, 80, device="cpu").shape == (80, 80, 4)


def test_sides_beyond_any_number() -> None:
    for way in ("scene", "tensors"):
        with pytest.raises(UsageError, match=r"width must be a (whole )?number"):
            WAYS[way](10**400)
    with pytest.raises(ResourceError, match="GB"):
        warpsplat.render(SCENE, scale=1e300, device="cpu")


def test_on_a_gpu_what_is_free_counts() -> None:
    """Others may have taken the rest."""
    gpu = cast(wp.Device, SimpleNamespace(is_cpu=False, free_memory=10**9, total_memory=10**11))
    check_memory(Viewport(4000, 4000), gpu)
    with pytest.raises(ResourceError, match=r"a picture of 5000x5000 px would take about 1\.2 GB, .* 900 MB"):
        check_memory(Viewport(5000, 5000), gpu)
