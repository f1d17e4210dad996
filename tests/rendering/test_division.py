"""Results depend neither on lanes, nor on threads, nor on the capacity that a renderer starts with."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.helpers import SPLAT, adjoint, relative_error, renderer_for
from tests.scenes import CURVES, mixed_scene, random_scene, styled_scene, with_gradients
from warpsplat.rendering import backend
from warpsplat.rendering.backend import GPU_LANES, Backend
from warpsplat.rendering.models import EXACT
from warpsplat.rendering.renderer import Capacity, render
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import Basis, Canvas, Cap, Join, Kind, Scene

FOLDING: Any = SPLAT if SPLAT is EXACT else replace(SPLAT, fold=0.5)  # type: ignore[type-var]


def enlarged(scene: Scene) -> Scene:
    return replace(scene, points=(1.5 * scene.points).astype(np.float32))


def shapes(kind: Kind, basis: Basis = Basis.CUBIC) -> Scene:
    return enlarged(random_scene(kind, count=30, width=90, height=70, seed=4, basis=basis))


def mixed(splines: bool = True) -> Scene:
    both = (mixed_scene(90, 70, seed=seed, splines=splines) for seed in (4, 5))
    return enlarged(functools.reduce(Scene.append, both))


def opaque(scene: Scene) -> Scene:
    return replace(scene, opacities=np.ones_like(scene.opacities))


PAINTED = replace(with_gradients(mixed_scene(seed=2)), canvas=Canvas(40, 36, None))

CASES: dict[str, tuple[Scene, Any]] = {
    **{f"{kind.name}-{basis.name}": (shapes(kind, basis), EXACT) for kind in Kind for basis in CURVES},
    **{f"{kind.name}-splat": (shapes(kind), FOLDING) for kind in Kind},
    "mixed": (mixed(), EXACT),
    "mixed-splat": (mixed(splines=False), SPLAT),
    "styled": (styled_scene(Cap.SQUARE, Join.MITER, seed=5), EXACT),
    "dashed": (styled_scene(Cap.SQUARE, Join.MITER, 1, seed=5), EXACT),
    "opaque": (opaque(mixed_scene(seed=1)), EXACT),
    "opaque-painted": (opaque(PAINTED), EXACT),
}
by_case = pytest.mark.parametrize("case", CASES)


def outcome(case: str, device: str, **division: int) -> list[np.ndarray]:
    """Image, gradients and removal costs, which are not known of opaque shapes."""
    scene, model = CASES[case]
    is_opaque = "opaque" in case
    renderer = renderer_for(scene, device, model=model, opaque=is_opaque, **division)
    weights = np.random.default_rng(0).normal(size=renderer.read_image().shape)
    target = renderer.backend.columns_of(to_tiles(np.abs(weights)))
    costs = [] if is_opaque else [renderer.removal_costs(target)]
    return [renderer.read_image(), *costs, *adjoint(renderer, weights).values()]


@by_case
def test_results_do_not_depend_on_lanes(device: str, case: str) -> None:
    """A GPU's vectors of pixels are shorter than a CPU's."""
    by_lanes = (outcome(case, device, lanes=lanes) for lanes in (1, 16, GPU_LANES))
    for one, *others in zip(*by_lanes, strict=True):
        for many in others:
            assert relative_error(many, one) < (1e-4 if "opaque" in case else 2e-5)


@by_case
def test_same_bits_for_any_number_of_threads(device: str, case: str) -> None:
    outcomes = [outcome(case, device, threads=threads) for threads in (1, 2, 3, 1)]
    for arrays in zip(*outcomes, strict=True):
        for other in arrays[1:]:
            np.testing.assert_array_equal(other, arrays[0])


@by_case
def test_scenes_that_outgrow_the_arrays(device: str, case: str) -> None:
    scene, model = CASES[case]
    small = renderer_for(scene, device, model=model, capacity=Capacity(50, 5))
    assert small.capacity.samples >= small.needed_samples.numpy()[0] > 50
    np.testing.assert_array_equal(small.read_image(), render(scene, model=model, backend=Backend.on(device)))


@pytest.mark.parametrize("scene", [mixed_scene(seed=1), PAINTED], ids=["plain", "painted"])
def test_adjoint_for_opaque_shapes_equals_the_usual_one(device: str, scene: Scene) -> None:
    usual, found = (adjoint(renderer_for(scene, device, opaque=opaque), 0.7) for opaque in (False, True))
    for name, gradient in found.items():
        assert relative_error(gradient, usual[name]) < 1e-4, name


@pytest.mark.parametrize(("cores", "asked", "threads"), [(3, None, 3), (64, None, 8), (64, 32, 32)])
def test_many_cores_are_used_only_if_asked_for(
    cores: int, asked: int | None, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backend, "available_cores", lambda: cores)
    assert Backend.on("cpu", asked).threads == threads
